"""Checks of a campaign: an error names the wrong value and says what would be right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import ROBOT_UNITS, SENSOR_UNITS, STANDARD_GRAVITY, UNITS
from accelstudy.campaign.header import ANY, COLUMNS, COUNTING, HEADER, MOST, RANGES, Header
from accelstudy.leveling.angles import specific_force, usual_norm

Array = NDArray[np.float64]

FARTHEST = 1000
"""Times gravity; a mean beyond it is no measurement."""


def check_names(names: Sequence[str], path: Path) -> None:
    """Check that no column occurs twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            raise InputError(f"{path}: {name!r}: the column stands twice")
        seen.add(name)


def check_column(
    attribute: str, name: str, values: Array, labels: Sequence[str], path: Path
) -> None:
    """Check what must hold for a column in any unit."""

    def complain_of(wrong: NDArray[np.bool_], text: str) -> None:
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InputError(f"{path}: {name}: {labels[i]}: {values[i]:.15g} {text}")

    if attribute in COUNTING:
        complain_of(values % 1 != 0, "is no whole number")
    range_ = ANY if attribute == "forces" else RANGES.get(attribute, ANY)
    for i in np.flatnonzero((values < range_.least) | (values > range_.most))[:1]:
        try:
            range_.check(values[i])
        except InputError as error:
            raise InputError(f"{path}: {name}: {labels[i]}: {error}") from None
    behind = np.diff(values, prepend=-np.inf)
    if attribute == "positions":
        text = "follows no smaller number; number the holds 1, 2, 3 … in order of acquisition"
        complain_of(behind <= 0, text)
    if attribute == "time":
        complain_of(behind < 0, "is before the hold above; rows must be in order of acquisition")
    if attribute == "forces" and len(values) > 1 and np.ptp(values) == 0:
        raise InputError(
            f"{path}: {name}: {values[0]:.15g} in all positions; a channel that works changes"
        )


def check_robot(given: Mapping[str, Array], header: Header, path: Path) -> None:
    """Check that angles and their sigma come together."""
    roll, pitch = COLUMNS["angles"]
    key = f"{path.with_name(HEADER)}: robot.angle_sigma_mgon"
    if "yaw" in given and "angles" not in given:
        raise InputError(f"{path}: yaw_robot_gon: goes with {roll} and {pitch}, which are missing")
    if header.reference is not None:
        key = f"{path.with_name(HEADER)}: reference"
    elif "angles" in given and header.robot is None:
        raise InputError(f"{key}: missing, but {path.name} has {roll} and {pitch}")
    if (header.robot or header.reference) is not None and "angles" not in given:
        raise InputError(f"{key}: is given, but {path.name} has no {roll} and {pitch}")


def check_size(raw: Array, forces: Array, header: Header, path: Path) -> None:
    """Check that forces are numbers that can be calculated with, in whatever unit they are."""
    norm, given = usual_norm(forces), usual_norm(raw)
    if not (norm > 1 / MOST and np.max(abs(forces)) < MOST):
        raise InputError(
            f"{path}: fx, fy, fz: their norm is about {given:.3g} {header.unit}, which no unit "
            f"makes gravity, {header.gravity.value_mps2:g} m/s^2; correct the columns"
        )


class Fault(NamedTuple):
    """What is wrong with forces, if they are not as large as gravity.

    Attributes
    ----------
    cause : str, "gravity" if its value is wrong, the unit that would be right, or "unknown"; None
        if nothing is wrong
    given : float, usual norm in the unit of the file
    norm : float, m/s², usual norm
    """

    cause: str | None
    given: float
    norm: float


def likely_fault(raw: Array, forces: Array, unit: str, gravity: float) -> Fault:
    """Say why forces are not those of a sensor at rest.

    Even bad sensors are wrong by some tenths only, so a factor of two has another cause.

    Parameters
    ----------
    raw : (n, 3) array, in the unit of the file
    forces : (n, 3) array, m/s²
    unit : str, of the file
    gravity : float, m/s²
    """
    norm, given = usual_norm(forces), usual_norm(raw)

    def near(size: float, gravity: float) -> bool:
        return gravity / 2 < size < gravity * 2

    if near(norm, gravity):
        return Fault(None, given, norm)
    if near(norm, STANDARD_GRAVITY):
        return Fault("gravity", given, norm)
    sizes = UNITS["m/s^2"]
    better = [u for u in SENSOR_UNITS if u != unit and near(given * sizes[u], gravity)]
    if not better and unit != "counts" and given > 100:
        better = ["counts"]
    return Fault(better[0] if better else "unknown", given, norm)


def check_norm(raw: Array, forces: Array, header: Header, path: Path) -> None:
    """Check that forces are roughly as large as gravity; the error names the unit that fits."""
    gravity, unit = header.gravity.value_mps2, header.unit
    cause, given, norm = likely_fault(raw, forces, unit, gravity)
    if cause is None:
        return
    what = f"fx, fy, fz: their norm is about {given:.3g} {unit}"
    if unit == "counts":
        what = f"{what}, by `nominal` {norm:.3g} m/s^2"
    if cause == "gravity":
        raise InputError(
            f"{path.with_name(HEADER)}: gravity.value_mps2: {gravity:g} does not fit the forces, "
            f"whose norm is about {norm:.3g} m/s^2; expected some 9.8"
        )
    if cause != "unknown":
        advice = f"looks like {cause}, not {unit}; correct `unit` in {HEADER}"
    else:
        advice = f"nowhere near gravity, {gravity:g} m/s^2; correct the unit" + (
            " or `nominal`" if unit == "counts" else " or the columns"
        )
    raise InputError(f"{path}: {what}: {advice}")


def check_outliers(forces: Array, labels: Sequence[str], gravity: float, path: Path) -> None:
    """Check that no mean is so far from gravity that neither sensor nor bump explains it."""
    for i in np.flatnonzero(np.linalg.norm(forces, axis=1) > FARTHEST * gravity)[:1]:
        raise InputError(
            f"{path}: fx, fy, fz: {labels[i]}: more than {FARTHEST} times gravity; correct the "
            "mean, or leave out the hold"
        )


def misfit_of_angles(angles: Array, forces: Array, gravity: float) -> float:
    """Rms difference of forces (n, 3), m/s², from those at angles (n, 2), rad, over gravity."""
    roll, pitch = angles.T
    expected = np.column_stack(specific_force(roll, pitch, gravity))
    return float(np.sqrt(np.mean(np.sum((forces - expected) ** 2, axis=1))) / gravity)


def clearly_worse(misfit: float, other: float) -> bool:
    """Whether another reading of the angles fits so much better that this is no accident.

    A real sensor agrees with its robot within some hundredths of g.
    """
    return misfit > max(0.05, 4 * other)


def check_angles(angles: Array, forces: Array, gravity: float, path: Path) -> None:
    """Check that no other unit or sign fits the forces clearly better than angles in gon."""

    def misfit(unit: str, sign: int = 1) -> float:
        return misfit_of_angles(angles * UNITS["rad"][unit], sign * forces, gravity)

    readings = {
        f"the angles look like {word}, not gon": misfit(unit)
        for unit, word in ROBOT_UNITS.items()
        if unit != "gon"
    }
    opposite = "the forces have the opposite sign; at level specific force is (0, 0, -g)"
    readings[opposite] = misfit("gon", -1)
    best = min(readings, key=lambda text: readings[text])
    if clearly_worse(misfit("gon"), readings[best]):
        raise InputError(f"{path}: {', '.join(COLUMNS['angles'])}: {best}")
