"""Checks of a campaign: an error names the wrong value and says what would be right."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import ROBOT_UNITS, SENSOR_UNITS, STANDARD_GRAVITY, UNITS
from accelstudy.campaign.header import COLUMNS, HEADER, MOST, Header
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

    column = COLUMNS[attribute]
    if column.whole:
        complain_of(values % 1 != 0, "is no whole number")
    within = column.within
    for i in np.flatnonzero((values < within.least) | (values > within.most))[:1]:
        within.check_key(f"{path}: {name}: {labels[i]}", values[i])
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
    roll, pitch = COLUMNS["angles"].names
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


class Remedies(NamedTuple):
    """What a person does about forces that are not as large as gravity.

    Attributes
    ----------
    unit : str, if they are in another unit, which stands for {unit}
    gravity : str, if the value of gravity is wrong
    other : str, if nothing is known to be the cause
    """

    unit: str
    gravity: str
    other: str


def check_norm(
    where: str, raw: Array, forces: Array, unit: str, gravity: float, remedies: Remedies
) -> None:
    """Check that forces, most of them at rest, are roughly as large as gravity.

    Even bad sensors are wrong by some tenths only, so a factor of two has another cause.

    Parameters
    ----------
    where : str, begins the message
    raw : (n, 3) array, in the unit of the file
    forces : (n, 3) array, m/s²
    unit : str, of the file
    gravity : float, m/s²
    remedies : Remedies

    Raises
    ------
    InputError
        If they are not; it says what would be right.
    """
    norm, given = usual_norm(forces), usual_norm(raw)

    def near(size: float, gravity: float) -> bool:
        return gravity / 2 < size < gravity * 2

    if near(norm, gravity):
        return
    what = f"{where}: the forces are about {given:.3g} {unit}"
    if unit == "counts":
        what += f", by scale and offset {norm:.3g} m/s²"
    if near(norm, STANDARD_GRAVITY):
        fits = f"which does not fit a gravity of {gravity:g} m/s²"
        raise InputError(f"{what}, {fits}; {remedies.gravity}")
    sizes = UNITS["m/s^2"]
    better = [u for u in SENSOR_UNITS if u != unit and near(given * sizes[u], gravity)]
    if not better and unit != "counts" and given > 100:
        better = ["counts"]
    if better:
        needs = ", and need a scale" if better == ["counts"] else ""
        advice = remedies.unit.format(unit=better[0])
        raise InputError(f"{what}: these look like {better[0]}, not {unit}{needs}; {advice}")
    raise InputError(f"{what}, nowhere near gravity, {gravity:g} m/s²; {remedies.other}")


def check_outliers(forces: Array, labels: Sequence[str], gravity: float, path: Path) -> None:
    """Check that no mean is so far from gravity that neither sensor nor bump explains it."""
    for i in np.flatnonzero(np.linalg.norm(forces, axis=1) > FARTHEST * gravity)[:1]:
        raise InputError(
            f"{path}: fx, fy, fz: {labels[i]}: more than {FARTHEST} times gravity; correct the "
            "mean, or leave out the hold"
        )


OPPOSITE = "opposite"
"""What `better_angles` says of forces with the wrong sign."""


def better_angles(angles: Array, unit: str, forces: Array, gravity: float) -> str | None:
    """Unit of angles (n, 2), or `OPPOSITE`, that fits forces (n, 3), m/s², clearly better.

    A real sensor agrees with its robot within some hundredths of g.
    """

    def misfit(unit: str, sign: int = 1) -> float:
        roll, pitch = angles.T * UNITS["rad"][unit]
        error = sign * forces - np.column_stack(specific_force(roll, pitch, gravity))
        return float(np.sqrt(np.mean(np.sum(error**2, axis=1))) / gravity)

    others = {other: misfit(other) for other in ROBOT_UNITS if other != unit}
    others[OPPOSITE] = misfit(unit, -1)
    best = min(others, key=lambda other: others[other])
    return best if misfit(unit) > max(0.05, 4 * others[best]) else None
