"""Sizes of an effect as those of a type: which sensors have it, as large as it is in the others.

Sensor i tells of its parameters β by ℓ_i(β) = βᵀ b_i − βᵀ N_i β / 2 (`evidence.Shown`). In a type
they are β ~ N(μ, S), S = τ² ‖μ‖²/k · I, in a part ρ of the sensors, and 0 in the others. So the
odds of sensor i are

    log r_i = (b_i + S⁻¹μ)ᵀ (S⁻¹ + N_i)⁻¹ (b_i + S⁻¹μ)/2 − μᵀ S⁻¹ μ/2 − log|I + S N_i|/2,

with μ, ρ and τ that make Σ log(1 − ρ + ρ r_i) largest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SCATTERS = (0.1, 0.25, 0.5, 1.0)
"""τ, scatter of the parameters of a type in parts of their size."""
STEPS = 60
"""Most steps of the search for μ and ρ."""
SETTLED = 1e-4
"""Change of the log likelihood below which they are found."""


def odds_with_sizes(normal: Array, right: Array) -> tuple[Array, float]:
    """Log odds of each sensor for an effect whose sizes are those of a type.

    Parameters
    ----------
    normal, right : (n, k, k) and (n, k) arrays, N_i and b_i

    Returns
    -------
    odds : (n,) array
    log_likelihood : float, less what the fitted parameters are worth (BIC)
    """
    n, k = right.shape
    # In units in which parameters show equally well.
    unit = np.sqrt(np.maximum(np.einsum("nkk->k", normal), 1e-300) / n)
    normal, right = normal / np.outer(unit, unit), right / unit
    best = np.zeros(n), -np.inf
    pooled = np.linalg.pinv(normal.sum(axis=0), rcond=1e-6) @ right.sum(axis=0)
    for scatter in SCATTERS:
        for share in (0.25, 0.9):
            found = _searched(normal, right, pooled / share, share, scatter)
            best = max(best, found, key=lambda one: one[1])
    return best[0], best[1] - (k + 2) / 2 * float(np.log(n))


def _searched(
    normal: Array, right: Array, mean: Array, share: float, scatter: float
) -> tuple[Array, float]:
    """Odds and log likelihood at the μ and ρ that are found from given ones."""
    k, before = len(mean), -np.inf
    odds = np.zeros(len(right))
    for _ in range(STEPS):
        s = scatter**2 * max(float(mean @ mean) / k, 1e-12)
        inverse = np.linalg.inv(normal + np.eye(k) / s)
        pull = right + mean / s
        odds = (
            np.einsum("nk,nkl,nl->n", pull, inverse, pull) / 2
            - mean @ mean / (2 * s)
            - np.linalg.slogdet(np.eye(k) + s * normal)[1] / 2
        )
        logs = np.logaddexp(np.log1p(-share), np.log(share) + odds)
        now = float(logs.sum())
        if now < before + SETTLED:
            break
        before = now
        weights = np.exp(np.log(share) + odds - logs)
        share = float(np.clip(weights.mean(), 0.01, 0.999))
        # Weighted least squares: (N⁻¹ + S)⁻¹ = N − N (S⁻¹ + N)⁻¹ N.
        taken = normal - normal @ inverse @ normal
        seen = right - np.einsum("nkl,nlm,nm->nk", normal, inverse, right)
        whole = np.einsum("n,nkl->kl", weights, taken)
        mean = np.linalg.pinv(whole, rcond=1e-6) @ (weights @ seen)
    return odds, before
