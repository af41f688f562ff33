"""Two or more calibrations of one sensor: what changed, what drifts, and what scatters.

Calibrations by different models are brought to the effects that all of them have. If one has more,
its sensor is calibrated again without them, as another one was: noise-free readings that it would
give in evenly spread attitudes, under the conditions of the other session, by the approach of that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.wording import comma_list, counted
from accelstudy.campaign.calibration.applying import KNOWN, USUAL, SensorCalibration
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.session import Campaign
from accelstudy.effects import Parameter
from accelstudy.epochs.congruence import LEVEL, Epochs
from accelstudy.epochs.course import Course
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import ATTITUDES, cap_forces, tilt_error
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

YEAR = 365.25 * 86400.0
"""s"""
MIN_CALIBRATIONS = 3
"""Calibrations of which a line leaves a degree of freedom."""
MIN_DIFFERENCE = 1e-12
"""rad, difference that is rounding alone."""
POSITIONS = 60
"""Attitudes of the calibration that leaves out effects."""
STEP = 1e-2
"""Step of its derivatives, of the sigmas."""
GOLDEN = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True, eq=False)
class History:
    """Calibrations of one sensor in the order of time, and what they have in common.

    Two of them are a comparison: what changed is told by all parameters together, with their whole
    covariance matrices. Three or more have rates, and a scatter, of each parameter.

    Attributes
    ----------
    calibrations : tuple of n SensorCalibration
    model : SensorModel, the effects that all have
    values : (n, p) array, SI
    covariances : (n, p, p) array
    dates : tuple of n datetime; empty in a comparison
    """

    calibrations: tuple[SensorCalibration, ...]
    model: SensorModel
    values: Array
    covariances: Array
    dates: tuple[datetime, ...] = ()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that all have."""
        return self.model.parameters

    @property
    def dof(self) -> Array:
        """Degrees of freedom by which the noise was estimated, (n,); inf if it is known."""
        return np.array([one.dof for one in self.calibrations])

    @property
    def sigmas(self) -> Array:
        """Sigmas of `values`."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))

    def left_out(self, one: SensorCalibration) -> list[str]:
        """Effects of the sensor that a calibration has, and another one lacks."""
        common = [effect.spec for effect in self.model.effects]
        return [spec for spec in _effects(one) if spec not in common]

    @cached_property
    def change(self) -> Epochs:
        """The last calibration less the first, for the test of congruence."""
        first, *_, last = self.dof.tolist()
        covariances = self.covariances[0], self.covariances[-1]
        return Epochs(self.values[-1] - self.values[0], covariances, (first, last))

    def instead_of(self, place: int) -> list[str]:
        """Names of parameters that may have changed instead of one that did."""
        return [self.model.parameter_names[i] for i in self.change.instead_of(place)]

    def tilt(self, tilt_range: float) -> Array:
        """Rms by which roll and pitch differ, and that which chance would give, (2, 2), rad.

        Readings are those of the sensor as it was at first; they are leveled as if it had not
        changed, and as it is at last.

        Parameters
        ----------
        tilt_range : float, rad
        """
        last, first = self.calibrations[-1], self.values[0]
        g, forces = last.gravity, cap_forces(tilt_range, ATTITUDES, last.gravity)
        hold = session_like(last, -forces / g).hold
        error = tilt_error(self.model, first, self.model, self.values[-1], forces, g, hold)
        by_chance = np.einsum("auw,uw->a", error.quadratic, self.change.covariance)
        return np.sqrt(
            [np.where(error.constant > MIN_DIFFERENCE**2, error.constant, 0.0), by_chance]
        )

    @cached_property
    def years(self) -> Array:
        """Time before the last calibration, (n,), negative."""
        return np.array([(date - self.dates[-1]).total_seconds() / YEAR for date in self.dates])

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Each parameter over time."""
        variances = np.diagonal(self.covariances, axis1=1, axis2=2)
        each = zip(self.values.T, variances.T, strict=True)
        return tuple(Course(self.years, *parameter, self.dof) for parameter in each)

    @property
    def level(self) -> float:
        """Level of the tests of one parameter over time."""
        return LEVEL / len(self.parameters)

    @cached_property
    def found(self) -> tuple[tuple[str, ...], ...]:
        """What each parameter does over time, in words, at one level for all."""
        return tuple(course.found(self.level) for course in self.courses)


def compare(first: SensorCalibration, second: SensorCalibration) -> History:
    """Compare two calibrations of one sensor, the older one first.

    Raises
    ------
    InputError
        As `history_of`.
    """
    return _in_common((first, second))


def follow(
    calibrations: Sequence[SensorCalibration],
    dates: Sequence[str | datetime],
    names: Sequence[str],
) -> History:
    """Follow a sensor by dates that are given, or by those of the campaigns.

    Parameters
    ----------
    calibrations : sequence of SensorCalibration
    dates : sequence of str or datetime, of each calibration; none for those of the campaigns
    names : sequence of str, what messages call the calibrations

    Raises
    ------
    InputError
        If a date is missing or wrong, a calibration is given twice, or as by `history_of`.
    """
    if dates and len(dates) != len(calibrations):
        raise InputError(
            f"{key('dates')}: {counted(len(dates), 'date')} for "
            f"{counted(len(calibrations), 'calibration')}; give one for each, in their order, as "
            "2026-03-01"
        )
    first: dict[bytes, str] = {}
    for one, name in zip(calibrations, names, strict=True):
        # Noise never repeats: the same numbers are one campaign, whatever the file is called.
        same = first.setdefault(one.parameters.tobytes(), name)
        if same is not name:
            raise InputError(f"{name}: has the numbers of {same}; each counts once")
    where = [key("dates")] * len(dates) or [f"{name}: date" for name in names]
    stated = dates or [one.content["date"] for one in calibrations]
    return history_of(calibrations, [_date(*each) for each in zip(stated, where, strict=True)])


def _date(given: str | datetime | None, where: str) -> datetime:
    if given is None:
        raise InputError(
            f"{where}: missing; give `dates` for each calibration, or calibrate "
            "again with `date` in the header of the campaign"
        )
    if isinstance(given, datetime):
        return given
    try:
        return read_date(given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def history_of(calibrations: Sequence[SensorCalibration], dates: Sequence[datetime]) -> History:
    """Put calibrations of one sensor in the order of time, and bring them to common effects.

    Raises
    ------
    InputError
        If they are fewer than three or of one date; if one of them has no sigmas, if they have no
        effect in common, or if their parameters do not mean the same because the readings were
        converted in another way. The line names the calibration by its number and its campaign.
    """
    if len(calibrations) < MIN_CALIBRATIONS:
        raise InputError(
            f"CALIBRATION: a history has {MIN_CALIBRATIONS} or more, not {len(calibrations)}; "
            "`compare` takes two"
        )
    if len(set(dates)) < 2:
        raise InputError(f"{key('dates')}: all are the same; a rate needs two dates or more")
    unordered, order = _in_common(calibrations), sorted(range(len(dates)), key=dates.__getitem__)
    return History(
        tuple(calibrations[i] for i in order),
        unordered.model,
        unordered.values[order],
        unordered.covariances[order],
        tuple(dates[i] for i in order),
    )


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


def _in_common(calibrations: Sequence[SensorCalibration]) -> History:
    """Bring calibrations of one sensor to the effects that all of them have."""
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
    return History(tuple(calibrations), model, np.array(values), np.array(covariances))


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
