"""Gross errors that make all else meaningless are recognised by trying what would mend them.

A real sensor fits its robot, or gravity, within some hundredths of g before any calibration; a
wrong unit, a swapped axis or exchanged rows do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.gross_errors.base import (
    EVERYWHERE,
    SINGLE,
    Mending,
    get_gross_error,
    gross_error_names,
)
from accelstudy.campaign.gross_errors.real_sensor import CLEARLY, RealSensor

if TYPE_CHECKING:
    from accelstudy.approaches import Approach
    from accelstudy.campaign.files.session import Campaign

Array = NDArray[np.float64]

TOGETHER = 4
"""Gross errors of a rank that one campaign may have."""
GROSS = 0.1
"""Share of gravity that some position is off by, or no unit and no axis is wrong."""
SHOWS = 0.005
"""Share of gravity by which single positions have to be wrong."""
AS_GOOD = 1.25
"""Ratio of distances up to which two explanations fit equally well; the simpler one is taken."""


@dataclass(frozen=True)
class Recognised:
    """Gross errors that were recognised.

    Attributes
    ----------
    errors : tuple of (name, Mending), one after the other
    """

    errors: tuple[tuple[str, Mending], ...]

    @property
    def named(self) -> tuple[tuple[str, int | None], ...]:
        """What they are called, each once, and each bumped position with its number."""
        found: dict[tuple[str, int | None], None] = {}
        for name, mending in self.errors:
            found |= dict.fromkeys((name, position) for position in mending.left_out or (None,))
        return tuple(found)

    @property
    def name(self) -> str:
        """What the first is called."""
        return self.errors[0][0]

    @property
    def reasons(self) -> dict[str, str]:
        """What is wrong, in words, by what it is called."""
        found: dict[str, list[str]] = {}
        for name, mending in self.errors:
            found.setdefault(name, []).append(mending.reason)
        return {name: "; ".join(reasons) for name, reasons in found.items()}

    @property
    def reason(self) -> str:
        """All that is wrong, in words."""
        return "; ".join(self.reasons.values())

    @property
    def mended(self) -> Campaign:
        """The campaign as it would have been right."""
        return self.errors[-1][1].campaign

    @property
    def matrix(self) -> Array | None:
        """Matrix (3, 3) that turns forces as they were read into mended ones; None if it is I."""
        steps = [m.matrix for _, m in self.errors if m.matrix is not None]
        return np.linalg.multi_dot([*steps[::-1], np.eye(3)]) if steps else None


def recognise(campaign: Campaign, approach: Approach) -> Recognised | None:
    """Recognise wrong units, swapped axes, exchanged rows and bumped positions, if they are gross.

    Without the angles of a robot axes and rows cannot be wrong: the norm of gravity is the same.

    Returns
    -------
    Recognised; None if all looks right

    Raises
    ------
    InputError
        If the forces are nowhere near gravity and no unit explains it.
    """
    errors: list[tuple[str, Mending]] = []
    mended = campaign
    # The norm tells the unit of the forces, however wrong their axes are.
    for attitude in (False, True)[: 1 + (approach.uses_angles and campaign.angles is not None)]:
        errors += _errors(EVERYWHERE, mended, attitude)
        mended = errors[-1][1].campaign if errors else campaign
    # A sensor that is mounted in its own way is no reason to reorder its positions.
    mounted = _is_mounted(mended, attitude)
    for rank in SINGLE:
        errors += _errors(rank, mended, attitude, mounted)
        mended = errors[-1][1].campaign if errors else campaign
    _check_norm(mended)
    return Recognised(tuple(errors)) if errors else None


def _errors(
    rank: int, campaign: Campaign, attitude: bool, mounted: bool = False
) -> list[tuple[str, Mending]]:
    """Gross errors of a rank: the one whose mending helps most, until nothing helps clearly."""
    errors: list[tuple[str, Mending]] = []
    kind = [error for error in map(get_gross_error, gross_error_names()) if error.rank == rank]
    sensor = RealSensor.of(campaign, attitude, mounted)
    while len(errors) < TOGETHER:
        helps = []
        for error in kind:
            if rank == EVERYWHERE and sensor.distance.max() < GROSS * sensor.gravity:
                continue
            for mending in error.mendings(campaign, sensor):
                after = RealSensor.of(mending.campaign, attitude, mounted)
                if _clear(mending, sensor, after):
                    helps.append((error.name, mending, after))
        if not helps:
            break
        least = min(after.misfit for _, _, after in helps)
        name, best, sensor = next(one for one in helps if one[2].misfit <= AS_GOOD * least)
        errors.append((name, best))
        campaign = best.campaign
    return errors


def _is_mounted(campaign: Campaign, attitude: bool) -> bool:
    """Whether most positions fit clearly better if the sensor may be mounted in any way."""
    sensor = RealSensor.of(campaign, attitude)
    if sensor.expected is None or sensor.usual < SHOWS * sensor.gravity:
        return False
    return CLEARLY * RealSensor.of(campaign, attitude, mounted=True).usual < sensor.usual


def _clear(mending: Mending, before: RealSensor, after: RealSensor) -> bool:
    """Whether a mending makes clearly better what was clearly wrong."""
    if mending.left_out:
        return True
    if mending.changed is None:
        return before.misfit > CLEARLY * after.misfit
    was, now = (np.median(sensor.distance[mending.changed]) for sensor in (before, after))
    return bool(was > max(CLEARLY * now, CLEARLY**2 * after.usual, SHOWS * before.gravity))


def _check_norm(campaign: Campaign) -> None:
    """Raise `InputError` if forces are not as large as gravity but for what a bad sensor does."""
    norm = float(np.median(np.linalg.norm(campaign.forces, axis=1)))
    if not 0.5 < norm / campaign.gravity < 2:
        raise InputError(
            f"{campaign.name}: fx, fy, fz: their norm is about {norm:.3g} m/s^2, nowhere near "
            f"gravity, {campaign.gravity:g} m/s^2, in no unit; correct the columns"
        )
