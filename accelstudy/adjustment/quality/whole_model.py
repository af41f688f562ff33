"""The test of a whole model against the noise of its observations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.basics.levels import REFUTED

Array = NDArray[np.float64]

NO_POWER = 2
"""With this redundancy or less the global test finds next to nothing."""


@dataclass(frozen=True)
class GlobalTest:
    """Test of the whole model, Ω/σ0² ~ χ²_r, two-sided (Koch 1999, chapter 4).

    Attributes
    ----------
    statistic : float
    dof : int, r
    p_value : float
    accepted : bool, at the level asked for
    """

    statistic: float
    dof: int
    p_value: float
    accepted: bool

    @property
    def powerless(self) -> bool:
        """Whether the redundancy is so small that the test hardly ever rejects."""
        return self.dof <= NO_POWER


def global_test(
    omega: float, redundancy: int, alpha: float = REFUTED, variance: float = 1.0
) -> GlobalTest | None:
    """Test Ω against its distribution; None without redundancy, where there is nothing to test.

    Parameters
    ----------
    omega, redundancy : of the adjustment
    alpha : float, level
    variance : float, σ0² a priori
    """
    if redundancy <= 0:
        return None
    statistic = omega / variance
    below, above = special.chdtr(redundancy, statistic), special.chdtrc(redundancy, statistic)
    return GlobalTest(
        statistic=float(statistic),
        dof=redundancy,
        p_value=float(2 * min(below, above)),
        accepted=bool(2 * min(below, above) >= alpha),
    )
