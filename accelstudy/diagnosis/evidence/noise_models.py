"""The evidence for noise that is not white and equal on all axes, by its restricted likelihood.

In the residual space (Harville 1974, restricted maximum likelihood), with N an orthonormal basis of
it, U one of the design, and Σ the covariance of the noise,

    log|Nᵀ Σ N| = log|Σ| + log|Uᵀ Σ⁻¹ U|,
    zᵀ (Nᵀ Σ N)⁻¹ z = zᵀ Σ⁻¹ z − zᵀ Σ⁻¹ U (Uᵀ Σ⁻¹ U)⁻¹ Uᵀ Σ⁻¹ z.

Unequal axes: the variances of the axes have the ratios κ, log κ_i summing to zero. Residuals alone
say little of them where the redundancy is small, so κ has a prior: about equal axes, within a
factor of two or so, and where the noise within the holds is known, about its ratios.

Coloured noise: successive holds are correlated. The processes are those of `LENGTHS`: the
first-order Gauss–Markov process of `coloured_noise`, whose τ counts holds here, and a random walk,
min(i, j)/n. A process of strength s adds s K to the covariance of the residuals, as a smooth
function of the time does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.noise_effects.coloured_noise import autocorrelation

Array = NDArray[np.float64]


LOG_RATIOS = np.linspace(-2.5, 2.5, 9)
CONTRASTS = np.array([[2.0, -1.0, -1.0], [0.0, 1.0, -1.0]]) / np.sqrt([[6.0], [2.0]])


def unequal_axes_density(residuals: Residuals, evidence: Evidence, within: Array | None) -> float:
    """Log density of residuals with noise that differs from axis to axis, over the ratios.

    Parameters
    ----------
    residuals : Residuals, of a fit with equal axes
    evidence : Evidence
    within : (3,) array, variances within the holds; None if unknown
    """
    x, y = (values.ravel() for values in np.meshgrid(LOG_RATIOS, LOG_RATIOS))
    ratios = np.exp(np.column_stack([x, y]) @ CONTRASTS)
    determinant, squares = _restricted(residuals, ratios)
    densities = np.logaddexp.reduce(evidence.noise_density(squares, determinant), axis=-1)
    prior = _normal(x, y, np.zeros(3), RULES.spread_axes)
    if within is not None and np.all(within > 0):
        centre = np.log(within) - np.mean(np.log(within))
        prior = (prior + _normal(x, y, centre, RULES.spread_within)) / 2
    return float(log_mean(densities, prior))


def _normal(x: Array, y: Array, centre: Array, spread: float) -> Array:
    """Normal density on the grid of contrasts, which sums to 1."""
    a, b = CONTRASTS @ centre
    density = np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * spread**2))
    return np.asarray(density / density.sum())


def _restricted(residuals: Residuals, ratios: Array) -> tuple[Array, Array]:
    """log|Nᵀ Σ N| and zᵀ (Nᵀ Σ N)⁻¹ z for variances (g, 3) of the axes, (g,) each."""
    n, c = residuals.whitening.shape[:2]
    columns = np.column_stack([residuals.absorbed, residuals.z])
    blocks, rest = columns[: n * c].reshape(n, c, -1), columns[n * c :]
    f = residuals.force_noise
    covariance = np.eye(c) + np.einsum("ga,nca,nda->gncd", ratios - 1, f, f)
    weighted = (np.linalg.inv(covariance) @ blocks).reshape(len(ratios), n * c, -1)
    normal = columns[: n * c].T @ weighted + rest.T @ rest
    design, mixed, square = normal[:, :-1, :-1], normal[:, :-1, -1:], normal[:, -1, -1]
    explained = np.swapaxes(mixed, -1, -2) @ np.linalg.solve(design, mixed)
    determinant = np.sum(np.linalg.slogdet(covariance)[1], axis=1)
    return determinant + np.linalg.slogdet(design)[1], square - explained[:, 0, 0]


LENGTHS = (1.0, 3.0, 8.0, np.inf)
"""Correlation lengths in holds; infinite for the random walk."""
STRENGTHS = np.array([0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0])
"""Variances of the process, with white noise of 1, over which the evidence is averaged."""


def colour_kernels(n: int) -> Array:
    """Covariance of n holds by each process, (k, n, n)."""
    i = np.arange(n)
    walk = (np.minimum(i[:, None], i) + 1) / n
    lag = np.abs(i[:, None] - i)
    return np.stack([autocorrelation(lag, x) if np.isfinite(x) else walk for x in LENGTHS])


def coloured_density(residuals: Residuals, evidence: Evidence) -> float:
    """Log density of residuals with coloured noise, over lengths and strengths."""
    n, c = residuals.whitening.shape[:2]
    f, z, logs = residuals.force_noise, residuals.z, []
    for kernel in colour_kernels(n):
        covariance = np.einsum("ica,ij,jda->icjd", f, kernel, f).reshape(n * c, n * c)
        rows = residuals.project(np.pad(covariance, (0, len(z) - n * c)))
        process = residuals.project(rows.T)
        for strength in STRENGTHS:
            root = np.linalg.cholesky(np.eye(len(z)) + strength * process)
            white = solve_triangular(root, z, lower=True)
            determinant = 2 * np.sum(np.log(np.diag(root)))
            density = evidence.noise_density(white @ white, determinant)
            logs.append(np.logaddexp.reduce(density))
    return float(log_mean(np.array(logs)))
