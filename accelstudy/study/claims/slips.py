"""Slips of the paper: statements that its own equations contradict."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from accelstudy.basics.units import GON
from accelstudy.leveling.angles import specific_force
from accelstudy.study.claims.base import SLIP, Claim, Evidence, register
from accelstudy.study.claims.leveling import sd_with_interval, simulated_tilts


@register
def slips(evidence: Evidence) -> Iterable[Claim]:
    """Show each slip with the number that should stand there."""
    pitched, low, high = sd_with_interval(simulated_tilts(evidence, 0, 50)[:, 0])
    yield Claim(
        "roll-accuracy-falls-with",
        "3.1, 5",
        "roll accuracy decreases with growing roll (section 5; with pitch in section 3.1)",
        "mgon",
        np.nan,
        pitched,
        low,
        high,
        SLIP,
        f"σ_φ = σ/(g cos θ): it falls with pitch ({pitched:.1f} mgon at 50 gon), as section 3.1 "
        "says, and not with roll.",
    )
    gravity, robot = (
        evidence.statistics[evidence.scheme, a].redundancy for a in ("gravity", "robot")
    )
    yield Claim(
        "degree-of-freedom",
        "4.2",
        "the degree of freedom does not change with the robot",
        "1",
        float(gravity),
        float(robot),
        np.nan,
        np.nan,
        SLIP,
        f"Gauss–Helmert: r is conditions less unknowns, so {gravity} becomes {robot}.",
    )
    roll = 50 * GON
    force = specific_force(roll, 0.0, evidence.cell.gravity)
    printed = float(np.arctan2(force[1], -force[2]))
    yield Claim(
        "equation-10",
        "4.2",
        "the first condition is atan2(f_y, −f_z) − φ_r = 0",
        "gon",
        0.0,
        (printed - roll) / GON,
        np.nan,
        np.nan,
        SLIP,
        "Equations (6) and (7) need atan2(−f_y, −f_z): as printed, a perfect sensor at a roll of "
        "50 gon leaves a misclosure of −100 gon.",
    )
