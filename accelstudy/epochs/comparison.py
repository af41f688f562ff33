"""Comparison of two calibrations of one sensor: whether it changed, in what, and what it matters.

What two calibrations have in common are the effects that both estimate. If one has more, its
sensor is calibrated again without them, as the other one was: noise-free readings that it would
give in evenly spread attitudes, under the conditions of the other session, by the approach of that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.calibration.applying import Calibration
from accelstudy.campaign.calibration.device import KNOWN, USUAL
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.effects import Parameter
from accelstudy.epochs.congruence import Epochs, Test
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, tilt_error
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

POSITIONS = 60
"""Attitudes of the calibration that leaves out effects."""
STEP = 1e-2
"""Step of its derivatives, of the sigmas."""
NOTHING = 1e-12
"""rad, difference that is rounding alone."""
GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two calibrations, and what they have in common.

    Attributes
    ----------
    first, second : Calibration
    model : SensorModel, the effects that both have
    values : (2, p) array, SI, the parameters of both
    epochs : Epochs, the second less the first
    tilt_range : float, rad
    """

    first: Calibration
    second: Calibration
    model: SensorModel
    values: Array
    epochs: Epochs
    tilt_range: float

    @cached_property
    def test(self) -> Test:
        """Whether the sensor is still what it was."""
        return self.epochs.test()

    @cached_property
    def changed(self) -> tuple[int, ...]:
        """Places of the parameters that changed; all others are congruent."""
        return self.epochs.changed()

    def instead_of(self, place: int) -> list[str]:
        """Names of parameters that may have changed instead of one of `changed`."""
        names = self.model.parameter_names
        return [names[i] for i in self.epochs.instead_of(place, self.changed)]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that both have."""
        return self.model.parameters

    @cached_property
    def tilt(self) -> Array:
        """Rms by which roll and pitch differ, and that which chance would give, (2, 2), rad.

        Readings are those of the sensor as it was; they are leveled as if it had not changed, and
        as it is now.
        """
        g, forces = self.second.gravity, cap_forces(self.tilt_range, ATTITUDES, self.second.gravity)
        hold = _session(self.second, -forces / g).hold
        error = tilt_error(self.model, self.values[0], self.model, self.values[1], forces, g, hold)
        by_chance = np.einsum("auw,uw->a", error.quadratic, self.epochs.covariance)
        return np.sqrt([np.where(error.constant > NOTHING**2, error.constant, 0.0), by_chance])

    def only_in(self, one: Calibration) -> list[str]:
        """Effects of the sensor that one of the calibrations has, and the other lacks."""
        return [spec for spec in _effects(one) if spec not in self._common]

    @property
    def _common(self) -> list[str]:
        return [effect.spec for effect in self.model.effects]


def compare(
    first: Calibration, second: Calibration, tilt_range: float = MAX_TILT_GON * GON
) -> Comparison:
    """Compare two calibrations of one sensor.

    Parameters
    ----------
    first, second : Calibration, the older one first
    tilt_range : float, rad, over which tilts are compared

    Raises
    ------
    InputError
        If a calibration has no sigmas, if they have no effect in common, or if their parameters do
        not mean the same because the readings were converted in another way.
    """
    for which, one in (("first", first), ("second", second)):
        if not np.isfinite(one.covariance).all():
            raise InputError(
                f"the {which} calibration has no sigmas; calibrate with more positions, or state "
                "the noise of the campaign"
            )
    if first.content["nominal"] != second.content["nominal"]:
        raise InputError(
            "nominal: the two calibrations take other scales or offsets from counts to m/s^2, so "
            "their parameters do not mean the same; import both logs with the same ones"
        )
    common = [spec for spec in _effects(first) if spec in _effects(second)]
    if not common:
        raise InputError(
            f"effects: the calibrations have none in common: {comma_list(_effects(first))} in the "
            f"first, {comma_list(_effects(second))} in the second"
        )
    model = compose(composition_name(compose("common", tuple(common)).effects), tuple(common))
    values, covariances = zip(
        _brought_to(first, model, second), _brought_to(second, model, first), strict=True
    )
    epochs = Epochs(values[1] - values[0], covariances, (_dof(first), _dof(second)))
    return Comparison(first, second, model, np.array(values), epochs, tilt_range)


def _effects(calibration: Calibration) -> list[str]:
    """Effects of the sensor: the rig of a session stays behind."""
    return [effect.spec for effect in calibration.model.effects if effect.part == "sensor"]


def _dof(calibration: Calibration) -> float:
    """Degrees of freedom by which its noise was estimated; inf if it was stated."""
    content = calibration.content
    return np.inf if content["sigma_source"] == "a priori" else float(content["redundancy"])


def _brought_to(
    calibration: Calibration, model: SensorModel, like: Calibration
) -> tuple[Array, Array]:
    """Parameters (p,) and covariance matrix (p, p) of a model with fewer effects."""
    own = calibration.model
    part = compose("sensor", tuple(_effects(calibration)))
    kept = [own.parameter_names.index(name) for name in part.parameter_names]
    given, covariance = calibration.parameters[kept], calibration.covariance[np.ix_(kept, kept)]
    if len(part.effects) == len(model.effects):
        order = [part.parameter_names.index(name) for name in model.parameter_names]
        return given[order], covariance[np.ix_(order, order)]
    session = _session(like, evenly_spread(POSITIONS))
    approach = get_approach(str(like.content["approach"] or "gravity"))

    def again(parameters: Array) -> Array:
        readings = part.sense(-session.gravity * evenly_spread(POSITIONS), parameters,
                              session.gravity, session.hold)  # fmt: skip
        return fit_campaign(replace(session, forces=readings), model, approach).parameters

    steps = STEP * np.diag(np.sqrt(np.diag(covariance)))
    slopes = np.array([(again(given + h) - again(given - h)) / (2 * h.sum()) for h in steps]).T
    return again(given), slopes @ covariance @ slopes.T


def _session(like: Calibration, directions: Array) -> Campaign:
    """Session in which gravity has some directions, under the conditions of a calibration."""
    n, forces = len(directions), -like.gravity * directions
    columns = {}
    for k, (column, name) in enumerate(KNOWN.items(), start=1):
        low, high = like.ranges.get(name, USUAL[column])
        columns[column] = low + (high - low) * (GOLDEN * k * np.arange(n) % 1.0)
    return Campaign(
        "comparison",
        np.arange(1, n + 1),
        forces,
        like.gravity,
        sigma_force=Noise().sigma_force,
        angles=angles_of(forces),
        sigma_angle=Noise().sigma_angle,
        yaw=np.zeros(n),
        **columns,
    )
