"""Coloured noise: correlations of successive holds, without matrices of holds by holds.

The processes are those of `LENGTHS`: the first-order Gauss–Markov process of `coloured_noise`,
whose τ counts holds here, and a random walk, min(i, j)/n. Their quadratic forms follow from a
convolution and from sums, and a Kalman filter gives their exact likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.noise.restricted import restricted_to_residuals
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.noise_effects.coloured_noise import memory, renewed

Array = NDArray[np.float64]

LENGTHS = (1.0, 3.0, 8.0, np.inf)
"""Correlation lengths in holds; infinite for the random walk."""
STRENGTHS = (0.25, 1.0, 4.0, 16.0, 64.0)
"""Variances of the process, with white noise of 1, over which the evidence is averaged."""


def colour_density(residuals: Residuals, evidence: Evidence) -> float:
    """Log density of residuals with coloured noise, mean over correlation lengths and strengths."""
    determinant, squares = restricted(residuals, STRENGTHS)
    logs = np.logaddexp.reduce(evidence.of_noise(squares, determinant), axis=-1)
    return float(log_mean(logs.ravel()))


def quadratic_forms(v: Array) -> Array:
    """Sums over axes of vᵀ K v for values v (..., n, 3), one for each process, (..., k)."""
    n = v.shape[-2]
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    lag = np.minimum(np.arange(size), size - np.arange(size))
    spectrum = np.fft.rfft(v, size, axis=-2)
    power = np.sum(spectrum.real**2 + spectrum.imag**2, axis=-1)
    # Of the spectrum of a real sequence, all but the ends stand for two frequencies.
    twice = np.where((np.arange(power.shape[-1]) % (size // 2)) == 0, 1.0, 2.0) / size
    forms = []
    for length in LENGTHS:
        if np.isfinite(length):
            kernel = np.where(lag < n, memory(lag, length), 0.0)
            forms.append(power @ (twice * np.fft.rfft(kernel).real))
        else:
            later = np.cumsum(v[..., ::-1, :], axis=-2)
            forms.append(np.sum(later**2, axis=(-2, -1)) / n)
    return np.stack(forms, axis=-1)


def restricted(residuals: Residuals, strengths: Sequence[float]) -> tuple[Array, Array]:
    """log|Nᵀ Σ N| and zᵀ (Nᵀ Σ N)⁻¹ z of white noise and a process on each axis, (k, s) each.

    The covariance of unit weight is Σ = I + s F (I₃ ⊗ K) Fᵀ, with F the noise of the forces in the
    conditions.

    Parameters
    ----------
    residuals : Residuals
    strengths : variances s of the process on an axis, beside 1 of the white noise
    """
    n, c = residuals.whitening.shape[:2]
    columns = np.column_stack([residuals.absorbed, residuals.z])
    determinant, normal = _filtered(residuals, columns[: n * c].reshape(n, c, -1), strengths)
    rest = columns[n * c :]  # observed gravity is no force
    return restricted_to_residuals(determinant, normal + rest.T @ rest)


def _filtered(
    residuals: Residuals, columns: Array, strengths: Sequence[float]
) -> tuple[Array, Array]:
    """log|Σ|, (k, s), and Cᵀ Σ⁻¹ C, (k, s, v, v), of columns C (n, c, v), by a Kalman filter."""
    n, c, width = columns.shape
    lasting = np.array([memory(1.0, length) for length in LENGTHS])[:, None]
    walk = np.isinf(np.array(LENGTHS))[:, None]
    s = np.asarray(strengths, dtype=float)
    first = s * np.where(walk, 1 / n, 1.0)
    added = s * np.where(walk, 1 / n, renewed(lasting))
    lasting = lasting[..., None, None]
    eye = np.eye(3)
    state = np.zeros((*first.shape, 3, width))
    covariance = first[..., None, None] * eye
    growth = added[..., None, None] * eye
    determinant = np.zeros(first.shape)
    normal = np.zeros((*first.shape, width, width))
    for f, seen in zip(residuals.force_noise, columns, strict=True):
        gain = covariance @ f.T
        innovation = seen - f @ state
        inverse = np.linalg.inv(f @ gain + np.eye(c))
        determinant -= np.linalg.slogdet(inverse)[1]
        scaled = inverse @ innovation
        normal += np.swapaxes(innovation, -1, -2) @ scaled
        state = lasting * (state + gain @ scaled)
        left = covariance - gain @ inverse @ np.swapaxes(gain, -1, -2)
        # Symmetric, or rounding errors would grow from hold to hold.
        covariance = lasting**2 * (left + np.swapaxes(left, -1, -2)) / 2 + growth
    return determinant, normal
