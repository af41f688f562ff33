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


def factor_of_rows(rows: Array) -> tuple[Array, Array]:
    """L (c, c, ...) and U (c, o, ...) with R = L U for `rows` R (c, o, ...), and U Uᵀ = I.

    L is the factor of R Rᵀ, by the modified Gram–Schmidt process. Products of rows whose sizes are
    1e-5 of each other would leave half of the digits.
    """
    lower, unit = np.zeros((len(rows), len(rows), *rows.shape[2:])), rows.copy()
    for j in range(len(rows)):
        lower[j, j] = np.sqrt(np.einsum("o...,o...->...", unit[j], unit[j]))
        unit[j] /= lower[j, j]
        lower[j + 1 :, j] = np.einsum("co...,o...->c...", unit[j + 1 :], unit[j])
        unit[j + 1 :] -= lower[j + 1 :, j, None] * unit[j]
    return lower, unit


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
