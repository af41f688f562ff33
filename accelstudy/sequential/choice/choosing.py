"""The gain of each candidate: for leveling or, while some are unknown, for the parameters.

A position with the whitened rows A turns the covariance Q of the parameters into
Q − Q Aᵀ (I + A Q Aᵀ)⁻¹ A Q. So the mean variance of roll and pitch, tr(W Q), falls by

    tr[(I + A Q Aᵀ)⁻¹ A Q W Q Aᵀ],

the I criterion (W is the quadratic form of `TiltError`). As long as some parameters are not
determined there is no Q. Then the log-determinant of the information counts (D criterion), with the
typical size in a cheap sensor as prior information of each parameter. It grows by
log det (I + A Q₀ Aᵀ), where Q₀ follows from the positions so far and these sizes.

Both are sequential designs of one step at a time: Fedorov (1972), Theory of optimal experiments,
chapter 4.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

ALIKE = 0.99
"""Candidates whose gain is above this fraction of the largest are equally good, and the first is
taken. So neither rounding nor noise decides, and simple attitudes can come first."""


def typical_sizes(model: SensorModel, unknowns: int) -> Array:
    """Sizes of the parameters in cheap equipment, (u',), SI; infinite for observed gravity."""
    sizes = [effect.typical[1] for effect in model.effects for _ in effect.parameters]
    return np.array([*sizes, *[np.inf] * (unknowns - len(sizes))])


def gain_of_parameters(root_information: Array, sizes: Array, rows: Array) -> Array:
    """Growth of the log-determinant of the information by each candidate.

    Parameters
    ----------
    root_information : (R, u, u) array, R with Q⁻¹ = RᵀR; it may be singular
    sizes : (u,) array, of the parameters in a cheap sensor
    rows : (k, c, u) array, of k candidates

    Returns
    -------
    (R, k) array
    """
    known = np.broadcast_to(np.diag(1 / sizes), root_information.shape)
    triangle = np.linalg.qr(np.concatenate([root_information, known], axis=1), mode="r")
    spread = _spread(np.linalg.inv(triangle), rows)
    return np.asarray(np.linalg.slogdet(_with_noise(spread))[1])


def gain_of_leveling(root_information: Array, weight: Array, rows: Array) -> Array:
    """Fall of the mean variance of roll and pitch by each candidate, at unit weight.

    Parameters
    ----------
    root_information : (R, u', u') array, R with Q⁻¹ = RᵀR, of full rank
    weight : (R, u, u) array, W; without gravity, even where that is estimated
    rows : (k, c, u) array, of k candidates

    Returns
    -------
    (R, k) array, rad²
    """
    root = np.linalg.inv(root_information)
    spread = _spread(root, rows)
    own = root[:, : weight.shape[-1]]
    seen = np.swapaxes(own, 1, 2) @ weight @ own
    part = spread @ seen[:, None] @ np.swapaxes(spread, -1, -2)
    return np.trace(np.linalg.solve(_with_noise(spread), part), axis1=-2, axis2=-1)


def best(gains: Array) -> NDArray[np.int_]:
    """First candidate of each session (R,) whose gain, of (R, k), is as good as the best."""
    return np.asarray(np.argmax(gains >= ALIKE * gains.max(axis=1, keepdims=True), axis=1))


def _spread(root: NDArray[np.floating], rows: Array) -> Array:
    """A R⁻¹, (R, k, c, u): A Q Aᵀ is its product with its transpose."""
    k, c, u = rows.shape
    return (rows.reshape(k * c, u) @ root).reshape(len(root), k, c, u)


def _with_noise(spread: Array) -> Array:
    """I + A Q Aᵀ, (R, k, c, c)."""
    return np.eye(spread.shape[2]) + spread @ np.swapaxes(spread, -1, -2)
