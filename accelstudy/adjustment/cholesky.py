"""Cholesky factorisation of many small matrices at once.

The matrix axes come first, so each operation runs over all members of the batch. A member that is
not positive definite becomes NaN, whereas NumPy's batched routines raise an error for the whole
batch.
"""

from __future__ import annotations

import numpy as np

from accelstudy.basics.arrays import Array


def factor(matrices: Array, tolerance: float = 0.0) -> Array:
    """Lower triangular L with L Lᵀ = M for `matrices` (k, k, ...).

    A member whose pivot is at or below `tolerance` is NaN from that pivot on.
    """
    lower = np.zeros(matrices.shape)
    for j in range(len(matrices)):
        column = matrices[j:, j].copy()
        for i in range(j):
            column -= lower[j:, i] * lower[j, i]
        column[0][~(column[0] > tolerance)] = np.nan
        lower[j, j] = np.sqrt(column[0])
        lower[j + 1 :, j] = column[1:] / lower[j, j]
    return lower


def forward(lower: Array, right: Array) -> Array:
    """Solve L y = b for `right` (k, ...) or (k, m, ...), L (k, k, ...)."""
    result = right.copy()
    for i in range(len(lower)):
        for j in range(i):
            result[i] -= lower[i, j] * result[j]
        result[i] *= 1 / lower[i, i]
    return result


def backward(lower: Array, right: Array) -> Array:
    """Solve Lᵀ x = y, shapes as in `forward`."""
    result = right.copy()
    for i in reversed(range(len(lower))):
        for j in range(i + 1, len(lower)):
            result[i] -= lower[j, i] * result[j]
        result[i] *= 1 / lower[i, i]
    return result


def inverse(lower: Array) -> Array:
    """(L Lᵀ)⁻¹, shape (k, k, ...), of a factor."""
    k = len(lower)
    identity = np.eye(k).reshape(k, k, *(1,) * (lower.ndim - 2))
    return backward(lower, forward(lower, np.broadcast_to(identity, lower.shape)))
