"""Bias jump: the bias steps after a knock."""

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects.base import Effect, Hold, per_axis, register
from accelstudy.registry import Hyper

ALL = 100
"""Times up to which all are searched."""
SOME = 50
"""Of more, times that are searched at first; what lies between is looked at where it matters."""
STEPS = 7
"""Times between two of them that are looked at next."""


@register
class BiasJump(Effect):
    """Bias step c for t > t_c; the time t_c is searched between the holds."""

    name = "bias_jump"
    family = "sudden change"
    group = "slow_time"
    parameters = per_axis("c", "m/s^2", "c_%")
    hypers = (Hyper("t", "s", 600.0),)
    equation = "c_i for t > t_c"
    typical = (0.005, 0.05)

    def output(self, f, p, g, hold, xp):
        """Return c where t > t_c."""
        sign = xp.sign(hold.time - self.shape["t"])
        after = (sign + xp.abs(sign)) / 2
        return tuple(c * after for c in p)

    def candidates(self, hold, f, g):
        """Return the middles between successive holds, two of which are on either side.

        A jump before the last hold is a single deviating hold by any other name.
        """
        middles = _middles(hold)
        return tuple(BiasJump(t=t) for t in middles[_spread(len(middles))])

    def between(self, other, hold):
        """Return some middles between the times of two candidates."""
        middles = _middles(hold)
        low, high = sorted((self.shape["t"], other.shape["t"]))
        left = middles[(middles > low) & (middles < high)]
        chosen = np.unique(np.linspace(0, len(left) - 1, STEPS).round().astype(int))
        return tuple(BiasJump(t=t) for t in left[chosen]) if len(left) else ()


def _middles(hold: Hold) -> NDArray[np.float64]:
    """Middles between successive holds, as they are written, (k,)."""
    times = np.unique(hold.column("time"))
    middles = (times[1:-2] + times[2:-1]) / 2 if len(times) > 3 else ()
    return np.array([float(f"{t:.9g}") for t in middles])


def _spread(count: int) -> NDArray[np.int_]:
    """Indices of all middles or, of very many, of some: the nearer to an end the closer."""
    if count <= ALL:
        return np.arange(count)
    part = np.geomspace(1, (count + 1) / 2, SOME // 2) - 1
    return np.unique(np.concatenate([part, count - 1 - part]).round().astype(int))
