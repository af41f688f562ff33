"""Tests of a calibration: of its whole model, and of single positions for gross errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.observations import Observations
from accelstudy.adjustment.quality.solution import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

NO_POWER = 2
"""Redundancy up to which the global test has next to no power."""
HARDLY_KNOWN = 8
"""Degrees of freedom of σ0; with fewer the global test accepts residuals of 2.5 σ0 and more."""


@dataclass(frozen=True)
class GlobalTest:
    """Test of the whole model, two-sided (Koch 1999, chapter 4).

    Ω/σ0² ~ χ²_r, or Ω/(r σ0²) ~ F(r, ν) where σ0 was itself estimated with ν degrees of freedom.

    Attributes
    ----------
    statistic : float
    dof : int, r
    sigma_dof : float, ν; infinite where σ0 is known
    p_value : float
    accepted : bool, at the level asked for
    """

    statistic: float
    dof: int
    p_value: float
    accepted: bool
    sigma_dof: float = np.inf

    @property
    def powerless(self) -> bool:
        """Whether the test has next to no power."""
        return bool(self.lacking)

    @property
    def lacking(self) -> str:
        """What the test lacks to reject: redundancy, or degrees of freedom of sigma; else empty."""
        if self.dof <= NO_POWER:
            return f"redundancy {self.dof}"
        few = self.sigma_dof < HARDLY_KNOWN
        return f"{self.sigma_dof:.0f} degrees of freedom of sigma" if few else ""


def global_test(
    omega: float,
    redundancy: int,
    alpha: float = REFUTATION_LEVEL,
    variance: float = 1.0,
    sigma_dof: float = np.inf,
) -> GlobalTest | None:
    """Test Ω against its distribution; None without redundancy, where there is nothing to test.

    Parameters
    ----------
    omega, redundancy : of the adjustment
    alpha : float, level
    variance : float, σ0² a priori
    sigma_dof : float, ν of σ0², where it is an estimate
    """
    if redundancy <= 0:
        return None
    statistic = omega / variance
    if np.isfinite(sigma_dof):
        ratio = statistic / redundancy
        tails = (f(redundancy, sigma_dof, ratio) for f in (special.fdtr, special.fdtrc))
    else:
        tails = (f(redundancy, statistic) for f in (special.chdtr, special.chdtrc))
    p_value = float(2 * min(tails))
    return GlobalTest(
        statistic=float(statistic),
        dof=redundancy,
        p_value=p_value,
        accepted=p_value >= alpha,
        sigma_dof=sigma_dof,
    )


def pooled_variance(omega: float, redundancy: int, sigma_dof: float) -> float:
    """Variance of unit weight by the stated noise and the residuals together; 1 where it is known.

    A variance of 1 with ν degrees of freedom and one of Ω/r with r give (ν + Ω)/(ν + r) with ν + r.
    """
    return (sigma_dof + omega) / (sigma_dof + redundancy) if np.isfinite(sigma_dof) else 1.0


@dataclass(frozen=True)
class PositionTests:
    """Tests for a gross error, one for each of n positions.

    Attributes
    ----------
    gross_errors : (n, c) array, m/s², estimated error of |f_b| or of the vector f_b
    dof : (n,) int array, q, the directions in which the position is controlled; 0 is not testable
    statistic : (n,) array, ~ χ²_q if σ0 is known (Baarda 1968), q F(q, ν) if it was estimated
        beforehand with ν degrees of freedom
    studentised : (n,) array, ~ F(q, r − q) if σ0 is not; σ0 estimated without the position
    tau : (n,) array, √(statistic / (q σ̂0²)), after Pope (1976); its p-values are those of F
    p_known, p_unknown : (n,) arrays, two-sided p-values with σ0 known or not; NaN: not testable
    """

    gross_errors: Array
    dof: NDArray[np.int_]
    statistic: Array
    studentised: Array
    tau: Array
    p_known: Array
    p_unknown: Array

    @property
    def w(self) -> Array:
        """Baarda's w ~ N(0, 1), (n,), where a position has one condition; else √statistic."""
        root = np.sqrt(self.statistic)
        return np.sign(self.gross_errors[:, 0]) * root if self.gross_errors.shape[1] == 1 else root

    def p_adjusted(self, sigma_known: bool = True) -> Array:
        """P-values with the family-wise error of all n tests controlled (Holm 1979), (n,)."""
        return holm(self.p_known if sigma_known else self.p_unknown)

    def worst(self, sigma_known: bool = True) -> int | None:
        """Position with the smallest p-value; None if no position can be tested."""
        p = self.p_known if sigma_known else self.p_unknown
        return None if np.isnan(p).all() else int(np.nanargmin(p))


def holm(p_values: Array) -> Array:
    """Adjust p-values by Holm's step-down method; NaN stays NaN and does not count."""
    adjusted = np.full(np.shape(p_values), np.nan)
    order = np.argsort(p_values)[: np.count_nonzero(~np.isnan(p_values))]
    steps = np.arange(len(order), 0, -1) * p_values[order]
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted


def position_tests(solution: Solution) -> PositionTests:
    """Test each position for a gross error, the others being free of one.

    With σ0 unknown, statistic/Ω has a Beta(q/2, (r − q)/2) distribution, of which the studentised
    F and Pope's τ are two monotone functions; they are NaN where r − q = 0.
    """
    n, c = solution.misclosures.shape
    root, q = solution.root
    e = solution.errors[: n * c].reshape(n, c)
    normalised = np.einsum("ncd,nc->nd", root, e)
    statistic = np.sum(normalised**2, axis=1)
    r, omega = solution.redundancy, solution.omega
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = np.where(r > q, np.maximum(omega - statistic, 0.0) / (r - q), np.nan)
        studentised = statistic / q / rest
        tau = np.sqrt(statistic / q / (omega / r if r > 0 else np.nan))
        nu = solution.sigma_dof
        p_known = special.chdtrc(q, statistic)
        if np.isfinite(nu):
            p_known = special.fdtrc(q, nu, statistic / q)
        p_known = np.where(q > 0, p_known, np.nan)
        p_unknown = special.fdtrc(q, r - q, studentised)
    return PositionTests(
        gross_errors=np.einsum("nbc,ncd,nd->nb", solution.whitening, root, normalised),
        dof=q,
        statistic=statistic,
        studentised=studentised,
        tau=tau,
        p_known=p_known,
        p_unknown=p_unknown,
    )


@dataclass(frozen=True)
class Suspect:
    """A position that is in conflict with the others.

    Attributes
    ----------
    position : int, index in the session
    p_value : float, adjusted for the number of tests
    gross_error : (c,) array, m/s², estimated
    """

    position: int
    p_value: float
    gross_error: Array


def suspects(
    model: SensorModel,
    approach: Approach,
    observed: Observations,
    alpha: float = 0.05,
    sigma_known: bool = True,
    most: int = 5,
) -> tuple[Suspect, ...]:
    """Find positions with gross errors: remove the worst, adjust again, until none is rejected.

    Parameters
    ----------
    model, approach, observed : as in `calibrate`, one session
    alpha : float, family-wise level of each round
    sigma_known : bool, whether the variances of the observations are to be trusted
    most : int, positions to remove at most

    Returns
    -------
    tuple of Suspect, in the order of their removal
    """
    kept = np.arange(observed.forces.shape[1])
    removed: list[Suspect] = []
    while len(removed) < most:
        tests = position_tests(solve(model, approach, observed.take(kept)))
        worst = tests.worst(sigma_known)
        if worst is None:
            break
        p_value = float(tests.p_adjusted(sigma_known)[worst])
        if p_value >= alpha:
            break
        removed.append(Suspect(int(kept[worst]), p_value, tests.gross_errors[worst]))
        kept = np.delete(kept, worst)
    return tuple(removed)
