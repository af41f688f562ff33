"""The circle that contains an error of two components with a given probability."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

Array = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
WIDTH = 9.0
"""Standard deviations beyond which the density is neglected."""
HALVINGS = 40
FLAT = 1e-6
"""No standard deviation is smaller than this part of the larger one, or of the mean error."""


def radius(covariance: ArrayLike, shift: ArrayLike, probability: float = 0.95) -> Array:
    """Radius of the circle about zero that contains a normal error with a probability.

    Parameters
    ----------
    covariance : (..., 2, 2) array, m²
    shift : (..., 2) array, m, mean of the error
    probability : float

    Returns
    -------
    (...) array, m, to about a millionth
    """
    covariance, shift = np.asarray(covariance, dtype=float), np.asarray(shift, dtype=float)
    variance, axes = np.linalg.eigh(covariance)
    mean = np.einsum("...ji,...j->...i", axes, shift)
    sigma = np.sqrt(np.maximum(variance, 0.0))
    tiny = np.finfo(float).tiny ** 0.25
    major = np.maximum(sigma[..., 1], FLAT * np.linalg.norm(shift, axis=-1) + tiny)
    sigma = np.stack([np.maximum(sigma[..., 0], FLAT * major), major], axis=-1)
    low = np.zeros(shift.shape[:-1])
    high = np.linalg.norm(mean, axis=-1) + WIDTH * np.hypot(sigma[..., 0], sigma[..., 1])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = _probability(middle, mean, sigma) < probability
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return (low + high) / 2


def _probability(r: Array, mean: Array, sigma: Array) -> Array:
    """Probability of a circle of radius r (...), with the errors along the axes of the ellipse."""
    (mean_1, mean_2), (sigma_1, sigma_2) = np.moveaxis(mean, -1, 0), np.moveaxis(sigma, -1, 0)
    # The larger component is integrated over the angle, which has no singular ends.
    start = np.arcsin(np.clip((mean_2 - WIDTH * sigma_2) / r, -1, 1))
    end = np.arcsin(np.clip((mean_2 + WIDTH * sigma_2) / r, -1, 1))
    angle = ((end + start)[..., None] + (end - start)[..., None] * NODES) / 2
    place, half = r[..., None] * np.sin(angle), r[..., None] * np.cos(angle)
    z = (place - mean_2[..., None]) / sigma_2[..., None]
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) / sigma_2[..., None] * half
    across = ndtr((half - mean_1[..., None]) / sigma_1[..., None])
    across -= ndtr((-half - mean_1[..., None]) / sigma_1[..., None])
    return np.sum(WEIGHTS * density * across, axis=-1) * (end - start) / 2
