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


def step_times(when: Array) -> Array:
    """Times (k,) that are searched at first: between holds, at least two of them on either side.

    What happens before the last hold alone is a single deviating hold by any other name.

    Parameters
    ----------
    when : (n,) array, of the holds
    """
    middles = _middles(when)
    return middles[_spread(len(middles))]


def times_between(low: float, high: float, when: Array) -> Array:
    """Return some (k,) of those that were passed over between two times, in either order."""
    middles = _middles(when)
    left = middles[(middles > min(low, high)) & (middles < max(low, high))]
    if not len(left):
        return left
    return left[np.unique(np.linspace(0, len(left) - 1, STEPS).round().astype(int))]


def _middles(when: Array) -> Array:
    """Middles between successive holds, as they are written, (k,)."""
    times = np.unique(when)
    middles = (times[1:-2] + times[2:-1]) / 2 if len(times) > 3 else ()
    return np.array([float(f"{t:.9g}") for t in middles])


def _spread(count: int) -> NDArray[np.int_]:
    """Indices of all middles or, of very many, of some: the nearer to an end the closer."""
    if count <= ALL:
        return np.arange(count)
    part = np.geomspace(1, (count + 1) / 2, SOME // 2) - 1
    return np.unique(np.concatenate([part, count - 1 - part]).round().astype(int))
