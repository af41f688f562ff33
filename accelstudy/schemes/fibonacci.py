"""Any number of positions on the spherical Fibonacci lattice."""

import numpy as np

from accelstudy.schemes.registry import Array, register

GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@register(
    "fibonacci-N",
    title="Fibonacci",
    status="generated",
    source="González (2010), Math. Geosci. 42, 49-64",
    names=("fibonacci-24", "fibonacci-36", "fibonacci-50"),
)
def fibonacci(n: int) -> Array:
    """Points of a spiral about the x axis, evenly spread.

    The spiral keeps every position at least arccos(1 - 1/n) from the roll pole. It is not visited
    from end to end: f_x would fall in equal steps, and a linear drift of the x axis could not be
    told from its scale error.
    """
    index = np.arange(n)
    x = 1 - (2 * index + 1) / n
    return _shuffled(_spiral(x, GOLDEN_ANGLE * index))


@register(
    "antipodal-free-N",
    title="antipodal-free",
    status="generated",
    source="Fibonacci lattice on a hemisphere, every second point reflected",
    names=("antipodal-free-24",),
)
def antipodal_free(n: int) -> Array:
    """Evenly spread axes, each taken at one of its ends.

    Opposite positions tell the same about terms of even degree; without them n positions are n
    axes. The ends alternate along the spiral, so that both hemispheres are covered.
    """
    index = np.arange(n)
    x = 1 - (index + 0.5) / n
    sign = np.where(index % 2, -1.0, 1.0)[:, None]
    return _shuffled(sign * _spiral(x, GOLDEN_ANGLE * index))


def _spiral(x: Array, azimuth: Array) -> Array:
    radius = np.sqrt(1 - x**2)
    return np.column_stack([x, radius * np.sin(azimuth), radius * np.cos(azimuth)])


def _shuffled(directions: Array) -> Array:
    """The same order at any time: that of the multiples of √2 modulo 1, itself evenly spread."""
    return directions[np.argsort(np.arange(len(directions)) * np.sqrt(2) % 1)]
