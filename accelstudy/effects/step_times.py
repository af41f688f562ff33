"""When something can have happened once, between two holds."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ALL = 100
"""Times up to which all are searched."""
SOME = 50
"""Of more, times that are searched at first; what lies between is looked at where it matters."""
STEPS = 7
"""Times between two of them that are looked at next."""


def step_times(when: Array, least: int) -> Array:
    """Times (k,) between holds that are searched at first.

    Parameters
    ----------
    when : (n,) array, of the holds
    least : int, holds on either side; fewer that deviate are so many bumped holds by another name
    """
    middles = _middles(when, least)
    return middles[_spread(len(middles))]


def times_between(low: float, high: float, when: Array) -> Array:
    """Return some (k,) of those that were passed over between two times, in either order."""
    middles = _middles(when, 1)
    left = middles[(middles > min(low, high)) & (middles < max(low, high))]
    if not len(left):
        return left
    return left[np.unique(np.linspace(0, len(left) - 1, STEPS).round().astype(int))]


def _middles(when: Array, least: int) -> Array:
    """Middles between successive holds, with so many on either side, as they are written, (k,)."""
    times = np.unique(when)
    middles = (times[:-1] + times[1:]) / 2
    return np.array([float(f"{t:.9g}") for t in middles[least - 1 : len(times) - least]])


def _spread(count: int) -> NDArray[np.int_]:
    """Indices of all middles or, of very many, of some: the nearer to an end the closer."""
    if count <= ALL:
        return np.arange(count)
    part = np.geomspace(1, (count + 1) / 2, SOME // 2) - 1
    return np.unique(np.concatenate([part, count - 1 - part]).round().astype(int))
