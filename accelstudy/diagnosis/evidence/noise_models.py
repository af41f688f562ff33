"""The evidence for noise that is not white and equal on all axes, by its restricted likelihood.

In the residual space (Harville 1974, restricted maximum likelihood), with N an orthonormal basis of
it, U one of the design, and Σ the covariance of the noise,

    log|Nᵀ Σ N| = log|Σ| + log|Uᵀ Σ⁻¹ U|,
    zᵀ (Nᵀ Σ N)⁻¹ z = zᵀ Σ⁻¹ z − zᵀ Σ⁻¹ U (Uᵀ Σ⁻¹ U)⁻¹ Uᵀ Σ⁻¹ z.

Unequal axes: the variances of the axes have the ratios κ, log κ_i summing to zero. Residuals alone
say little of them where the redundancy is small, so κ has a prior: about equal axes, within a
factor of two or so, and where the noise within the holds is known, about its ratios.

Coloured noise: successive holds are correlated, without matrices of holds by holds. The processes
are those of `LENGTHS`: the first-order Gauss–Markov process of `coloured_noise`, whose τ counts
holds here, and a random walk, min(i, j)/n. Their quadratic forms follow from a convolution and from
sums, and a Kalman filter gives their exact likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.noise_effects.coloured_noise import autocorrelation, innovation_variance

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


AT_ONCE = 10_000_000
"""Numbers in one block of work, about."""
LOG_RATIOS = np.linspace(-2.5, 2.5, 9)
CONTRASTS = np.array([[2.0, -1.0, -1.0], [0.0, 1.0, -1.0]]) / np.sqrt([[6.0], [2.0]])


@dataclass(frozen=True)
class UnequalAxes:
    """Noise that differs from axis to axis.

    Attributes
    ----------
    log_evidence : float, for unequal axes against equal ones, with nothing missing
    ratios : (3,) array, variances of the axes, posterior mean of log κ
    """

    log_evidence: float
    ratios: Array

    @classmethod
    def of(cls, residuals: Residuals, evidence: Evidence, within: Array | None) -> UnequalAxes:
        """Integrate over the ratios.

        Parameters
        ----------
        residuals : Residuals, of a fit with equal axes
        evidence : Evidence
        within : (3,) array, variances within the holds; None if unknown
        """
        x, y = (values.ravel() for values in np.meshgrid(LOG_RATIOS, LOG_RATIOS))
        logs = np.column_stack([x, y]) @ CONTRASTS
        determinant, squares = _restricted(residuals, np.exp(logs))
        densities = np.logaddexp.reduce(evidence.noise_density(squares, determinant), axis=-1)
        prior = _normal(x, y, np.zeros(3), RULES.spread_axes)
        if within is not None and np.all(within > 0):
            centre = np.log(within) - np.mean(np.log(within))
            prior = (prior + _normal(x, y, centre, RULES.spread_within)) / 2
        posterior = prior * np.exp(densities - densities.max())
        mean = posterior @ logs / posterior.sum()
        z = residuals.z
        nothing = float(np.logaddexp.reduce(evidence.noise_density(z @ z)))
        return cls(float(log_mean(densities, prior)) - nothing, np.exp(mean))


def _normal(x: Array, y: Array, centre: Array, spread: float) -> Array:
    """Normal density on the grid of contrasts, which sums to 1."""
    a, b = CONTRASTS @ centre
    density = np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * spread**2))
    return np.asarray(density / density.sum())


def _restricted(residuals: Residuals, ratios: Array) -> tuple[Array, Array]:
    """log|Nᵀ Σ N| and zᵀ (Nᵀ Σ N)⁻¹ z for variances (g, 3) of the axes, (g,) each.

    The ratios are taken in blocks, to save memory.
    """
    n, c = residuals.whitening.shape[:2]
    columns = np.column_stack([residuals.absorbed, residuals.z])
    blocks = columns[: n * c].reshape(n, c, -1)
    rest = columns[n * c :]
    beside = rest.T @ rest
    f = residuals.force_noise
    outer = np.einsum("nca,nda->nacd", f, f)
    determinants, squares = [], []
    for some in np.array_split(ratios, 1 + len(ratios) * blocks.size // AT_ONCE):
        covariance = np.eye(c) + np.einsum("ga,nacd->gncd", some - 1, outer)
        weighted = (np.linalg.inv(covariance) @ blocks).reshape(len(some), n * c, -1)
        normal = blocks.reshape(n * c, -1).T @ weighted + beside
        whole = np.sum(np.linalg.slogdet(covariance)[1], axis=1)
        determinant, square = restricted_to_residuals(whole, normal)
        determinants.append(determinant)
        squares.append(square)
    return np.concatenate(determinants), np.concatenate(squares)


LENGTHS = (1.0, 3.0, 8.0, np.inf)
"""Correlation lengths in holds; infinite for the random walk."""
STRENGTHS = (0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""Variances of the process, with white noise of 1, over which the evidence is averaged."""


def colour_densities(residuals: Residuals, evidence: Evidence) -> Array:
    """Log densities of residuals with coloured noise, (k,), by length; means over strengths."""
    determinant, squares = restricted_likelihood(residuals, STRENGTHS)
    logs = np.logaddexp.reduce(evidence.noise_density(squares, determinant), axis=-1)
    return log_mean(logs)


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
            kernel = np.where(lag < n, autocorrelation(lag, length), 0.0)
            forms.append(power @ (twice * np.fft.rfft(kernel).real))
        else:
            later = np.cumsum(v[..., ::-1, :], axis=-2)
            forms.append(np.sum(later**2, axis=(-2, -1)) / n)
    return np.stack(forms, axis=-1)


def restricted_likelihood(residuals: Residuals, strengths: Sequence[float]) -> tuple[Array, Array]:
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
    determinant, normal = _filter(residuals, columns[: n * c].reshape(n, c, -1), strengths)
    rest = columns[n * c :]  # observed gravity is no force
    return restricted_to_residuals(determinant, normal + rest.T @ rest)


def _filter(
    residuals: Residuals, columns: Array, strengths: Sequence[float]
) -> tuple[Array, Array]:
    """log|Σ|, (k, s), and Cᵀ Σ⁻¹ C, (k, s, v, v), of columns C (n, c, v), by a Kalman filter."""
    n, c, width = columns.shape
    lasting = np.array([autocorrelation(1.0, length) for length in LENGTHS])[:, None]
    walk = np.isinf(np.array(LENGTHS))[:, None]
    s = np.asarray(strengths, dtype=float)
    first = s * np.where(walk, 1 / n, 1.0)
    added = s * np.where(walk, 1 / n, innovation_variance(lasting))
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
