"""Calibrations of one sensor by different models, brought to the effects that all of them have.

If one has more, its sensor is calibrated again without them, as another one was: noise-free
readings that it would give in evenly spread attitudes, under the conditions of the other session,
by the approach of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.calibration.applying import SensorCalibration
from accelstudy.campaign.calibration.device import KNOWN, USUAL
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import angles_of
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

POSITIONS = 60
"""Attitudes of the calibration that leaves out effects."""
STEP = 1e-2
"""Step of its derivatives, of the sigmas."""
GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class Common:
    """What n calibrations have in common.

    Attributes
    ----------
    model : SensorModel, the effects that all have
    values : (n, p) array, SI
    covariances : (n, p, p) array
    dof : (n,) array, degrees of freedom by which the noise was estimated; inf if it is known
    """

    model: SensorModel
    values: Array
    covariances: Array
    dof: Array

    def missing_in(self, one: SensorCalibration) -> list[str]:
        """Effects of the sensor that a calibration has, and another one lacks."""
        common = [effect.spec for effect in self.model.effects]
        return [spec for spec in _effects(one) if spec not in common]


def in_common(calibrations: Sequence[SensorCalibration]) -> Common:
    """Bring calibrations of one sensor to the effects that all of them have.

    Raises
    ------
    InputError
        If one of them has no sigmas, if they have no effect in common, or if their parameters do
        not mean the same because the readings were converted in another way. The line names the
        calibration by its number and its campaign.
    """
    common = _effects(calibrations[0])
    for number, one in enumerate(calibrations, start=1):
        where = f"calibration {number} ({one.content['campaign']})"
        if not np.isfinite(one.covariance).all():
            raise InputError(
                f"{where}: no sigmas; calibrate with more positions, or state the noise of the "
                "campaign"
            )
        if one.content["nominal"] != calibrations[0].content["nominal"]:
            raise InputError(
                f"{where}: nominal: other scales or offsets from counts to m/s^2 than in the first "
                "calibration, so their parameters do not mean the same; import both logs with the "
                "same ones"
            )
        left = [spec for spec in common if spec in _effects(one)]
        if not left:
            raise InputError(
                f"{where}: effects: none in common with those before: {comma_list(_effects(one))} "
                f"here, {comma_list(common)} there"
            )
        common = left
    model = compose(composition_name(compose("common", tuple(common)).effects), tuple(common))
    fewest = sorted(calibrations, key=lambda one: len(_effects(one)))[:2]
    values, covariances = zip(
        *(_brought_to(one, model, fewest[one is fewest[0]]) for one in calibrations), strict=True
    )
    dof = np.array([one.dof for one in calibrations])
    return Common(model, np.array(values), np.array(covariances), dof)


def session_like(like: SensorCalibration, directions: Array) -> Campaign:
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


def _effects(calibration: SensorCalibration) -> list[str]:
    """Effects of the sensor: the rig of a session stays behind."""
    return [effect.spec for effect in calibration.model.effects if effect.part == "sensor"]


def _brought_to(
    calibration: SensorCalibration, model: SensorModel, like: SensorCalibration
) -> tuple[Array, Array]:
    """Parameters (p,) and covariance matrix (p, p) of a model with fewer effects."""
    own = calibration.model
    part = compose("sensor", tuple(_effects(calibration)))
    kept = [own.parameter_names.index(name) for name in part.parameter_names]
    given, covariance = calibration.parameters[kept], calibration.covariance[np.ix_(kept, kept)]
    if len(part.effects) == len(model.effects):
        order = [part.parameter_names.index(name) for name in model.parameter_names]
        return given[order], covariance[np.ix_(order, order)]
    session = session_like(like, evenly_spread(POSITIONS))
    approach = get_approach(str(like.content["approach"] or "gravity"))

    def readings(parameters: Array) -> Array:
        forces = -session.gravity * evenly_spread(POSITIONS)
        return part.sense(forces, parameters, session.gravity, session.hold)

    fit = fit_campaign(replace(session, forces=readings(given)), model, approach)
    steps = STEP * np.sqrt(np.diag(covariance))
    stepped = np.concatenate([given + np.diag(steps), given - np.diag(steps)])
    angles = fit.observed.angles
    observed = replace(
        fit.observed,
        forces=np.array([readings(parameters) for parameters in stepped]),
        angles=None if angles is None else np.repeat(angles, len(stepped), axis=0),
        initial=fit.parameters,
    )
    found = calibrate(model, approach, observed).parameters[:, : model.n_parameters]
    above, below = np.split(found, 2)
    slopes = ((above - below) / (2 * steps[:, None])).T
    return fit.parameters, slopes @ covariance @ slopes.T
