"""Gravity and rotations: what a flange on two joints and a yaw feels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s², at the place of all sessions


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
    along = np.cross(rotation, vectors)
    # sin(a)/a and (1 - cos(a))/a², which are regular at 0.
    back = np.cross(rotation, along)
    return vectors + np.sinc(2 * half) * along + np.sinc(half) ** 2 / 2 * back


def tilted(p: Array) -> Array:
    """Rotations (..., 3) by which the base sees g (a, b, −1) for g (0, 0, −1), of (a, b)."""
    return np.stack([p[..., 1], -p[..., 0], np.zeros(p.shape[:-1])], axis=-1)


def flange_force(
    joints: Array, yaw: Array | float, force: Array, skew: Array | float = 0.0
) -> Array:
    """Specific force in the frame of the flange, (..., 3), of one in the frame of the base.

    Parameters
    ----------
    joints : (..., 2) array, rad, roll and pitch
    yaw : (...) array, rad
    force : (..., 3) array, m/s²
    skew : (...) array, rad, by which the roll axis is turned about z against the pitch axis
    """
    turned = in_turned_frame(in_turned_frame(force, 2, yaw), 1, joints[..., 1])
    return in_turned_frame(in_turned_frame(turned, 2, skew), 0, joints[..., 0])


def level_force(joints: Array) -> Array:
    """Specific force in a flange at roll and pitch (..., 2) on a level base, (..., 3)."""
    return flange_force(joints, 0.0, GRAVITY * np.array([0.0, 0.0, -1.0]))


def joints_of(directions: Array) -> Array:
    """Roll and pitch of the directions of specific forces (n, 3), as (n, 2), rad."""
    x, y, z = directions.T + 0.0  # no negative zeros, for which roll would turn by half a turn
    return np.column_stack([np.arctan2(-y + 0.0, -z + 0.0), np.arctan2(x, np.hypot(y, z))])
