"""Full turns about each axis."""

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.schemes.registry import register


@register(
    "rings-24",
    title="on 3 rings",
    status="stand-in",
    source="three turns in steps of 45° for the 24 positions of Fong et al. (2008), "
    "Meas. Sci. Technol. 19, 085202",
)
def rings() -> Array:
    """A turn about x, one about y and one about z, in eight steps each.

    The first two start level. Every face comes twice, so the scheme has 18 distinct directions
    and repeats six of them.
    """
    r = np.sqrt(0.5)
    cos = np.array([1, r, 0, -r, -1, -r, 0, r])  # exact zeros, unlike cos(π/2)
    zero, sin = np.zeros(8), np.roll(cos, 2)
    turns = [(zero, sin, cos), (sin, zero, cos), (cos, sin, zero)]
    return np.vstack([np.column_stack(turn) for turn in turns])
