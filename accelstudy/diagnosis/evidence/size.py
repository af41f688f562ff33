"""The evidence of a hypothesis of unknown size, in noise whose level is known, doubted or unknown.

Residuals z of unit weight, r numbers, have the variance s² of unit weight. An effect whose
signature has the orthonormal basis Q (r, d) adds Q a to them, a ~ N(0, s² g I), g = λ/d, with λ the
noncentrality that is to be expected of it (Zellner's prior; Liang et al. 2008, J. Am. Stat. Assoc.
103, 410). With s² ~ inverse-gamma(ν/2, ν/2) the density of z is

    m(z) ∝ c(ν) (1 + g)^(−d/2) (ν + ‖z‖² − g/(1 + g) ‖Qᵀz‖²)^(−(ν + r)/2),
    c(ν) = ν^(ν/2) Γ((ν + r)/2) / Γ(ν/2).

λ is integrated over one prior for all hypotheses, with large and with small spaces alike; so a
hypothesis with many parameters pays for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.rules import RULES

SIZES = np.geomspace(4.0, 4e6, 13)
SIZE_WEIGHTS = np.where(SIZES < 1500, 0.9 / 6, 0.1 / 7)
"""Prior of λ: even in its logarithm from hardly visible (4) to plain (1000), and one tenth beyond,
where an effect would have been noticed without any test."""
SHAPE_SIZES = np.geomspace(4.0, 4e6, 7)
SHAPE_WEIGHTS = np.where(SHAPE_SIZES < 1500, 0.9 / 3, 0.1 / 4)
"""The same prior for a shape, whose density changes less with λ."""
SIMULATED_SIZES = 4
"""The first of them, which are all that simulated residuals can have."""


_EVEN = np.linspace(0.0, 60.0, 241)
_LOGS = np.concatenate([_EVEN, np.geomspace(61.0, 1e5, 120)])
"""Where the integral over λ is tabulated: −(ν + r)/2 · log(1 − x), x = ‖Qᵀz‖²/(ν + ‖z‖²)."""


@dataclass(frozen=True)
class Level:
    """What is known of the variance of unit weight: a mixture of inverse-gamma distributions.

    Attributes
    ----------
    weights, freedoms : (c,) tuples of float, prior probabilities, and ν of each
    known : bool, whether sigma is given
    """

    weights: tuple[float, ...]
    freedoms: tuple[float, ...]
    known: bool

    @classmethod
    def of_stated_sigma(cls, dof: float = RULES.freedom_given) -> Level:
        """Level of a stated sigma, which has so many degrees of freedom if it is right."""
        wrong, freedom = RULES.prior_sigma_wrong, min(dof, RULES.freedom_given)
        return cls((1 - wrong, wrong), (freedom, RULES.freedom_doubted), known=True)

    @classmethod
    def of_holds(cls) -> Level:
        """Level without a stated sigma, where the noise within the holds may be all there is."""
        more = RULES.prior_more_than_within
        return cls((1 - more, more), (RULES.freedom_given, RULES.freedom_doubted), known=False)

    @classmethod
    def of_nothing_stated(cls) -> Level:
        """Level of a sigma of which nothing is known."""
        return cls((1.0,), (RULES.freedom_not_given,), known=False)


@dataclass(frozen=True)
class Evidence:
    """Log densities of residuals under hypotheses, up to a constant that all of them share.

    Parameters
    ----------
    level : Level
    redundancy : int, r
    """

    level: Level
    redundancy: int

    @cached_property
    def _constants(self) -> Array:
        """Log of weight · c(ν), (c,)."""
        nu = np.array(self.level.freedoms)
        c = nu / 2 * np.log(nu) + gammaln((nu + self.redundancy) / 2) - gammaln(nu / 2)
        return np.asarray(np.log(self.level.weights) + c)

    def noise_density(self, squares: ArrayLike, determinant: ArrayLike = 0.0) -> Array:
        """Noise alone, by the components of the level.

        Parameters
        ----------
        squares : (...) array, ‖z‖², or zᵀ Σ⁻¹ z where the noise has a covariance Σ
        determinant : (...) array, log |Σ|

        Returns
        -------
        (..., c) array
        """
        nu = np.array(self.level.freedoms)
        logs = np.log(nu + np.asarray(squares, dtype=float)[..., None])
        half = (nu + self.redundancy) / 2
        return np.asarray(
            self._constants - half * logs - np.asarray(determinant, dtype=float)[..., None] / 2
        )

    def variance(self, squares: float) -> float:
        """Variance of unit weight that is expected where this much of ‖z‖² is left to the noise."""
        nu, logs = np.array(self.level.freedoms), self.noise_density(squares)
        weights = np.exp(logs - logs.max())
        return float(weights @ ((nu + squares) / (nu + self.redundancy)) / weights.sum())

    def spaces_density(
        self, parts: Array, dims: NDArray[np.int_] | Sequence[int], squares: ArrayLike
    ) -> Array:
        """Something in a space beside the noise, over all sizes and levels.

        Parameters
        ----------
        parts : (..., s) array, ‖Qᵀz‖² of each space
        dims : (s,) int array, their dimensions
        squares : (...) array, ‖z‖²

        Returns
        -------
        (..., s) array
        """
        dims, squares = np.asarray(dims), np.asarray(squares, dtype=float)
        noise, total = self.noise_density(squares), None
        sizes, table_of = np.unique(dims, return_inverse=True)
        for c, nu in enumerate(self.level.freedoms):
            share = np.minimum(parts / (nu + squares)[..., None], 1 - 1e-14)
            at = -(nu + self.redundancy) / 2 * np.log(1 - share)
            tables = np.stack([_table(int(d), nu, self.redundancy) for d in sizes])
            logs = noise[..., c, None] + _looked_up(tables, table_of, at)
            total = logs if total is None else np.logaddexp(total, logs)
        assert total is not None
        return total

    def shapes_density(
        self, squares: Sequence[Array], shares: Sequence[Array], total: Array
    ) -> Array:
        """Something with a covariance λ K beside the noise, over all sizes and levels.

        Parameters
        ----------
        squares : s arrays (b, k), of residuals along the eigenvectors of each K
        shares : s arrays (k,), its eigenvalues
        total : (b,) array, ‖z‖²

        Returns
        -------
        (b, s) array
        """
        count = SIMULATED_SIZES if len(total) > 1 else len(SHAPE_SIZES)
        ranks, logs = np.array([*map(len, shares)]), np.empty((len(total), len(shares), count))
        for rank in np.unique(ranks):
            alike = np.flatnonzero(ranks == rank).tolist()
            along, share = (np.stack([each[i] for i in alike]) for each in (squares, shares))
            by_shape = self.densities_by_size(along, share, total, SHAPE_SIZES[:count])
            logs[:, alike] = np.swapaxes(by_shape, 0, 1)
        return np.asarray(np.logaddexp.reduce(logs + np.log(SHAPE_WEIGHTS[:count]), axis=-1))

    def densities_by_size(self, along: Array, share: Array, total: Array, sizes: Array) -> Array:
        """Something with a covariance λ K beside the noise, by its size λ, over all levels.

        Parameters
        ----------
        along : (..., b, k) array, squares of residuals along the eigenvectors of K
        share : (..., k) array, its eigenvalues
        total : (b,) array, ‖z‖²
        sizes : (s,) array, λ

        Returns
        -------
        (..., b, s) array
        """
        growth = sizes[:, None] * share[..., None, :]
        taken = along @ np.swapaxes(growth / (1 + growth), -1, -2)
        noise, logs = self.noise_density(total), []
        for level, nu in enumerate(self.level.freedoms):
            rest = np.log1p(-taken / (nu + total)[:, None])
            logs.append(noise[:, level, None] - (nu + self.redundancy) / 2 * rest)
        determinant = np.sum(np.log1p(growth), axis=-1)[..., None, :]
        return np.asarray(np.logaddexp.reduce(logs) - determinant / 2)


def _looked_up(tables: Array, which: NDArray[np.int_], at: Array) -> Array:
    """Interpolate tables (t, k) at some of `_LOGS`, (..., s), each of s with a table of its own."""
    # Evenly spaced: a division finds the place.
    steps = np.minimum(at, _EVEN[-1]) * (1 / _EVEN[1])
    place = np.minimum(steps.astype(np.int32), len(_EVEN) - 2)
    steps -= place
    place += which.astype(np.int32) * tables.shape[1]
    flat = tables.ravel()
    values = np.diff(flat)[place]
    values *= steps
    values += flat[place]
    if np.any(far := at > _EVEN[-1]):
        beyond = np.nonzero(far)
        chosen = which[beyond[-1]]
        for k in np.unique(chosen):
            some = tuple(index[chosen == k] for index in beyond)
            values[some] = np.interp(at[some], _LOGS, tables[k])
    return values


@lru_cache(maxsize=1024)
def _table(dim: int, nu: float, redundancy: int) -> Array:
    """Log of the mean over λ at `_LOGS`, beside noise alone."""
    half = (nu + redundancy) / 2
    share = -np.expm1(-_LOGS / half)
    g = SIZES[:, None] / dim
    logs = -dim / 2 * np.log1p(g) - half * np.log1p(-g / (1 + g) * share)
    return log_mean(logs.T, SIZE_WEIGHTS)


def log_mean(logs: Array, weights: ArrayLike | None = None) -> Array:
    """Log of the mean of exp(logs) over the last axis, with weights or without."""
    w = np.ones(logs.shape[-1]) if weights is None else np.asarray(weights, dtype=float)
    top = np.max(logs, axis=-1, keepdims=True)
    mean = np.sum(np.exp(logs - top) * w, axis=-1) / np.sum(w)
    return np.asarray(top[..., 0] + np.log(mean))
