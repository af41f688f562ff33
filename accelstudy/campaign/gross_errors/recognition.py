"""The judge of plausibility: gross errors are recognised by trying what would mend them.

Even before calibration a real sensor agrees with its robot, or with gravity, within some hundredths
of g. Data in a wrong unit, with swapped axes or exchanged rows do not. So a sensor is fitted that
starts at the ideal one and stays near it, and positions that are far off get no weight.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import ROBOT_UNITS, SENSOR_UNITS, STANDARD_GRAVITY, UNITS
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.gross_errors.errors import (
    SIGNED_PERMUTATIONS,
    Array,
    angles_times,
    matrix_of,
    ordered,
    other_units,
    turned,
)
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import specific_force, usual_norm
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.plausibility import LARGEST

USUAL_SD = 0.3
"""Standard deviation of each parameter of an uncalibrated sensor, as a share of gravity."""
MIN_RATIO = 4.0
"""How many times better an explanation must fit to be clear. A position that is farther off than so
many times the usual distance is wrong."""
MAX_USABLE_ERROR = 0.15
"""Share of gravity by which no usable sensor is wrong."""
MIN_POSITION_ERROR = 0.005
"""Share of gravity by which a single position must be off to be called wrong, and by which an
exchange of rows must improve the fit."""
MIN_DISTANCE = 1e-6
"""Distance, as a share of gravity, below which differences do not count."""
MIN_SPARE_POSITIONS = 3
"""Positions beyond the number of fitted parameters that are needed to notice a wrong one."""
MAX_ITERATIONS = 40
"""Largest number of iterations."""
MAX_ERRORS = 4
"""Largest number of gross errors of one stage that are looked for in a campaign."""
MIN_GROSS_ERROR = 0.1
"""Share of gravity: if no position is farther off, no unit and no axis can be wrong."""
AS_GOOD = 1.25
"""Two explanations whose distances differ by less than this factor fit equally well; the simpler
one is taken."""
RIGHT_UNIT = 1 - LARGEST["scale"]
"""Share of gravity that even a bad sensor reads in the right unit."""
MAX_AXIS_RATIO = 2.0
"""Axes are tried if their distance from the ideal sensor is at most this many times the smallest
distance of any axes."""
MAX_NAMED = 20
"""Largest number of exchanged positions that a message names."""
MAX_EXCHANGED = 1000
"""Largest number of rows that are reordered; if more do not fit, their order is not the cause."""
MIN_POSITIONS_PER_OUTLIER = 8
"""At most one of so many positions may be bumped; if more are off, something else is wrong."""


@dataclass(frozen=True)
class Mending:
    """What would undo a gross error.

    Attributes
    ----------
    name : str, of the gross error
    reason : str, what is wrong, in words
    campaign : Campaign, mended
    matrix : (3, 3) array, turns forces as they were read into mended ones; None if it is I
    changed : (n,) bool array, which positions change; None if all do
    left_out : tuple of int, positions that cannot be mended
    """

    name: str
    reason: str
    campaign: Campaign
    matrix: Array | None = None
    changed: NDArray[np.bool_] | None = None
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True)
class Recognised:
    """Gross errors that were recognised.

    Attributes
    ----------
    errors : tuple of Mending, one after the other
    """

    errors: tuple[Mending, ...]

    @property
    def named(self) -> tuple[tuple[str, int | None], ...]:
        """Names of the errors, each once, and the number of each bumped position."""
        named = [
            (error.name, place) for error in self.errors for place in error.left_out or (None,)
        ]
        return tuple(dict.fromkeys(named))

    @property
    def name(self) -> str:
        """Name of the first error."""
        return self.errors[0].name

    @property
    def reasons(self) -> dict[str, str]:
        """What is wrong, in words, by the names of the errors."""
        return {
            name: "; ".join(error.reason for error in self.errors if error.name == name)
            for name, _ in self.named
        }

    @property
    def reason(self) -> str:
        """All that is wrong, in words."""
        return "; ".join(self.reasons.values())

    @property
    def mended(self) -> Campaign:
        """The campaign with its errors undone."""
        return self.errors[-1].campaign

    @property
    def matrix(self) -> Array | None:
        """Matrix (3, 3) that turns forces as they were read into mended ones; None if it is I."""
        steps = [error.matrix for error in self.errors if error.matrix is not None]
        return np.linalg.multi_dot([*steps[::-1], np.eye(3)]) if steps else None


def check_size(
    where: str, forces: Array, gravity: float, unit: str, conversion: Conversion
) -> list[str]:
    """Check that forces, most of them at rest, are roughly as large as gravity.

    Even bad sensors are wrong by some tenths only, so a factor of two has another cause.

    Parameters
    ----------
    where : str, begins the message
    forces : (n, 3) array, m/s²
    gravity : float, m/s²
    unit, conversion : of the numbers that the forces were read from

    Returns
    -------
    list of str
        A warning if the size is farther off than the scale of any accelerometer.

    Raises
    ------
    InputError
        If the size is wrong by a factor of two; it says what would be right.
    """

    def near(size: float, gravity: float) -> bool:
        return gravity / 2 < size < gravity * 2

    norm, share = usual_norm(forces), usual_norm(forces) / gravity - 1
    what = f"the forces are about {norm:.3g} m/s²"
    if near(norm, gravity):
        if abs(share) <= LARGEST["scale"]:
            return []
        keys = "`scale` and `offset`" if unit == "counts" else "`unit`"
        return [
            f"at rest {what}, {100 * abs(share):.0f} % {'more' if share > 0 else 'less'} than "
            f"gravity, {gravity:g} m/s²: no accelerometer is so far off; check {keys}, and "
            "`gravity`"
        ]
    number = norm / float(np.mean(np.abs(conversion.scale)))
    if unit != "m/s^2":
        what = f"the forces are about {number:.3g} {unit}, {norm:.3g} m/s²"
    if near(norm, STANDARD_GRAVITY):
        raise InputError(
            f"{where}: {what}, which does not fit a gravity of {gravity:g} m/s²; give `gravity`"
        )
    sizes = UNITS["m/s^2"]
    better = [u for u in SENSOR_UNITS if u != unit and near(number * sizes[u], gravity)]
    if not better and unit != "counts" and number > 100:
        better = ["counts"]
    if better:
        needs = ", and need a scale" if better == ["counts"] else ""
        raise InputError(
            f"{where}: {what}: these look like {better[0]}, not {unit}{needs}; give `unit` "
            f"{better[0]}"
        )
    raise InputError(
        f"{where}: {what}, nowhere near gravity, {gravity:g} m/s²; give another `unit`, `scale` or "
        "`offset`, or other `columns`"
    )


def check_plausible(campaign: Campaign, where: str, angle_unit: str = "gon") -> list[str]:
    """Refuse what no calibration could make use of: a wrong unit, or forces of the wrong sign.

    Parameters
    ----------
    campaign : Campaign
    where : str, begins the message
    angle_unit : str, of the numbers that the robot's angles were read from

    Returns
    -------
    list of str, warnings as of `check_size`

    Raises
    ------
    InputError
        If a wrong unit or sign is recognised; it says what would be right.
    """
    conversion = campaign.nominal or conversion_of(campaign.unit)
    doubts = check_size(where, campaign.forces, campaign.gravity, campaign.unit, conversion)
    gross = _of_all_positions(campaign, True, angle_unit) if campaign.angles is not None else []
    for error in gross:
        if error.name == "unit_error":
            raise InputError(f"{where}: {error.reason}, not in {angle_unit}")
        if error.matrix is not None and np.array_equal(error.matrix, -np.eye(3)):
            raise InputError(
                f"{where}: {error.reason}; in forward, right, down specific force at level is "
                "(0, 0, −g)"
            )
    return doubts


def recognise(
    campaign: Campaign, attitude: bool = True, angle_unit: str = "gon"
) -> Recognised | None:
    """Recognise wrong units, swapped axes, exchanged rows and bumped positions, if they are gross.

    Without the angles of a robot, swapped axes and exchanged rows do not show: they leave the norm
    of the force as it is.

    Parameters
    ----------
    campaign : Campaign
    attitude : bool, whether to compare with the robot's angles, if there are any
    angle_unit : str, of the numbers that these were read from

    Returns
    -------
    Recognised, or None if nothing looks wrong

    Raises
    ------
    InputError
        If the forces are nowhere near gravity and no unit explains it.
    """
    attitude = attitude and campaign.angles is not None
    errors = _of_all_positions(campaign, attitude, angle_unit)
    mended = errors[-1].campaign if errors else campaign
    # A sensor that is mounted askew is no reason to reorder its positions.
    mounted = _is_mounted(mended, attitude)
    # A row that was not exchanged may still be wrong by itself.
    for stage in (rows, outliers):
        errors += _errors((stage,), mended, attitude, mounted)
        mended = errors[-1].campaign if errors else campaign
    of_mended = conversion_of("m/s^2")
    check_size(f"{campaign.name}: fx, fy, fz", mended.forces, campaign.gravity, "m/s^2", of_mended)
    return Recognised(tuple(errors)) if errors else None


def _of_all_positions(campaign: Campaign, attitude: bool, angle_unit: str) -> list[Mending]:
    """Gross errors that all positions have: a wrong unit, or wrong axes."""
    errors: list[Mending] = []
    everywhere = (axes, partial(units, angle_unit=angle_unit))
    # The norm shows a wrong unit even if the axes are wrong, so gravity comes before the attitudes.
    for of_attitude in (False, True)[: 1 + attitude]:
        mended = errors[-1].campaign if errors else campaign
        errors += _errors(everywhere, mended, of_attitude)
    return errors


def _errors(
    stage: tuple[Hypotheses, ...], campaign: Campaign, attitude: bool, mounted: bool = False
) -> list[Mending]:
    """Gross errors of a stage: the one whose mending helps most first, until none helps clearly."""
    errors: list[Mending] = []
    sensor, everywhere = RealSensor.of(campaign, attitude, mounted), axes in stage
    while len(errors) < MAX_ERRORS:
        if everywhere and sensor.distance.max() < MIN_GROSS_ERROR * sensor.gravity:
            break
        helps = []
        mirrored = everywhere and RealSensor.of(campaign, attitude, mounted=True).mirrored
        for hypotheses in stage:
            for mending in hypotheses(campaign, sensor):
                after = RealSensor.of(mending.campaign, attitude, mounted)
                if _clear(mending, sensor, after, mirrored):
                    helps.append((mending, after))
        if not helps:
            break
        least = min(after.misfit for _, after in helps)
        best, sensor = next(one for one in helps if one[1].misfit <= AS_GOOD * least)
        errors.append(best)
        campaign = best.campaign
    return errors


def _is_mounted(campaign: Campaign, attitude: bool) -> bool:
    """Whether most positions fit clearly better if the sensor may be mounted in any way."""
    sensor = RealSensor.of(campaign, attitude)
    if sensor.expected is None or sensor.usual < MIN_POSITION_ERROR * sensor.gravity:
        return False
    return MIN_RATIO * RealSensor.of(campaign, attitude, mounted=True).usual < sensor.usual


def _clear(mending: Mending, before: RealSensor, after: RealSensor, mirrored: bool) -> bool:
    """Whether a mending clearly improves what was clearly wrong; no sensor is mirrored."""
    if mending.left_out:
        return True
    if mending.changed is None:
        if mirrored and mending.matrix is not None and np.linalg.det(mending.matrix) < 0:
            return after.misfit < before.misfit
        # Single positions may be wrong as well: it is enough that most others fit then.
        gained = before.misfit > MIN_RATIO * after.misfit
        return bool(gained or before.usual > MIN_RATIO * after.usual)
    was, now = (np.median(sensor.distance[mending.changed]) for sensor in (before, after))
    return bool(
        was > max(MIN_RATIO * now, MIN_RATIO**2 * after.usual, MIN_POSITION_ERROR * before.gravity)
    )


# --- What would mend a campaign, the simplest first -----------------------------------------------


def axes(campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
    """Undo each of the 47 exchanges of axes that are likely; none shows without a robot."""
    if sensor.expected is None:
        return
    ideal = attitude_forces(campaign)
    # An ideal sensor with any bias is near enough to compare all quickly.
    tried, misses = [], []
    for shown in SIGNED_PERMUTATIONS:
        for mending in _undone(campaign, matrix_of(shown).T):
            error = mending.campaign.forces - ideal
            bias = np.median(error, axis=0)
            distance = np.linalg.norm(error - bias, axis=1)
            misses.append(float(np.mean(np.minimum(distance, campaign.gravity))))
            moved = sum(abs(axis) != i for i, axis in enumerate(shown, 1))
            changes = (moved, sum(axis < 0 for axis in shown), float(np.linalg.norm(bias)))
            tried.append((changes, mending))
    near = [
        one for one, miss in zip(tried, misses, strict=True) if miss < MAX_AXIS_RATIO * min(misses)
    ]
    yield from (one for _, one in sorted(near, key=lambda one: one[0]) if one.reason)
    assert campaign.angles is not None
    exchanged = replace(campaign, angles=campaign.angles[:, ::-1].copy())
    yield Mending("axis_error", "roll and pitch of the robot are exchanged", exchanged)


def _undone(campaign: Campaign, matrix: Array) -> Iterator[Mending]:
    """Undo an exchange of axes, and one of columns of counts, before nominal scales and offsets."""
    reason = _axes_in_words(matrix) if np.any(matrix != np.eye(3)) else ""
    yield Mending("axis_error", reason, turned(campaign, matrix), matrix)
    if (nominal := campaign.nominal) is None or not reason:
        return
    # Counts P r, read with S and o, were r: S (r − o) = S P S⁻¹ · S (P⁻¹ r − P⁻¹ o).
    scaled = matrix * nominal.scale[:, None] / nominal.scale
    offset = np.abs(matrix).T @ nominal.offset
    if np.allclose(scaled, matrix) and np.array_equal(offset, nominal.offset):
        return
    moved = campaign.forces + (nominal.offset - offset) * nominal.scale
    read = replace(campaign, forces=moved, nominal=Conversion(nominal.scale, offset))
    reason += ", in the counts, before `scale` and `offset`"
    yield Mending("axis_error", reason, turned(read, scaled), scaled)


def _axes_in_words(matrix: Array) -> str:
    """Say which axes are wrong, from the matrix that mends them."""
    order, signs = np.argmax(np.abs(matrix), axis=1), matrix.sum(axis=1)
    words = ", ".join(
        f"{axis} is read as {'−' if sign < 0 else ''}{'xyz'[other]}"
        for axis, other, sign in zip("xyz", order, signs, strict=True)
        if sign < 0 or axis != "xyz"[other]
    )
    wrong = "have the wrong sign" if (order == range(3)).all() else "are swapped"
    return f"axes {wrong}: {words}"


def units(campaign: Campaign, sensor: RealSensor, angle_unit: str = "gon") -> Iterator[Mending]:
    """Convert the forces, or the angles, as if they were in another unit."""
    norm = usual_norm(campaign.forces) / campaign.gravity
    own = campaign.unit if campaign.unit in SENSOR_UNITS else "m/s^2"
    for stated in (own, "g" if own == "m/s^2" else "m/s^2"):
        for unit, factor in other_units(SENSOR_UNITS, "m/s^2", stated).items():
            if RIGHT_UNIT < factor * norm < 1 / RIGHT_UNIT:
                instead = "" if stated == "m/s^2" else f", not in {stated}"
                mended = turned(campaign, factor * np.eye(3))
                reason = f"the forces are in {unit}{instead}"
                yield Mending("unit_error", reason, mended, factor * np.eye(3))
    if sensor.expected is not None:
        for unit, factor in other_units(ROBOT_UNITS, "rad", angle_unit).items():
            reason = f"the robot's angles are in {ROBOT_UNITS[unit]}"
            yield Mending("unit_error", reason, angles_times(campaign, factor))


def rows(campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
    """Move each row that does not fit to the position where it fits; any number of rows."""
    if sensor.expected is None or not sensor.tells:
        return
    lost = sensor.usual > MAX_USABLE_ERROR * sensor.gravity
    wrong = np.flatnonzero(sensor.wrong | lost)
    if not 1 < len(wrong) <= MAX_EXCHANGED:
        return
    # Rows in the same attitude could be exchanged at will, so an exchange must gain something.
    least = min(MIN_RATIO * sensor.usual, MIN_POSITION_ERROR * sensor.gravity)
    cost = campaign.forces[wrong][:, None] - sensor.expected[wrong][None]
    order = np.arange(campaign.n_positions)
    order[wrong] = wrong[_places(np.linalg.norm(cost, axis=2), least)]
    moved = order != np.arange(len(order))
    if moved.any():
        shown = [str(position) for position in campaign.positions[moved][:MAX_NAMED]]
        more = int(moved.sum()) - len(shown)
        positions = ", ".join(shown) + (f" and {more} more" if more else "")
        reason = f"the forces of positions {positions} are exchanged"
        yield Mending("row_order", reason, ordered(campaign, order), changed=moved)


def _places(cost: Array, least: float) -> NDArray[np.int_]:
    """Return the row for each position, (s,): those that fit best, where they do so clearly.

    Parameters
    ----------
    cost : (s, s) array, distance of each row (first index) from what each position should read
    least : float, that an exchange must gain
    """
    stay = np.arange(len(cost))
    total = cost**2 + least**2 * (1 - np.eye(len(cost)))
    if np.array_equal(np.argmin(total, axis=1), stay):
        return stay
    from scipy.optimize import linear_sum_assignment  # slow to import, and seldom needed

    places = linear_sum_assignment(total.T)[1]
    for cycle in _cycles(places):
        after = np.linalg.norm(cost[places[cycle], cycle])
        if np.linalg.norm(cost[cycle, cycle]) < MIN_RATIO * after:
            places[cycle] = cycle
    return places


def _cycles(places: NDArray[np.int_]) -> list[NDArray[np.int_]]:
    """Positions that exchange their rows among each other."""
    left, cycles = set(range(len(places))), []
    while left:
        cycle = [left.pop()]
        while (following := int(places[cycle[-1]])) in left:
            left.remove(following)
            cycle.append(following)
        cycles.append(np.array(cycle))
    return cycles


def outliers(campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
    """Leave out positions that are so wrong that they would spoil a calibration."""
    far = sensor.wrong & (sensor.distance > MAX_USABLE_ERROR * sensor.gravity)
    bumped = tuple(campaign.positions[far].tolist())
    if not sensor.tells or not 0 < len(bumped) <= campaign.n_positions // MIN_POSITIONS_PER_OUTLIER:
        return
    # Far from a usual sensor, and yet all may fit one whose bias or scale no sensor has.
    free = RealSensor.of(campaign, sensor.expected is not None, mounted=True)
    if free.distance.max() < MIN_POSITION_ERROR * sensor.gravity:
        return
    sizes = comma_list([f"{size:.2g}" for size in sensor.distance[far]])
    reason = f"position {comma_list([str(p) for p in bumped])} is wrong by {sizes} m/s^2"
    if len(bumped) > 1:
        reason = reason.replace("position", "positions", 1).replace(" is ", " are ", 1)
    left = campaign.without(dict.fromkeys(bumped, reason))
    yield Mending("outlier_position", reason, left, left_out=bumped)


# --- How well a real sensor can fit a campaign ----------------------------------------------------


@dataclass(frozen=True)
class RealSensor:
    """A sensor that was fitted to most positions of a campaign.

    Attributes
    ----------
    expected : (n, 3) array, m/s², what it reads in each position; None where only the norm is known
    distance : (n,) array, m/s², of each reading from what it should be
    gravity : float, m/s²
    tells : bool, whether there are enough positions to say which of them are wrong
    mirrored : bool, whether its axes are left-handed, as those of no sensor are, however mounted;
        only of one that may be mounted in any attitude
    """

    expected: Array | None
    distance: Array
    gravity: float
    tells: bool
    mirrored: bool = False

    @property
    def usual(self) -> float:
        """Distance of the usual position, m/s²."""
        return float(np.median(self.distance))

    @property
    def misfit(self) -> float:
        """Mean distance, m/s²; each position counts by `MAX_USABLE_ERROR` at most."""
        return float(np.mean(np.minimum(self.distance, MAX_USABLE_ERROR * self.gravity)))

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """Which positions, (n,), do not fit."""
        return self.distance > MIN_RATIO * self.usual

    @classmethod
    def of(cls, campaign: Campaign, attitude: bool, mounted: bool = False) -> RealSensor:
        """Fit a sensor, robustly.

        Parameters
        ----------
        campaign : Campaign
        attitude : bool, whether to compare with the robot's attitudes, or with gravity alone
        mounted : bool, whether the sensor may be mounted in any attitude, with errors of any size
        """
        g, conditions = campaign.gravity, _conditions(campaign)
        share = np.inf if mounted else USUAL_SD
        if not attitude:
            # The norm of (I + D) f/g + c is 1: linear in the nine numbers of (I + D)ᵀ(I + D), c.
            x, y, z = unit = campaign.forces.T / g
            columns = [*unit**2, x * y, y * z, z * x, *unit]
            columns += [c * axis for c in conditions for axis in unit]
            design = np.stack(columns, axis=1)
            lacking = (1 - np.sum(unit**2, axis=0, keepdims=True).T) / 2
            squares = 1 - 2 * (lacking - _robust(design, lacking, share))[:, 0]
            return cls(None, g * np.abs(np.sqrt(np.maximum(squares, 0)) - 1), g, _tells(design))
        ideal = attitude_forces(campaign)
        columns = [*ideal.T / g, np.ones(len(ideal)), *conditions]
        design, lacking = np.stack(columns, axis=1), (campaign.forces - ideal) / g
        expected = ideal + g * _robust(design, lacking, share)
        distance = np.linalg.norm(campaign.forces - expected, axis=1)
        mirrored = mounted and _left_handed(design, expected / g, float(np.median(distance)) / g)
        return cls(expected, distance, g, _tells(design), mirrored)


def attitude_forces(campaign: Campaign) -> Array:
    """Return what an ideal sensor reads at the robot's angles, (n, 3), m/s²."""
    assert campaign.angles is not None
    roll, pitch = campaign.angles.T
    return np.column_stack(specific_force(roll, pitch, campaign.gravity))


def _left_handed(design: Array, expected: Array, noise: float) -> bool:
    """Whether what a sensor reads is a mirror image of the forces, the first columns of a design.

    Each axis has to show clearly, or its direction would be one of noise.
    """
    inverse = np.linalg.pinv(design)
    matrix = (inverse @ expected)[:3]
    error = noise * np.linalg.norm(inverse[:3], ord=2)
    least = np.linalg.svd(matrix, compute_uv=False)[-1]
    return bool(np.linalg.det(matrix) < 0 and least > MIN_RATIO * error)


def _tells(design: Array) -> bool:
    n, u = design.shape
    return n >= u + MIN_SPARE_POSITIONS


def _conditions(campaign: Campaign) -> list[Array]:
    """Temperature and time, scaled to −1 … 1: a drift with them is not the fault of a position."""
    conditions = []
    for values in (campaign.temperature, campaign.time):
        if values is not None and np.ptp(values) > 0:
            conditions.append(2 * (values - values.min()) / np.ptp(values) - 1)
    return conditions


def _robust(design: Array, lacking: Array, share: float) -> Array:
    """Fit X p ≈ y robustly and return X p, (n, k); positions that are far off lose their weight.

    Each parameter is held near zero, as if it had been observed in each position with the standard
    deviation `share`, where the standard deviation of an observation is the usual distance. So the
    parameters become large only if the usual distance is large.
    """
    n, u = design.shape
    start: Array = np.zeros((u, lacking.shape[1]))
    if share == np.inf:
        start = np.asarray(np.linalg.lstsq(design, lacking, rcond=None)[0])
    parameters, before = start, np.inf
    for _ in range(MAX_ITERATIONS):
        distance = np.linalg.norm(lacking - design @ parameters, axis=1)
        usual = max(float(np.median(distance)), MIN_DISTANCE)
        if abs(before - usual) < 1e-3 * usual:
            break
        before = usual
        weights = 1 / (1 + (distance / (MIN_RATIO * usual)) ** 2) ** 2
        normal = design.T * weights @ design / n + np.eye(u) * max((usual / share) ** 2, 1e-12)
        parameters = np.linalg.solve(normal, design.T * weights @ lacking / n)
    return np.asarray(design @ parameters)


Hypotheses = Callable[[Campaign, RealSensor], Iterator[Mending]]
"""What would undo a gross error, for a campaign and the sensor that fits most of its positions."""
