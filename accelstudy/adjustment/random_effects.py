"""Values with known variances that scatter by more than these, about a mean or a line.

The additional scatter is that of Paule & Mandel (1982, J. Res. NBS 87, 377): with it the weighted
squares are as many as the degrees of freedom. Where squares are fewer without any, it is 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import optimize, special, stats

from accelstudy.basics.arrays import Array

POINTS = 50
"""Scatters that `log_evidence` tries."""


@dataclass(frozen=True, eq=False)
class RandomEffects:
    """A linear model of values that scatter.

    Attributes
    ----------
    values, variances : (n,) arrays
    design : (n, u) array, of rank u
    """

    values: Array
    variances: Array
    design: Array

    @property
    def dof(self) -> int:
        """Degrees of freedom, n − u."""
        return len(self.values) - self.design.shape[1]

    @cached_property
    def scatter(self) -> float:
        """Standard deviation of the additional scatter."""
        return self._scatter_of(self.dof) if self.dof else 0.0

    @cached_property
    def estimates(self) -> Array:
        """Parameters of the model, (u,)."""
        return np.asarray(self.combination(self.scatter) @ self.values)

    @cached_property
    def covariance(self) -> Array:
        """Covariance matrix of the parameters, (u, u), with the scatter."""
        normal = (self.design.T / (self.variances + self.scatter**2)) @ self.design
        return np.asarray(np.linalg.inv(normal))

    def combination(self, scatter: float) -> Array:
        """Matrix (u, n) by which values become parameters, with a given scatter."""
        weighted = self.design.T / (self.variances + scatter**2)
        return np.asarray(np.linalg.solve(weighted @ self.design, weighted))

    def squares(self, scatter: float) -> float:
        """Weighted squares about the model, with a given scatter."""
        residuals = self.values - self.design @ (self.combination(scatter) @ self.values)
        return float(np.sum(residuals**2 / (self.variances + scatter**2)))

    def log_evidence(self) -> float:
        """Logarithm of the likelihood over all parameters, and scatters up to the range of values.

        All are as probable as each other, so models whose parameters mean the same compare by it.
        """
        part = (np.arange(POINTS) + 0.5) / POINTS
        scatters = np.ptp(self.values) * part[:, None] ** 3  # more of them near 0
        roots = 1 / np.sqrt(self.variances + scatters**2)
        q, r = np.linalg.qr(roots[:, :, None] * self.design)
        z = roots * self.values
        left = z - np.einsum("snu,smu,sm->sn", q, q, z)
        logs = 2 * np.log(part) + np.log(roots).sum(axis=1) - np.sum(left**2, axis=1) / 2
        logs -= np.log(np.abs(np.einsum("suu->su", r))).sum(axis=1)
        return float(special.logsumexp(logs))

    def scatter_interval(self, probability: float = 0.95) -> tuple[float, float]:
        """Interval of the scatter where its squares are between quantiles of χ².

        It is that of Viechtbauer (2007, Statistics in Medicine 26, 37).
        """
        beyond = (1 - probability) / 2
        low, high = (self._scatter_of(stats.chi2.isf(p, self.dof)) for p in (beyond, 1 - beyond))
        return low, high

    def _scatter_of(self, squares: float) -> float:
        """Scatter with which the weighted squares have a given sum."""
        if self.squares(0.0) <= squares:
            return 0.0
        most = float(np.ptp(self.values))
        while self.squares(most) > squares:
            most *= 4
        return most * float(optimize.brentq(lambda x: self.squares(x * most) - squares, 0.0, 1.0))
