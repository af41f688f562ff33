"""The judge of plausibility: gross errors are recognised by trying what would mend them.

Data in a wrong unit, with swapped axes or exchanged rows agree with no real sensor, and clearly
better with one when the error is undone. To recognise one more, name it in `GROSS_ERRORS` and write
a function that yields its corrections.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, permutations, product

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import ROBOT_UNITS, SENSOR_UNITS, STANDARD_GRAVITY, UNITS
from accelstudy.basics.wording import short_list
from accelstudy.campaign.gross_errors.real_sensor import (
    MAX_USABLE_ERROR,
    MIN_POSITION_ERROR,
    MIN_RATIO,
    Correction,
    RealSensor,
)
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import usual_norm
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.plausibility import LARGEST

EXCHANGES = sorted(
    (
        np.eye(3)[:, axes] * signs
        for axes in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ),
    key=lambda matrix: (np.sum(np.diag(matrix) == 0), np.sum(matrix < 0)),
)[1:]
"""All P with f = P f_read, where each channel shows one axis or its negative, but I; those that
exchange the fewest axes, and then turn the fewest, come first."""
GROSS_ERRORS = ("axis_error", "outlier_position", "row_order", "unit_error")
"""Names of the gross errors that are recognised."""
MAX_ERRORS = 4
"""Largest number of gross errors of one stage that are looked for in a campaign."""
AS_GOOD = 1.25
"""Two explanations whose distances differ by less than this factor fit equally well; the simpler
one is taken."""
RIGHT_UNIT = 1 - LARGEST["scale"]
"""Share of gravity that even a bad sensor reads in the right unit."""
MAX_EXCHANGED = 1000
"""Largest number of rows that are reordered; if more do not fit, their order is not the cause."""
MIN_ANGLE_UNIT_RATIO = 2.0
"""How many times better the robot's angles must fit in another unit, by many positions."""
MIN_SHIFTED_SHARE = 0.5
"""Share of the exchanged rows that belong one row further, above which the table has slipped."""
MIN_POSITIONS_PER_OUTLIER = 8
"""At most one of so many positions may be an outlier; if more are off, something else is wrong."""


@dataclass(frozen=True)
class Recognition:
    """Gross errors that were recognised.

    Attributes
    ----------
    errors : tuple of Correction, one after the other
    """

    errors: tuple[Correction, ...]

    @property
    def corrected(self) -> Campaign:
        """The campaign without the errors."""
        return self.errors[-1].corrected

    @property
    def names(self) -> tuple[tuple[str, int | None], ...]:
        """Names of the errors, each once, and the number of each outlier position."""
        named = [
            (error.name, place) for error in self.errors for place in error.left_out or (None,)
        ]
        return tuple(dict.fromkeys(named))

    @property
    def name(self) -> str:
        """Name of the first error."""
        return self.errors[0].name

    @property
    def reason(self) -> str:
        """All that is wrong, in words."""
        return "; ".join(error.reason for error in self.errors)

    @property
    def matrix(self) -> Array | None:
        """Matrix (3, 3) that turns forces as they were read into mended ones; None if it is I."""
        steps = [error.matrix for error in self.errors if error.matrix is not None]
        return np.linalg.multi_dot([*steps[::-1], np.eye(3)]) if steps else None


def check_size(where: str, forces: Array, gravity: float, conversion: Conversion) -> list[str]:
    """Check that forces, most of them at rest, are roughly as large as gravity.

    Even bad sensors are wrong by some tenths only, so a factor of two has another cause.

    Parameters
    ----------
    where : str, begins the message
    forces : (n, 3) array, m/s²
    gravity : float, m/s²
    conversion : of the numbers that the forces were read from

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

    unit, norm = conversion.unit, usual_norm(forces)
    what, share = f"the forces are about {norm:.3g} m/s²", norm / gravity - 1
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
    sizes = UNITS["m/s^2"]
    better = [u for u in SENSOR_UNITS if u != unit and near(number * sizes[u], gravity)]
    remedy = (
        f", nowhere near gravity, {gravity:g} m/s²; give another `unit`, `scale` or `offset`, or "
        "other `columns`"
    )
    if near(norm, STANDARD_GRAVITY):
        remedy = f", which does not fit a gravity of {gravity:g} m/s²; give `gravity`"
    elif better:
        remedy = f": these look like {better[0]}, not {unit}; give `unit` {better[0]}"
    elif unit != "counts" and number > 100:
        remedy = (
            f": these look like counts, not {unit}; give their nominal scale (`scale`), about "
            f"{gravity / number:.3g} m/s² per count"
        )
    raise InputError(f"{where}: {what}{remedy}")


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
    conversion = campaign.header.conversion("forces")
    doubts = check_size(where, campaign.forces, campaign.gravity, conversion)
    if campaign.angles is None:
        return doubts
    for error in _undo_everywhere(campaign, True, angle_unit).undone:
        if error.name == "unit_error":
            raise InputError(f"{where}: {error.reason}, not in {angle_unit}")
        if error.matrix is not None and np.array_equal(error.matrix, -np.eye(3)):
            raise InputError(
                f"{where}: {error.reason}; in forward, right, down specific force at level is "
                "(0, 0, −g)"
            )
    return doubts


def recognise(campaign: Campaign, attitude: bool = True) -> Recognition | None:
    """Recognise wrong units, swapped axes, exchanged rows and outlier positions, if they are gross.

    Without the angles of a robot, exchanged rows and swapped axes do not show, as they leave the
    norm of the force as it is; but those of counts do, before their scales and offsets.

    Parameters
    ----------
    campaign : Campaign
    attitude : bool, whether to compare with the robot's angles, if there are any

    Returns
    -------
    Recognition, or None if nothing looks wrong

    Raises
    ------
    InputError
        If the forces are nowhere near gravity and no unit explains it.
    """
    sensor = _undo_everywhere(campaign, attitude and campaign.angles is not None)
    # A sensor that is mounted askew is no reason to reorder its positions.
    sensor = sensor.free if sensor.is_askew else sensor
    # A row that was not exchanged may still be wrong by itself.
    for alone in (rows, outliers):
        sensor = _undo(sensor, alone)
    where, si = f"{campaign.name}: fx, fy, fz", conversion_of("m/s^2")
    check_size(where, sensor.campaign.forces, campaign.gravity, si)
    return Recognition(sensor.undone) if sensor.undone else None


def _undo_everywhere(campaign: Campaign, attitude: bool, angle_unit: str = "gon") -> RealSensor:
    """Undo a wrong unit and wrong axes, which all positions have."""
    other_units = partial(units, angle_unit=angle_unit)
    # The norm shows a wrong unit even if the axes are wrong, so gravity comes before the attitudes.
    sensor = _undo(RealSensor(campaign, False), other_units)
    if attitude:
        return _undo(replace(sensor, attitude=True), axes, other_units)
    return _undo(sensor, columns_of_counts)


def _undo(
    sensor: RealSensor, *hypotheses: Callable[[RealSensor], Iterator[Correction]]
) -> RealSensor:
    """Undo what helps most first, until nothing helps clearly."""
    for _ in range(MAX_ERRORS):
        tried = (sensor.after(one) for one in chain.from_iterable(h(sensor) for h in hypotheses))
        helps = [after for after in tried if _is_clear(sensor, after)]
        if not helps:
            break
        least = min(after.misfit for after in helps)
        sensor = next(after for after in helps if after.misfit <= AS_GOOD * least)
    return sensor


def _is_clear(before: RealSensor, after: RealSensor) -> bool:
    """Whether the last correction clearly improves what was clearly wrong."""
    correction = after.undone[-1]
    if correction.left_out or (not before.attitude and correction.name == "axis_error"):
        return True  # the hypothesis itself has compared
    if correction.changed is None:
        # Few units of angles can be meant, and a base that is not level stays in the misfit.
        of_angles = correction.name == "unit_error" and correction.matrix is None
        least = MIN_ANGLE_UNIT_RATIO if of_angles and before.has_many else MIN_RATIO
        # Single positions may be wrong as well: it is enough that most others fit then.
        gained = before.misfit > least * after.misfit
        return bool(gained or before.usual_distance > MIN_RATIO * after.usual_distance)
    was, now = (np.median(sensor.distance[correction.changed]) for sensor in (before, after))
    usual, least = MIN_RATIO**2 * after.usual_distance, MIN_POSITION_ERROR * before.gravity
    return bool(was > max(MIN_RATIO * now, usual, least))


# --- What would mend a campaign, the simplest first -----------------------------------------------


def axes(sensor: RealSensor) -> Iterator[Correction]:
    """Undo each of the 47 exchanges of axes."""
    campaign = sensor.campaign
    if campaign.angles is None or not sensor.is_far_off:
        return
    for matrix in EXCHANGES:
        yield from filter(None, (_axes(campaign, matrix), _columns(campaign, matrix)))
    # Where z points up, one of both has the other sign than in frd.
    log = campaign.header.log
    sign = 1.0 if log is None else np.prod(log.axes.signs[:2])
    reason, exchanged = "roll and pitch of the robot are exchanged", sign * campaign.angles[:, ::-1]
    yield Correction("axis_error", reason, campaign.with_arrays(angles=exchanged))


def columns_of_counts(sensor: RealSensor) -> Iterator[Correction]:
    """Undo the exchange of columns of counts that gravity alone shows.

    As they were read, no sensor has such biases and scales, though all positions may agree.
    """
    if not sensor.tells or sensor.strangeness <= 1:
        return
    exchanges = (_columns(sensor.campaign, matrix) for matrix in EXCHANGES if np.all(matrix >= 0))
    sensors = [sensor.after(one) for one in exchanges if one is not None]
    best = min(sensors, key=lambda one: one.strangeness, default=sensor)
    if best.strangeness <= 1:
        yield best.undone[-1]


def _axes(campaign: Campaign, matrix: Array) -> Correction:
    """Undo an exchange of axes."""
    return Correction("axis_error", _axes_in_words(matrix), _turned(campaign, matrix), matrix)


def _columns(campaign: Campaign, matrix: Array) -> Correction | None:
    """Undo an exchange of columns of counts, if it differs from one of axes."""
    if campaign.header.nominal is None:
        return None
    # Counts P r, read with S and o, were r: S (r − o) = S P S⁻¹ · S (P⁻¹ r − P⁻¹ o).
    nominal, log = campaign.header.conversion("forces"), campaign.header.log
    scaled = matrix * nominal.scale[:, None] / nominal.scale
    offset = np.abs(matrix).T @ nominal.offset
    if np.allclose(scaled, matrix) and np.array_equal(offset, nominal.offset):
        return None
    if log is not None:
        log = log.model_copy(update={"offset": offset[np.argsort(log.axes.order)].tolist()})
    counts = {"scale": nominal.scale.tolist(), "offset": offset.tolist()}
    read = campaign.with_header(nominal=counts, log=log)
    corrected = _turned(read, scaled, (nominal.offset - offset) * nominal.scale)
    reason = f"{_axes_in_words(matrix)}, in the counts, before `scale` and `offset`"
    return Correction("axis_error", reason, corrected, scaled)


def _turned(campaign: Campaign, matrix: Array, shift: Array | float = 0.0) -> Campaign:
    """Campaign after f → P (f + s), where P takes each axis from one other; sds have no sign.

    Columns are reordered, not summed, so no digit changes.
    """
    axes = np.argmax(np.abs(matrix), axis=1)
    factors = matrix[range(3), axes]
    sd = None if campaign.sd is None else abs(factors) * campaign.sd[:, axes]
    return campaign.with_arrays(forces=factors * (campaign.forces + shift)[:, axes], sd=sd)


def _axes_in_words(matrix: Array) -> str:
    """Say which axes are wrong, from the matrix that mends them."""
    order, signs = np.argmax(np.abs(matrix), axis=1), matrix.sum(axis=1)
    words = ", ".join(
        f"{axis} is read as {'−' if sign < 0 else ''}{'xyz'[other]}"
        for axis, other, sign in zip("xyz", order, signs, strict=True)
        if sign < 0 or axis != "xyz"[other]
    )
    if not (order == range(3)).all():
        return f"axes are swapped: {words}"
    # The force of another attitude, in which the robot's angle has the other sign.
    angle = {(-1, 1, 1): "pitch", (1, -1, 1): "roll"}.get(tuple(signs.astype(int)))
    other = f", or the robot's {angle} has the other sign" if angle else ""
    return f"axes have the wrong sign: {words}{other}"


def units(sensor: RealSensor, angle_unit: str = "gon") -> Iterator[Correction]:
    """Convert the forces, or the angles, as if they were in another unit."""
    if sensor.is_far_off:
        yield from _force_units(sensor.campaign)
    # Degrees for gon are only a tenth off, which many positions show all the same.
    seen = sensor.has_many and sensor.distance.max() >= MIN_POSITION_ERROR * sensor.gravity
    if sensor.expected is not None and (sensor.is_far_off or seen):
        yield from _angle_units(sensor.campaign, angle_unit)


def _force_units(campaign: Campaign) -> Iterator[Correction]:
    """Convert the forces to a unit in which they are about as large as gravity."""
    norm = usual_norm(campaign.forces) / campaign.gravity
    own = campaign.header.unit if campaign.header.unit in SENSOR_UNITS else "m/s^2"
    for stated in (own, "g" if own == "m/s^2" else "m/s^2"):
        for unit, factor in _factors(SENSOR_UNITS, "m/s^2", stated).items():
            if RIGHT_UNIT < factor * norm < 1 / RIGHT_UNIT:
                instead = "" if stated == "m/s^2" else f", not in {stated}"
                matrix = factor * np.eye(3)
                reason = f"the forces are in {unit}{instead}"
                yield Correction("unit_error", reason, _turned(campaign, matrix), matrix)


def _angle_units(campaign: Campaign, angle_unit: str) -> Iterator[Correction]:
    """Convert the robot's angles to each other unit."""
    angles = {"angles": campaign.angles, "yaw": campaign.yaw}
    for unit, factor in _factors(ROBOT_UNITS, "rad", angle_unit).items():
        scaled = {k: None if a is None else factor * a for k, a in angles.items()}
        reason = f"the robot's angles are in {ROBOT_UNITS[unit]}"
        yield Correction("unit_error", reason, campaign.with_arrays(**scaled))


def _factors(units: Collection[str], si: str, stated: str) -> dict[str, float]:
    """Factors that mend numbers in the unit that was stated, by the other units of a quantity."""
    sizes = UNITS[si]
    return {unit: sizes[unit] / sizes[stated] for unit in units if unit != stated}


def rows(sensor: RealSensor) -> Iterator[Correction]:
    """Move each row that does not fit to the position where it fits; any number of rows."""
    campaign = sensor.campaign
    if sensor.expected is None or not sensor.tells:
        return
    lost = sensor.usual_distance > MAX_USABLE_ERROR * sensor.gravity
    wrong = np.flatnonzero(sensor.wrong | lost)
    if not 1 < len(wrong) <= MAX_EXCHANGED:
        return
    from scipy import optimize  # slow to import, and seldom needed

    # Rows in the same attitude could be exchanged at will, so an exchange must gain something.
    least = min(MIN_RATIO * sensor.usual_distance, MIN_POSITION_ERROR * sensor.gravity)
    cost = campaign.forces[wrong][:, None] - sensor.expected[wrong][None]
    order = np.arange(campaign.n_positions)
    # What fits nowhere, as where a row was lost, does not keep the others from their places.
    most = MAX_USABLE_ERROR * sensor.gravity
    gain = np.minimum(np.sum(cost**2, axis=2), most**2) + least**2 * (1 - np.eye(len(wrong)))
    order[wrong] = wrong[optimize.linear_sum_assignment(gain.T)[1]]
    moved = order != np.arange(len(order))
    if moved.any():
        positions = short_list([*map(str, campaign.positions[moved])])
        reason = f"the forces of positions {positions} are exchanged"
        for way, step in {"above": -1, "below": 1}.items():
            if np.mean(order[moved] - np.flatnonzero(moved) == step) > MIN_SHIFTED_SHARE:
                reason = f"the forces of positions {positions} stand in the row {way} theirs"
        read = {"forces": campaign.forces, "sd": campaign.sd, "n_samples": campaign.n_samples}
        ordered = {name: None if a is None else a[order] for name, a in read.items()}
        yield Correction("row_order", reason, campaign.with_arrays(**ordered), changed=moved)


def outliers(sensor: RealSensor) -> Iterator[Correction]:
    """Leave out positions that are so wrong that they would spoil a calibration."""
    campaign = sensor.campaign
    far = sensor.wrong & (sensor.distance > MAX_USABLE_ERROR * sensor.gravity)
    labels = tuple(campaign.positions[far].tolist())
    if not sensor.tells or not 0 < len(labels) <= campaign.n_positions // MIN_POSITIONS_PER_OUTLIER:
        return
    # Far from a usual sensor, and yet all may fit one whose bias or scale no sensor has.
    if sensor.free.distance.max() < MIN_POSITION_ERROR * sensor.gravity:
        return
    positions, size = short_list([*map(str, labels)]), sensor.distance[far].max()
    reason = f"positions {positions} are wrong by up to {size:.2g} m/s^2"
    if len(labels) == 1:
        reason = f"position {positions} is wrong by {size:.2g} m/s^2"
    without = campaign.without(dict.fromkeys(labels, reason))
    yield Correction("outlier_position", reason, without, left_out=labels)
