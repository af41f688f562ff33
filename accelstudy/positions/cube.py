"""Faces, edges and corners of a cube."""

from itertools import product

import numpy as np

from accelstudy.positions.scheme import Array


def faces() -> Array:
    """The sensor on each side of a cube, +z (level) first."""
    return cyclic_permutations(0, 0, 1)


def edges() -> Array:
    """The sensor on each edge of a cube: two axes share gravity."""
    return cyclic_permutations(0, 1, 1)


def corners() -> Array:
    """The sensor on each corner of a cube: three axes share gravity."""
    return cyclic_permutations(1, 1, 1)


def cyclic_permutations(x: float, y: float, z: float) -> Array:
    """All distinct points (±x, ±y, ±z), (±z, ±x, ±y) and (±y, ±z, ±x), shape (n, 3).

    A point and its antipode follow each other.
    """
    points: dict[tuple[float, ...], None] = {}  # a set that keeps the order
    for order in ((x, y, z), (z, x, y), (y, z, x)):
        for signs in product((1, -1), repeat=3):
            point = np.multiply(order, signs)
            points[tuple(point)] = points[tuple(-point)] = None
    return np.array(list(points))
