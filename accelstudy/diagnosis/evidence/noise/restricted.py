"""The restricted likelihood of residuals whose noise has a covariance Σ.

In the residual space (Harville 1974, restricted maximum likelihood), with N an orthonormal basis of
it and U one of the design,

    log|Nᵀ Σ N| = log|Σ| + log|Uᵀ Σ⁻¹ U|,
    zᵀ (Nᵀ Σ N)⁻¹ z = zᵀ Σ⁻¹ z − zᵀ Σ⁻¹ U (Uᵀ Σ⁻¹ U)⁻¹ Uᵀ Σ⁻¹ z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def restricted_to_residuals(determinant: Array, normal: Array) -> tuple[Array, Array]:
    """log|Nᵀ Σ N| and zᵀ (Nᵀ Σ N)⁻¹ z, (...) each.

    Parameters
    ----------
    determinant : (...) array, log|Σ|
    normal : (..., u + 1, u + 1) array, Cᵀ Σ⁻¹ C of the columns C = [U, z]
    """
    design, mixed, square = normal[..., :-1, :-1], normal[..., :-1, -1:], normal[..., -1, -1]
    explained = np.swapaxes(mixed, -1, -2) @ np.linalg.solve(design, mixed)
    return (
        np.asarray(determinant + np.linalg.slogdet(design)[1]),
        np.asarray(square - explained[..., 0, 0]),
    )
