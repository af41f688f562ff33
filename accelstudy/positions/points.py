"""Points that are spread evenly over the sphere, and those of a cube."""

from itertools import product

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.positions.scheme import unit_vectors

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


def evenly_spread(n: int) -> Array:
    """Unit vectors (n, 3) of the Fibonacci lattice."""
    return unit_vectors(fibonacci(n))


def fibonacci(n: int) -> Array:
    """Points of a spiral about the x axis, (n, 3), not quite of unit length.

    The spiral keeps every point at least arccos(1 - 1/n) from the roll pole. It is not visited
    from end to end: f_x would fall in equal steps, and a linear drift of the x axis could not be
    told from its scale error.
    """
    index = np.arange(n)
    x = 1 - (2 * index + 1) / n
    return shuffle(spiral(x, GOLDEN_ANGLE * index))


def spiral(x: Array, azimuth: Array) -> Array:
    """Points (n, 3) of the sphere at given x and angles about the x axis."""
    radius = np.sqrt(1 - x**2)
    return np.column_stack([x, radius * np.sin(azimuth), radius * np.cos(azimuth)])


def shuffle(directions: Array) -> Array:
    """Put directions in an order that follows no axis, the same at any time.

    It is the order of the multiples of √2 modulo 1, which are evenly spread themselves.
    """
    return directions[np.argsort(np.arange(len(directions)) * np.sqrt(2) % 1)]


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
