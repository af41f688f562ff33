"""Shapley effects: how correlated inputs share the variance of an output.

Where inputs are correlated, no part of the variance belongs to one of them alone. Owen (2014)
divides the variance among the inputs as a game divides its gain among the players (Shapley 1953).
The value of a set of inputs is the variance that it explains, v(u) = Var E(Y | X_u), and an input
gets what it adds to v on average over all orders in which the inputs could become known. So the
shares are not negative and sum to 1, whatever the correlations; of independent inputs of a linear
function they are the classic Sobol indices.

A linear function of normal inputs has them in closed form, since v(u) = g_uᵀ Σ_uu⁻¹ g_u with
g = Cov(X, Y) (Owen & Prieur 2017; Iooss & Prieur 2019). Groups of inputs
that are independent of each other can be treated one by one (Broto et al. 2019), so the effort
depends on the largest group of correlated inputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

CHUNK = 1024
"""Sets of inputs that are computed at once."""
SINGULAR = 1e-12
"""Eigenvalues of a correlation matrix below this share of the largest one count as zero."""


def linear_shapley(slope: ArrayLike, covariance: ArrayLike) -> tuple[Array, Array]:
    """Shapley effects of normal inputs on linear outputs, exactly.

    The effort doubles with each input of the largest group of correlated ones.

    Parameters
    ----------
    slope : (k, d) array, derivatives of k outputs by d inputs
    covariance : (d, d) array, of the inputs

    Returns
    -------
    shares : (k, d) array, each row sums to 1; NaN where an output has no variance
    variance : (k,) array, of the outputs
    """
    slope, covariance = np.atleast_2d(np.asarray(slope, float)), np.asarray(covariance, float)
    gained = np.zeros_like(slope)
    for group in _groups(covariance):
        within = covariance[np.ix_(group, group)]
        gained[:, group] = _divided(within, slope[:, group] @ within)
    variance = np.einsum("ki,ij,kj->k", slope, covariance, slope)
    shares = gained / np.where(variance > 0, variance, np.nan)[:, None]
    return shares, variance


def _groups(covariance: Array) -> list[NDArray[np.int64]]:
    """Indices of the groups of correlated inputs; inputs without variance are in none."""
    from scipy.sparse.csgraph import connected_components  # slow to import; figures do without it

    varied = np.flatnonzero(np.diagonal(covariance) > 0)
    n, label = connected_components(covariance[np.ix_(varied, varied)] != 0, directed=False)
    return [varied[label == i] for i in range(n)]


def _divided(covariance: Array, with_output: Array) -> Array:
    """Variance that each of p inputs gets, (k, p), from the covariances with k outputs."""
    p = len(covariance)
    # Correlations instead of covariances, so that the inverses do not suffer from the units.
    sd = np.sqrt(np.diagonal(covariance))
    correlation, g = covariance / np.outer(sd, sd), (with_output / sd).T
    gained = np.zeros_like(g)
    for size, members in _sets(p):
        inside = np.zeros((len(members), p))
        np.put_along_axis(inside, members, 1.0, axis=1)
        of_members = g[members]
        block = correlation[members[:, :, None], members[:, None, :]]
        explained = np.linalg.pinv(block, rcond=SINGULAR, hermitian=True) @ of_members
        value = np.einsum("spk,spk->sk", of_members, explained)
        joins = factorial(size - 1) * factorial(p - size) / factorial(p)
        misses = factorial(size) * factorial(p - size - 1) / factorial(p) if size < p else 0.0
        gained += (inside * joins - (1 - inside) * misses).T @ value
    return gained.T


def _sets(p: int) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """All sets of p inputs but the empty one: their size, and their members by chunks."""
    for start in range(1, 2**p, CHUNK):
        numbers = np.arange(start, min(start + CHUNK, 2**p))
        inside = (numbers[:, None] >> np.arange(p)) & 1
        sizes = inside.sum(axis=1)
        for size in np.unique(sizes):
            _, members = np.nonzero(inside[sizes == size])
            yield int(size), members.reshape(-1, size)
