"""Unequal axes: how probable it is that they differ in noise, and by how much.

The variances of the axes have the ratios κ, log κ_i summing to zero. Residuals alone say little of
them where the redundancy is small, so κ has a prior: about equal axes, within a factor of two or
so, and where the noise within the holds is known, about its ratios.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.noise.restricted import restricted_to_residuals
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

SPREAD = 0.7
"""Prior standard deviation of log κ about equal axes: a factor of two in variance is usual."""
AS_WITHIN = 0.35
"""Likewise about the ratios within the holds."""
AT_ONCE = 10_000_000
"""Numbers in one block of work, about."""
GRID = np.linspace(-2.5, 2.5, 9)
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
        x, y = (values.ravel() for values in np.meshgrid(GRID, GRID))
        logs = np.column_stack([x, y]) @ CONTRASTS
        determinant, squares = _restricted(residuals, np.exp(logs))
        densities = np.logaddexp.reduce(evidence.of_noise(squares, determinant), axis=-1)
        prior = _normal(x, y, np.zeros(3), SPREAD)
        if within is not None and np.all(within > 0):
            centre = np.log(within) - np.mean(np.log(within))
            prior = (prior + _normal(x, y, centre, AS_WITHIN)) / 2
        posterior = prior * np.exp(densities - densities.max())
        mean = posterior @ logs / posterior.sum()
        z = residuals.z
        nothing = float(np.logaddexp.reduce(evidence.of_noise(z @ z)))
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
    own = columns[: n * c].reshape(n, c, -1)
    rest = columns[n * c :]
    beside = rest.T @ rest
    f = residuals.force_noise
    outer = np.einsum("nca,nda->nacd", f, f)
    determinants, squares = [], []
    for some in np.array_split(ratios, 1 + len(ratios) * own.size // AT_ONCE):
        covariance = np.eye(c) + np.einsum("ga,nacd->gncd", some - 1, outer)
        weighted = (np.linalg.inv(covariance) @ own).reshape(len(some), n * c, -1)
        normal = own.reshape(n * c, -1).T @ weighted + beside
        whole = np.sum(np.linalg.slogdet(covariance)[1], axis=1)
        determinant, square = restricted_to_residuals(whole, normal)
        determinants.append(determinant)
        squares.append(square)
    return np.concatenate(determinants), np.concatenate(squares)
