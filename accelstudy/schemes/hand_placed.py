"""Positions as a person makes them."""

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.schemes.registry import register

PLACEMENT_SD = np.radians(2.0)

SOURCE = (
    "random stand-in for hand-placed positions as of Pretto & Grisetti (2014) and "
    "Tedaldi et al. (2014)"
)


@register("random-N-SEED", title="hand placed, seed {1}", status="generated", source=SOURCE)
@register("random-N", title="hand placed", status="generated", source=SOURCE, names=("random-38",))
def hand_placed(n: int, seed: int = 0) -> Array:
    """Positions of a sensor in a block that is laid on a table and leant against things.

    Every other position, the first one included, is on a face of the block, off by a random tilt
    of 2° (standard deviation per axis); the six faces come in turn, each time in a new order. The
    positions between them are free, uniform over the sphere. The real log behind `xsens-38` is
    like that: 21 of its 38 holds are within 5° of a face, the others anywhere, and some
    attitudes are repeated.

    Parameters
    ----------
    n : int
        Number of positions.
    seed : int
        Seed of NumPy's SeedSequence.

    Returns
    -------
    ndarray, shape (n, 3)
        The directions, not normalised.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed))
    directions = rng.standard_normal((n, 3))
    n_faces = (n + 1) // 2
    sides = np.vstack([np.eye(3), -np.eye(3)])
    decks = [sides[rng.permutation(6)] for _ in range(0, n_faces, 6)]
    tilt = PLACEMENT_SD * rng.standard_normal((n_faces, 3))
    directions[::2] = np.vstack(decks)[:n_faces] + tilt
    return directions
