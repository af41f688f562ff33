"""McLaren's spherical design of 24 points."""

from itertools import permutations, product

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.schemes.polyhedra import generic
from accelstudy.schemes.registry import register


@register(
    "mclaren-24",
    title="McLaren",
    status="stand-in",
    source="7-design of McLaren (1963), Math. Comp. 17, 361-383, see Hardin & Sloane (1996), "
    "Discrete Comput. Geom. 15, 429-441; for the 24 positions of Cai et al. (2013), Meas. "
    "Sci. Technol. 24, 105002, which are not public",
)
def mclaren() -> Array:
    """The 7-design in a generic orientation, in which cubic terms can be estimated.

    Its moments match those of the sphere through degree 7, and no position is opposite to
    another. The nearest x pole is 13.8° away.
    """
    return generic(mclaren_orbit())


def mclaren_orbit() -> Array:
    """Images of one point under the 24 rotations of the cube, aligned with its axes.

    The squared coordinates of the point are the roots of 105 t³ - 105 t² + 21 t - 1.
    """
    point = np.sqrt(np.sort(np.roots([105, -105, 21, -1]).real))
    matrices = (
        np.eye(3)[list(order)] * signs
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
    )
    return np.array([matrix @ point for matrix in matrices if np.linalg.det(matrix) > 0])
