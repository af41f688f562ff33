"""Cholesky factorisation of a small symmetric matrix in each lane.

Matrices are lists of rows: lower triangles, with or without the diagonal.
"""

from __future__ import annotations

from typing import Any, TypeAlias

from accelstudy.kernel.lanes import Term, above, fma, sqrt

Rows: TypeAlias = list[list[Term]]


def dot(a: list[Term], b: list[Any]) -> Term:
    """Sum of products."""
    total: Term = 0.0
    for x, y in zip(a, b, strict=True):
        total = fma(x, y, total)
    return total


def factor(matrix: Rows, tolerance: float) -> tuple[Rows, list[Term]]:
    """L with L Lᵀ = M, of the lower triangle: its part below the diagonal, and 1/L_kk.

    A pivot at or below `tolerance` is NaN, and all that comes after it.
    """
    lower: Rows = [[] for _ in matrix]
    pivots: list[Term] = []
    for j in range(len(matrix)):
        pivot = matrix[j][j]
        for value in lower[j]:
            pivot = fma(-value, value, pivot)
        pivots.append(1.0 / sqrt(above(pivot, tolerance)))
        for i in range(j + 1, len(matrix)):
            below = matrix[i][j]
            for a, b in zip(lower[i], lower[j], strict=True):
                below = fma(-a, b, below)
            lower[i].append(below * pivots[j])
    return lower, pivots


def forward(lower: Rows, pivots: list[Term], right: list[Term]) -> list[Term]:
    """Solve L y = b."""
    result: list[Term] = []
    for row, pivot, value in zip(lower, pivots, right, strict=True):
        for a, y in zip(row, result, strict=True):
            value = fma(-a, y, value)
        result.append(value * pivot)
    return result


def backward(lower: Rows, pivots: list[Term], right: list[Term]) -> list[Term]:
    """Solve Lᵀ x = y."""
    result = list(right)
    for i in reversed(range(len(result))):
        for j in range(i + 1, len(result)):
            result[i] = fma(-lower[j][i], result[j], result[i])
        result[i] = result[i] * pivots[i]
    return result


def inverse(lower: Rows, pivots: list[Term]) -> dict[tuple[int, int], Term]:
    """(L Lᵀ)⁻¹, its lower triangle."""
    u = len(lower)
    columns = [forward(lower, pivots, [float(k == i) for i in range(u)]) for k in range(u)]
    return {(j, k): dot(columns[j], columns[k]) for j in range(u) for k in range(j + 1)}
