"""Bias jump: the bias steps after a knock."""

import numpy as np

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.registry import Hyper


@register
class BiasJump(Effect):
    """Bias step c for t > t_c; the time t_c is searched between the holds."""

    name = "bias_jump"
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
        times = np.unique(hold.column("time"))
        middles = (times[1:-2] + times[2:-1]) / 2 if len(times) > 3 else ()
        return tuple(BiasJump(t=float(f"{t:.9g}")) for t in middles)
