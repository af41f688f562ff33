"""Any number of positions on the spherical Fibonacci lattice."""

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.positions.points import GOLDEN_ANGLE, fibonacci, shuffle, spiral
from accelstudy.schemes.registry import register

register(
    "fibonacci-N",
    title="Fibonacci",
    status="generated",
    source="González (2010), Math. Geosci. 42, 49-64",
    names=("fibonacci-24", "fibonacci-36", "fibonacci-50"),
)(fibonacci)


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
    return shuffle(sign * spiral(x, GOLDEN_ANGLE * index))
