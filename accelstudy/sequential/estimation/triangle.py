"""Square-root information: all positions so far as one small triangle.

The rows [Ã | −w̃] of linearised conditions at unit weight, Ã d = −w̃ + ε with ε ~ N(0, I), are kept
as the triangle of their QR decomposition,

    [R  z]
    [0  ρ],   d̂ = R⁻¹ z,   Q_xx = R⁻¹ R⁻ᵀ,   Ω = ρ².

New rows are stacked below the triangle and decomposed with it, so the effort does not grow with the
number of positions. No normal matrix is formed, so no digits are lost to the square of its
condition. Source: Bierman (1977), Factorization methods for discrete sequential
estimation, chapter IV.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import cholesky

Array = NDArray[np.float64]


def no_information(sessions: int, unknowns: int) -> Array:
    """Triangles (R, u + 1, u + 1) of no rows at all."""
    return np.zeros((sessions, unknowns + 1, unknowns + 1))


def absorb(triangles: Array, rows: Array) -> Array:
    """Triangles (R, u + 1, u + 1) with further rows (R, m, u + 1)."""
    return np.asarray(np.linalg.qr(np.concatenate([triangles, rows], axis=1), mode="r"))


def solution(triangles: Array) -> Array:
    """Steps d̂, (R, u); not finite where a triangle has no full rank."""
    lower, u = _transposed(triangles), triangles.shape[-1] - 1
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return cholesky.backward(lower, triangles[:, :u, u].T).T


def inverse_root(triangles: Array) -> Array:
    """R⁻¹, (R, u, u), with Q_xx = R⁻¹ R⁻ᵀ; not finite where a triangle has no full rank."""
    lower, u = _transposed(triangles), triangles.shape[-1] - 1
    right = np.broadcast_to(np.eye(u)[..., None], lower.shape)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.moveaxis(cholesky.backward(lower, right), -1, 0)


def omega(triangles: Array) -> Array:
    """Ω, (R,)."""
    return np.asarray(triangles[:, -1, -1] ** 2)


def length(triangles: Array, steps: Array) -> Array:
    """Lengths |R d|, (R,), of steps d (R, u), in standard deviations."""
    return np.asarray(np.linalg.norm((triangles[:, :-1, :-1] @ steps[..., None])[..., 0], axis=-1))


def _transposed(triangles: Array) -> Array:
    """Lower triangles Rᵀ, (u, u, R)."""
    return triangles[:, :-1, :-1].transpose(2, 1, 0)
