"""The congruence test of epochs, and the search for what changed, as in deformation analysis.

The parameters x of n epochs have the covariance matrices Cᵢ. With stated noise the weighted squares
of x about their weighted mean are χ² distributed with f = (n − 1) p degrees of freedom if nothing
changed; of two epochs they are dᵀ (C₁ + C₂)⁻¹ d, with the differences d (Pelzer 1971). Where sigmas
were estimated, each C is an estimate by r degrees of freedom, and the squares / f are compared with
F(f, ν), where ν is that of `estimated_variances.py`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from accelstudy.adjustment.estimated_variances import dof_of_squares
from accelstudy.adjustment.quality import noncentrality
from accelstudy.basics.arrays import Array
from accelstudy.epochs.file_format import Test
from accelstudy.positions.choice import first_best

LEVEL = 0.05
"""Level of the test, and of the search for what changed as a whole."""
STATISTIC_TOLERANCE = 1e-9
"""Relative difference below which two statistics are equal, and the first one is taken."""


@dataclass(frozen=True)
class Congruence:
    """Parameters in several epochs, which are congruent if nothing changed.

    Attributes
    ----------
    estimates : (n, p) array
    covariances : (n, p, p) array
    dof : (n,) array, degrees of freedom by which these were estimated; inf with stated noise
    """

    estimates: Array
    covariances: Array
    dof: Array

    def of(self, chosen: Sequence[int]) -> Congruence:
        """Some of the parameters, whatever the others do."""
        covariances = self.covariances[:, chosen][:, :, chosen]
        return Congruence(self.estimates[:, chosen], covariances, self.dof)

    @cached_property
    def test(self) -> Test:
        """Whether epochs differ by no more than their covariance matrices say."""
        f, nu = self.freedom
        statistic = self._squares / f
        p_value = _f_tail(statistic, f, nu)
        return Test(statistic=statistic, dof=[f, nu], p_value=p_value, level=LEVEL)

    @cached_property
    def freedom(self) -> tuple[int, float]:
        """Degrees of freedom f and ν of F; ν is infinite with stated noise."""
        n, p = self.estimates.shape
        parts = self._about_the_mean[1].reshape(n, p, n, p)
        means = np.einsum("iaia->i", parts)
        return (n - 1) * p, dof_of_squares(means, np.einsum("iajb->ij", parts**2), self.dof, LEVEL)

    @cached_property
    def _about_the_mean(self) -> tuple[Array, Array]:
        """Roots of the weights, (n, p, p), and what whitened residuals about a mean are, (np, np).

        Parameters may differ in size by many powers of ten, so the roots are of scaled ones.
        """
        size = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2).sum(axis=0))
        roots = np.linalg.inv(np.linalg.cholesky(self.covariances / np.outer(size, size))) / size
        basis = np.linalg.qr(np.concatenate(roots * size))[0]
        return roots, np.eye(len(basis)) - basis @ basis.T

    @cached_property
    def _squares(self) -> float:
        """Weighted squares about the mean."""
        roots, projector = self._about_the_mean
        z = np.einsum("nij,nj->ni", roots, self.estimates - self.estimates[0]).ravel()
        return float(z @ projector @ z)

    @cached_property
    def fewest_changes(self) -> tuple[int, ...]:
        """Fewest parameters that changed: all others are congruent, at one level for all.

        The one that explains most is added until the others are congruent. One that is no longer
        needed then is taken back.
        """
        left, found = list(range(self.estimates.shape[1])), list[int]()
        while left and not self.of(left).test.congruent:
            found.append(left.pop(self._explains_most(left)))
        for i in found[:-1]:
            if self.of(sorted([*left, i])).test.congruent:
                left, found = sorted([*left, i]), [k for k in found if k != i]
        return tuple(sorted(found))

    def instead_of(self, one: int) -> tuple[int, ...]:
        """Parameters that may have changed instead of one of `fewest_changes`."""
        every = range(self.estimates.shape[1])
        others = [i for i in every if i not in self.fewest_changes]
        kept = [[*(i for i in others if i != other), one] for other in others]
        tests = [self.of(sorted(each)).test for each in kept]
        return tuple(other for other, test in zip(others, tests, strict=True) if test.congruent)

    def detectable(self, course: ArrayLike) -> Array:
        """Sizes (p,) from which on a change of one parameter alone is found.

        The probability that the test finds it is `POWER`.

        Parameters
        ----------
        course : (n,) array, change of the parameter in each epoch, in parts of its size
        """
        (f, nu), (roots, projector) = self.freedom, self._about_the_mean
        shown = np.einsum("n,nij->nij", np.asarray(course, dtype=float), roots)
        columns = shown.reshape(len(projector), -1)
        each = np.einsum("ik,ij,jk->k", columns, projector, columns)
        return np.sqrt(noncentrality(f, LEVEL, noise_dof=nu) / each)

    def _explains_most(self, left: Sequence[int]) -> int:
        """Place of the parameter without which the others are the most congruent."""
        rest = [self.of([i for i in left if i != one])._squares for one in left]
        return first_best(rest, STATISTIC_TOLERANCE * rest[0])


def _f_tail(statistic: float, p: int, nu: float) -> float:
    """Probability of a larger F(p, ν), which is χ²/p where ν is infinite."""
    if np.isinf(nu):
        return float(stats.chi2.sf(p * statistic, p))
    return float(stats.f.sf(statistic, p, nu))
