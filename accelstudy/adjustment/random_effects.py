"""Values with known variances that scatter by more than these, about a mean or a line.

The additional scatter is that of Paule & Mandel (1982, J. Res. NBS 87, 377): with it the weighted
squares are as many as the degrees of freedom. Where squares are fewer without any, it is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special

from accelstudy.adjustment.estimated_variances import probability_beyond, true_variances
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
    variance_dof : (n,) array or one number, degrees of freedom of the variances; infinite where
        they are known
    """

    values: Array
    variances: Array
    design: Array
    variance_dof: ArrayLike = np.inf

    @property
    def dof(self) -> int:
        """Degrees of freedom, n − u."""
        return len(self.values) - self.design.shape[1]

    @cached_property
    def scatter(self) -> float:
        """Standard deviation of the additional scatter."""
        return self._root(lambda scatter: self.dof - self.squares(scatter)) if self.dof else 0.0

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

    def probability_beyond(self, scatter: float, least: float = 0.0) -> float:
        """Probability of larger squares where there is this scatter.

        Parameters
        ----------
        scatter : float
        least : float, squares without any scatter, over those that noise leaves on average, that
            are taken if there are fewer
        """
        roots = np.sqrt(self.variances + scatter**2)
        smooth = self.design @ self.combination(scatter) * roots / roots[:, None]
        left, share = np.eye(len(roots)) - smooth, self.variances / roots**2
        dof = np.broadcast_to(self.variance_dof, len(roots))
        true, means = 1 + share * (true_variances(dof) - 1), np.diag(left)
        squares = max(self.squares(scatter), least * float(means @ share))
        return probability_beyond(squares, true, means, left**2)

    def scatter_interval(self, probability: float = 0.95) -> tuple[float, float]:
        """Interval of the scatter where its squares are between quantiles of their distribution.

        It is that of Viechtbauer (2007, Statistics in Medicine 26, 37), which may be empty, or no
        more than 0, where squares happen to be few. So its end is never smaller than where they are
        as many as noise leaves on average (a power-constrained limit, Cowan et al. 2011,
        arXiv:1105.3166).
        """
        beyond = (1 - probability) / 2
        return self.scatter_below(beyond), self.scatter_below(1 - beyond, least=1.0)

    def scatter_below(self, probability: float, least: float = 0.0) -> float:
        """Bound of the scatter that holds with a probability; `least` of `probability_beyond`."""
        return self._root(lambda x: self.probability_beyond(x, least) - probability)

    def _root(self, rising: Callable[[float], float]) -> float:
        """Scatter at which a function is zero that rises with it; 0 if it is never negative."""
        if rising(0.0) >= 0:
            return 0.0
        most = float(np.ptp(self.values)) + float(np.sqrt(np.max(self.variances)))
        while rising(most) < 0:
            most *= 4
        return most * float(optimize.brentq(lambda x: rising(x * most), 0.0, 1.0))
