"""Bias drift: the bias changes linearly with time."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class BiasDrift(Effect):
    """Linear bias drift d t."""

    name = "bias_drift"
    family = "slow change in time"
    parameters = per_axis("d", "m/s^2/s", "d_%")
    equation = "d_i t"
    typical = (0.3e-6, 3e-6)
    drifts = True

    def output(self, f, p, g, hold, xp):
        """Return d t."""
        return tuple(d * hold.time for d in p)
