"""The congruence test of two epochs, and the search for what changed, as in deformation analysis.

The differences d of the parameters have the covariance matrix S = C₁ + C₂. With stated noise
dᵀ S⁻¹ d is χ² distributed if nothing changed (Pelzer 1971). Where sigmas were estimated, each C is
an estimate by r degrees of freedom. Then dᵀ S⁻¹ d / p is compared with F(p, ν). In the directions
in which C₁ and C₂ are both diagonal the squares are those of t variables, each with the degrees of
freedom of Welch and Satterthwaite; ν is that of the F variable with the same mean (Fai & Cornelius
1996, J. Stat. Comput. Simul. 54, 363).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import linalg, optimize, stats

from accelstudy.positions.choice import first_best

Array = NDArray[np.float64]

LEVEL = 0.05
"""Level of the test, and of the search for what changed as a whole."""
POWER = 0.8
"""Probability with which a detectable change is found."""
ALIKE = 1e-9
"""Relative difference below which two statistics are equal, and the first one is taken."""


@dataclass(frozen=True)
class Test:
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
        """Whether nothing has to have changed."""
        return self.p_value >= LEVEL


@dataclass(frozen=True)
class Epochs:
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

    def of(self, chosen: Sequence[int]) -> Epochs:
        """Differences of some of the parameters, whatever the others do."""
        first, second = (c[np.ix_(chosen, chosen)] for c in self.covariances)
        return Epochs(self.differences[chosen], (first, second), self.dof)

    def test(self) -> Test:
        """Test of congruence."""
        p = len(self.differences)
        if not p:
            return Test(0.0, (0, np.inf), 1.0)
        # Parameters may differ in size by many powers of ten.
        size = np.sqrt(np.diag(self.covariance))
        first, second = (c / np.outer(size, size) for c in self.covariances)
        shares, directions = linalg.eigh(first, first + second)
        statistic = float(np.sum((directions.T @ (self.differences / size)) ** 2)) / p
        nu = _common_dof(np.clip(shares, 0.0, 1.0), self.dof)
        return Test(statistic, (p, nu), float(tail(statistic, p, nu)))

    def changed(self) -> tuple[int, ...]:
        """Fewest parameters that changed: all others are congruent, at one level for all.

        The one that explains most is added until the others are congruent. One that is no longer
        needed then is taken back.
        """
        left, found = list(range(len(self.differences))), list[int]()
        while not self.of(left).test().congruent:
            found.append(left.pop(self._explains_most(left)))
        for i in found[:-1]:
            if self.of(sorted([*left, i])).test().congruent:
                left, found = sorted([*left, i]), [k for k in found if k != i]
        return tuple(sorted(found))

    def instead_of(self, one: int, found: Sequence[int]) -> tuple[int, ...]:
        """Parameters that may have changed instead of one that was found."""
        others = [i for i in range(len(self.differences)) if i not in found]
        kept = [[*(i for i in others if i != other), one] for other in others]
        tests = [self.of(sorted(each)).test() for each in kept]
        return tuple(other for other, test in zip(others, tests, strict=True) if test.congruent)

    def detectable(self) -> Array:
        """Changes (p,) of one parameter alone that the test finds with a probability of `POWER`."""
        p, nu = self.test().dof
        return np.sqrt(noncentrality(p, nu) / np.diag(np.linalg.inv(self.covariance)))

    def _explains_most(self, left: Sequence[int]) -> int:
        """Place of the parameter without which the others are the most congruent."""
        rest = [self.of([i for i in left if i != one]).test().statistic for one in left]
        return first_best(rest, ALIKE * rest[0])


def noncentrality(p: int, nu: float, level: float = LEVEL) -> float:
    """Noncentrality of a change that a test with p and ν degrees of freedom finds with `POWER`."""
    many = not np.isfinite(nu)
    limit = stats.chi2.isf(level, p) if many else stats.f.isf(level, p, nu)

    def missed(size: float) -> float:
        if many:
            return float(stats.ncx2.cdf(limit, p, size)) - (1 - POWER)
        return float(stats.ncf.cdf(limit, p, nu, size)) - (1 - POWER)

    return float(optimize.brentq(missed, 1e-6, 1e4))


def _common_dof(shares: ArrayLike, dof: tuple[float, float]) -> float:
    """Degrees of freedom ν of F; `shares` (p,) are those of the first epoch in each direction."""
    a = np.asarray(shares, dtype=float)
    with np.errstate(divide="ignore"):
        each = 1 / (a**2 / dof[0] + (1 - a) ** 2 / dof[1])
    if np.isinf(each).all():
        return np.inf
    if each.min() <= 2:  # no mean
        return float(each.min())
    mean = np.sum(1 / (1 - 2 / each))
    return float(2 * mean / (mean - len(a)))


def tail(statistic: float, p: int, nu: float) -> float:
    """Probability of a larger F(p, ν), which is χ²/p where ν is infinite."""
    if np.isinf(nu):
        return float(stats.chi2.sf(p * statistic, p))
    return float(stats.f.sf(statistic, p, nu))
