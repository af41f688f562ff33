"""Whether forces and angles can be right: an error says what would be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import ROBOT_UNITS, SENSOR_UNITS, STANDARD_GRAVITY, UNITS
from accelstudy.leveling.angles import specific_force, usual_norm

Array = NDArray[np.float64]


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
