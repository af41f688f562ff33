"""Cholesky factorisation of many small matrices at once.

The matrix axes come first, so that each operation runs over all members of the batch, and a member
that is not positive definite becomes NaN instead of raising for all of them (as LAPACK's batched
routines in NumPy do).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def factor(matrices: Array, tolerance: float = 0.0) -> Array:
    """Lower triangular L with L Lᵀ = M for `matrices` (k, k, ...).

    A member whose pivot is at or below `tolerance` is NaN from that pivot on.
    """
    k = len(matrices)
    lower = np.zeros(matrices.shape)
    for j in range(k):
        pivot = matrices[j, j] - (lower[j, :j] ** 2).sum(axis=0)
        root = np.sqrt(np.where(pivot > tolerance, pivot, np.nan))
        lower[j, j] = root
        for i in range(j + 1, k):
            lower[i, j] = (matrices[i, j] - (lower[i, :j] * lower[j, :j]).sum(axis=0)) / root
    return lower


def forward(lower: Array, right: Array) -> Array:
    """Solve L y = b for `right` (k, ...) or (k, m, ...), L (k, k, ...)."""
    result = np.empty(right.shape)
    for i in range(len(lower)):
        total = right[i] - sum(lower[i, j] * result[j] for j in range(i))
        result[i] = total / lower[i, i]
    return result


def backward(lower: Array, right: Array) -> Array:
    """Solve Lᵀ x = y, shapes as in `forward`."""
    result = np.empty(right.shape)
    k = len(lower)
    for i in reversed(range(k)):
        total = right[i] - sum(lower[j, i] * result[j] for j in range(i + 1, k))
        result[i] = total / lower[i, i]
    return result


def inverse(lower: Array) -> Array:
    """(L Lᵀ)⁻¹, shape (k, k, ...), of a factor."""
    k = len(lower)
    identity = np.eye(k).reshape(k, k, *(1,) * (lower.ndim - 2))
    return backward(lower, forward(lower, np.broadcast_to(identity, lower.shape)))
