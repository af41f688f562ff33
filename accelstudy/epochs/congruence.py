"""The congruence test of two epochs, and the search for what changed, as in deformation analysis.

The differences d of the parameters have the covariance matrix S = C₁ + C₂. With stated noise
dᵀ S⁻¹ d is χ² distributed if nothing changed (Pelzer 1971). Where sigmas were estimated, each C is
an estimate by r degrees of freedom, and dᵀ S⁻¹ d / p is compared with F(p, ν).

How the two variances compare is not known: the problem of Behrens & Fisher. An estimate that is
small by chance makes dᵀ S⁻¹ d large, and its own share in S small; degrees of freedom by estimated
shares (Welch & Satterthwaite) then promise certainty where there is none. So ν is that of the F
variable with the same quantile as dᵀ S⁻¹ d has if the true C are r/χ²(r) times the estimated ones
(the generalized p-value of Gamage, Mathew & Weerahandi 2004, J. Multivar. Anal. 88, 177). The level
is kept, or not reached, whatever the variances are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize, special, stats
from scipy.stats import qmc

from accelstudy.adjustment.quality import noncentrality
from accelstudy.positions.choice import first_best

Array = NDArray[np.float64]

LEVEL = 0.05
"""Level of the test, and of the search for what changed as a whole."""
POINTS = 10
"""Binary logarithm of the number of variances that are tried for each estimated one."""
MIN_PROBABILITY = 1e-300
"""Least probability of which the logarithm is taken."""
FREEDOM_TOLERANCE = 1e-7
"""Relative error of ν and of the quantile that it follows from."""
STATISTIC_TOLERANCE = 1e-9
"""Relative difference below which two statistics are equal, and the first one is taken."""


class Test(NamedTuple):
    """Whether differences are no larger than their covariance matrix says.

    Attributes
    ----------
    statistic : float, dᵀ S⁻¹ d / p
    dof : (p, ν), of F; ν is infinite with stated noise
    p_value : float
    """

    statistic: float
    dof: tuple[int, float]
    p_value: float

    @property
    def congruent(self) -> bool:
        """Whether the differences are compatible with no change."""
        return self.p_value >= LEVEL


@dataclass(frozen=True)
class Differences:
    """Differences of p parameters between two epochs.

    Attributes
    ----------
    differences : (p,) array
    covariances : two (p, p) arrays, of the epochs
    dof : two numbers of degrees of freedom by which these were estimated; inf with stated noise
    """

    differences: Array
    covariances: tuple[Array, Array]
    dof: tuple[float, float]

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the differences."""
        return self.covariances[0] + self.covariances[1]

    @property
    def sigmas(self) -> Array:
        """Sigmas of the differences, (p,)."""
        return np.sqrt(np.diag(self.covariance))

    def of(self, chosen: Sequence[int]) -> Differences:
        """Differences of some of the parameters, whatever the others do."""
        first, second = (c[np.ix_(chosen, chosen)] for c in self.covariances)
        return Differences(self.differences[chosen], (first, second), self.dof)

    @cached_property
    def test(self) -> Test:
        """Test of congruence."""
        p = len(self.differences)
        if not p:
            return Test(0.0, (0, np.inf), 1.0)
        squares, shares = self._split
        statistic = float(np.sum(squares)) / p
        parts = np.array([shares, 1 - shares])
        nu = dof_of_squares(parts.sum(axis=1), parts @ parts.T, self.dof)
        return Test(statistic, (p, nu), float(f_tail(statistic, p, nu)))

    @cached_property
    def _split(self) -> tuple[Array, Array]:
        """Squares of the differences, and shares of the first epoch in S, (p,) each.

        They are in directions in which the covariance matrices of both epochs are diagonal.
        """
        # Parameters may differ in size by many powers of ten.
        size = self.sigmas
        first, second = (c / np.outer(size, size) for c in self.covariances)
        shares, directions = linalg.eigh(first, first + second)
        return (directions.T @ (self.differences / size)) ** 2, np.clip(shares, 0.0, 1.0)

    @cached_property
    def fewest_changes(self) -> tuple[int, ...]:
        """Fewest parameters that changed: all others are congruent, at one level for all.

        The one that explains most is added until the others are congruent. One that is no longer
        needed then is taken back.
        """
        left, found = list(range(len(self.differences))), list[int]()
        while not self.of(left).test.congruent:
            found.append(left.pop(self._explains_most(left)))
        for i in found[:-1]:
            if self.of(sorted([*left, i])).test.congruent:
                left, found = sorted([*left, i]), [k for k in found if k != i]
        return tuple(sorted(found))

    def instead_of(self, one: int) -> tuple[int, ...]:
        """Parameters that may have changed instead of one of `fewest_changes`."""
        others = [i for i in range(len(self.differences)) if i not in self.fewest_changes]
        kept = [[*(i for i in others if i != other), one] for other in others]
        tests = [self.of(sorted(each)).test for each in kept]
        return tuple(other for other, test in zip(others, tests, strict=True) if test.congruent)

    @cached_property
    def detectable(self) -> Array:
        """Changes (p,) of one parameter alone that the test finds with a probability of `POWER`."""
        p, nu = self.test.dof
        size = noncentrality(p, LEVEL, noise_dof=nu)
        return np.sqrt(size / np.diag(np.linalg.inv(self.covariance)))

    def _explains_most(self, left: Sequence[int]) -> int:
        """Place of the parameter without which the others are the most congruent."""
        rest = [np.sum(self.of([i for i in left if i != one])._split[0]) for one in left]
        return first_best(rest, STATISTIC_TOLERANCE * rest[0])


def dof_of_squares(
    means: Array, products: Array, dof: Sequence[float] | Array, level: float = LEVEL
) -> float:
    """Degrees of freedom ν of F, where squares have variances that were estimated.

    The squares are zᵀ P z with a projector P = Σ Aₖ of the rank f, in which Aₖ has the variance k.
    With true variances they are zᵀ (Σ Aₖ / uₖ) z, where uₖ ~ χ²(rₖ)/rₖ are the ratios of estimated
    and true ones. That is taken as a scaled χ² variable of the same mean and variance, for many u.

    Parameters
    ----------
    means : (k,) array, traces of Aₖ
    products : (k, k) array, traces of Aₖ Aₗ
    dof : k degrees of freedom r of the variances; inf if one was stated
    level : float, of the quantile that the squares have in common with f times F(f, ν)
    """
    inverse = 1 / _ratios(tuple(map(float, dof)))
    f, mean = float(np.sum(means)), inverse @ means
    if np.isinf(dof).all():
        return np.inf
    scale = np.einsum("nk,kl,nl->n", inverse, products, inverse) / mean

    def too_often(log: float) -> float:
        """Log of the probability beyond a limit, in parts of the level."""
        beyond = np.mean(special.gammaincc(mean / scale / 2, np.exp(log) / scale / 2))
        return float(np.log(max(beyond, MIN_PROBABILITY) / level))

    least = float(np.log(stats.chi2.isf(level, f)))
    if too_often(least) <= 0:
        return np.inf
    most = least + 1
    while too_often(most) > 0:
        most += 2 * (most - least)
    limit = np.exp(optimize.brentq(too_often, least, most, xtol=FREEDOM_TOLERANCE)) / f

    def beyond_that(log: float) -> float:
        return float(np.log(special.fdtri(f, np.exp(log), 1 - level) / limit))

    fewest, many = np.log([max(0.1, min(dof) / 4), 1e9])
    if beyond_that(many) > 0:
        return np.inf
    return float(np.exp(optimize.brentq(beyond_that, fewest, many, xtol=FREEDOM_TOLERANCE)))


@cache
def _ratios(dof: tuple[float, ...]) -> Array:
    """Ratios of estimated and true variances, (2**POINTS, k), evenly in their distributions."""
    points = qmc.Sobol(len(dof), scramble=False).random_base2(POINTS) + 0.5 / 2**POINTS
    ratios = np.ones_like(points)
    for k, r in enumerate(dof):
        if np.isfinite(r):
            ratios[:, k] = stats.chi2.ppf(points[:, k], r) / r
    return ratios


def f_tail(statistic: float, p: int, nu: float) -> float:
    """Probability of a larger F(p, ν), which is χ²/p where ν is infinite."""
    if np.isinf(nu):
        return float(stats.chi2.sf(p * statistic, p))
    return float(stats.f.sf(statistic, p, nu))
