"""Rotations of vectors, and of frames."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def in_turned_frame(vectors: Array, axis: int, angle: ArrayLike) -> Array:
    """Components of vectors (..., 3) in a frame that is turned about one of its axes.

    Parameters
    ----------
    vectors : (..., 3) array
    axis : int, 0, 1 or 2
    angle : (...) array, rad, right-handed
    """
    i, j = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = np.cos(angle), np.sin(angle)
    shape = np.broadcast_shapes(vectors.shape[:-1], np.shape(angle))
    turned = np.empty((*shape, 3))
    turned[..., axis] = vectors[..., axis]
    turned[..., i] = cos * vectors[..., i] + sin * vectors[..., j]
    turned[..., j] = cos * vectors[..., j] - sin * vectors[..., i]
    return turned


def rotated(vectors: Array, rotation: Array) -> Array:
    """Vectors (..., 3) rotated by rotation vectors (..., 3), rad (Rodrigues)."""
    vectors, rotation = np.broadcast_arrays(vectors, rotation)
    half = np.sqrt(np.sum(rotation**2, axis=-1, keepdims=True)) / (2 * np.pi)
    along = _cross(rotation, vectors)
    # sin(a)/a and (1 - cos(a))/a², which are regular at 0.
    return vectors + np.sinc(2 * half) * along + np.sinc(half) ** 2 / 2 * _cross(rotation, along)


def _cross(a: Array, b: Array) -> Array:
    product = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        product[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return product
