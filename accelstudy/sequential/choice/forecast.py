"""How many more positions it takes, as far as that can be known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.estimability import rank_of
from accelstudy.sequential.choice.chooser import Chooser

Array = NDArray[np.float64]

MOST = 500
"""Largest number of further positions that is forecast."""


def positions_to_go(
    chooser: Chooser,
    root_information: Array,
    variance: float,
    redundancy: int,
    rms: Array,
    last: Array | None,
) -> int | None:
    """Number of positions, each the best next one, until the promise is kept; None beyond `MOST`.

    Parameters
    ----------
    chooser : Chooser
    root_information : (u', u') array, of the positions so far
    variance : float, of unit weight, assumed to stay as it is
    redundancy : int, so far
    rms : (2,) array, so far, rad
    last : (3,) array, direction of the last position; None before the first
    """
    root, rms = root_information[None], rms[None]
    u, c = root.shape[-1], chooser.rows.shape[1]
    last = None if last is None else last[None]
    solved = np.array([rank_of(root[0])[0] == u])
    for n in range(1, MOST + 1):
        chosen = chooser.choose(root, solved, rms, last)
        last = chooser.directions[chosen]
        more = np.concatenate([root, chooser.rows[chosen]], axis=1)
        root = np.asarray(np.linalg.qr(more, mode="r"))
        redundancy += c
        if not solved[0]:
            solved = np.array([rank_of(root[0])[0] == u])
        if solved[0]:
            rms = chooser.rms(root, np.array([variance * max(redundancy, 0)]), redundancy)
            if chooser.promise.reached(rms)[0]:
                return n
    return None
