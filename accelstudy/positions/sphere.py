"""Points that are spread evenly over the sphere."""

import numpy as np

from accelstudy.positions.scheme import Array, unit_vectors

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
    return shuffled(spiral(x, GOLDEN_ANGLE * index))


def spiral(x: Array, azimuth: Array) -> Array:
    """Points (n, 3) of the sphere at given x and angles about the x axis."""
    radius = np.sqrt(1 - x**2)
    return np.column_stack([x, radius * np.sin(azimuth), radius * np.cos(azimuth)])


def shuffled(directions: Array) -> Array:
    """Put directions in an order that follows no axis, the same at any time.

    It is the order of the multiples of √2 modulo 1, which are evenly spread themselves.
    """
    return directions[np.argsort(np.arange(len(directions)) * np.sqrt(2) % 1)]
