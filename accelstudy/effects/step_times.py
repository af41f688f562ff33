"""Times between two holds at which something may have happened once."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MAX_TIMES = 100
"""Number of times up to which all are tried."""
FIRST_TIMES = 50
"""Of more times, number of those tried at first; times between them follow where it matters."""
NEXT_TIMES = 7
"""Number of times that are tried next between two of them."""


def step_times(when: Array, least: int) -> Array:
    """Times (k,) between holds that are tried at first.

    Parameters
    ----------
    when : (n,) array, of the holds
    least : int, holds on either side; a step with fewer cannot be told from bumped holds
    """
    middles = _middles(when, least)
    return middles[_spread(len(middles))]


def times_between(low: float, high: float, when: Array) -> Array:
    """Return some (k,) of the times that were skipped between two times, in either order."""
    middles = _middles(when, 1)
    left = middles[(middles > min(low, high)) & (middles < max(low, high))]
    if not len(left):
        return left
    return left[np.unique(np.linspace(0, len(left) - 1, NEXT_TIMES).round().astype(int))]


def _middles(when: Array, least: int) -> Array:
    """Middles (k,) between successive holds with at least so many on either side, rounded."""
    times = np.unique(when)
    middles = (times[:-1] + times[1:]) / 2
    return np.array([float(f"{t:.9g}") for t in middles[least - 1 : len(times) - least]])


def _spread(count: int) -> NDArray[np.int_]:
    """Indices of all middles or, of very many, of some, which lie closer together near the ends."""
    if count <= MAX_TIMES:
        return np.arange(count)
    part = np.geomspace(1, (count + 1) / 2, FIRST_TIMES // 2) - 1
    return np.unique(np.concatenate([part, count - 1 - part]).round().astype(int))
