"""Recognise gross errors that make all else meaningless, by trying what would mend them.

Even before calibration a real sensor agrees with its robot, or with gravity, within some hundredths
of g. Data in a wrong unit, with swapped axes or exchanged rows do not.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.checks import Remedies, check_norm
from accelstudy.campaign.gross_errors.base import (
    EVERYWHERE,
    SINGLE,
    Mending,
    get_gross_error,
    gross_error_names,
)
from accelstudy.campaign.gross_errors.real_sensor import CLEARLY, SHOWS, RealSensor

if TYPE_CHECKING:
    from accelstudy.approaches import Approach
    from accelstudy.campaign.session import Campaign

Array = NDArray[np.float64]

TOGETHER = 4
"""Largest number of gross errors of one rank that are looked for in a campaign."""
GROSS = 0.1
"""Share of gravity: if no position is farther off, no unit and no axis can be wrong."""
REMEDIES = Remedies(*["correct the columns"] * 3)
"""What to do about forces that no unit makes as large as gravity."""
AS_GOOD = 1.25
"""Two explanations whose distances differ by less than this factor fit equally well; the simpler
one is taken."""


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
        """Names of the errors, each once, and the number of each bumped position."""
        named: dict[tuple[str, int | None], None] = {}
        for name, mending in self.errors:
            named |= dict.fromkeys((name, position) for position in mending.left_out or (None,))
        return tuple(named)

    @property
    def name(self) -> str:
        """Name of the first error."""
        return self.errors[0][0]

    @property
    def reasons(self) -> dict[str, str]:
        """What is wrong, in words, by the names of the errors."""
        reasons_of: dict[str, list[str]] = {}
        for name, mending in self.errors:
            reasons_of.setdefault(name, []).append(mending.reason)
        return {name: "; ".join(reasons) for name, reasons in reasons_of.items()}

    @property
    def reason(self) -> str:
        """All that is wrong, in words."""
        return "; ".join(self.reasons.values())

    @property
    def mended(self) -> Campaign:
        """The campaign with its errors undone."""
        return self.errors[-1][1].campaign

    @property
    def matrix(self) -> Array | None:
        """Matrix (3, 3) that turns forces as they were read into mended ones; None if it is I."""
        steps = [m.matrix for _, m in self.errors if m.matrix is not None]
        return np.linalg.multi_dot([*steps[::-1], np.eye(3)]) if steps else None


def recognise(campaign: Campaign, approach: Approach) -> Recognised | None:
    """Recognise wrong units, swapped axes, exchanged rows and bumped positions, if they are gross.

    Without the angles of a robot, swapped axes and exchanged rows do not show: they leave the norm
    of the force as it is.

    Returns
    -------
    Recognised, or None if nothing looks wrong

    Raises
    ------
    InputError
        If the forces are nowhere near gravity and no unit explains it.
    """
    errors: list[tuple[str, Mending]] = []
    mended = campaign
    # The norm shows a wrong unit even if the axes are wrong, so gravity comes before the attitudes.
    for attitude in (False, True)[: 1 + (approach.uses_angles and campaign.angles is not None)]:
        errors += _errors(EVERYWHERE, mended, attitude)
        mended = errors[-1][1].campaign if errors else campaign
    # A sensor that is mounted askew is no reason to reorder its positions.
    mounted = _is_mounted(mended, attitude)
    for rank in SINGLE:
        errors += _errors(rank, mended, attitude, mounted)
        mended = errors[-1][1].campaign if errors else campaign
    where, forces = f"{campaign.name}: fx, fy, fz", mended.forces
    check_norm(where, forces, forces, "m/s^2", campaign.gravity, REMEDIES)
    return Recognised(tuple(errors)) if errors else None


def _errors(
    rank: int, campaign: Campaign, attitude: bool, mounted: bool = False
) -> list[tuple[str, Mending]]:
    """Gross errors of a rank: the one whose mending helps most first, until none helps clearly."""
    errors: list[tuple[str, Mending]] = []
    kind = [error for error in map(get_gross_error, gross_error_names()) if error.rank == rank]
    sensor = RealSensor.of(campaign, attitude, mounted)
    while len(errors) < TOGETHER:
        if rank == EVERYWHERE and sensor.distance.max() < GROSS * sensor.gravity:
            break
        helps = []
        mirrored = rank == EVERYWHERE and RealSensor.of(campaign, attitude, mounted=True).mirrored
        for error in kind:
            for mending in error.mendings(campaign, sensor):
                after = RealSensor.of(mending.campaign, attitude, mounted)
                if _clear(mending, sensor, after, mirrored):
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


def _clear(mending: Mending, before: RealSensor, after: RealSensor, mirrored: bool) -> bool:
    """Whether a mending clearly improves what was clearly wrong; no sensor is mirrored."""
    if mending.left_out:
        return True
    if mending.changed is None:
        if mirrored and mending.matrix is not None and np.linalg.det(mending.matrix) < 0:
            return after.misfit < before.misfit
        # Single positions may be wrong as well: it is enough that most others fit then.
        gained = before.misfit > CLEARLY * after.misfit
        return bool(gained or before.usual > CLEARLY * after.usual)
    was, now = (np.median(sensor.distance[mending.changed]) for sensor in (before, after))
    return bool(was > max(CLEARLY * now, CLEARLY**2 * after.usual, SHOWS * before.gravity))
