"""Bias jump: the bias steps after a knock."""

from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, after, per_axis, register
from accelstudy.effects.step_times import step_times, times_between

MIN_HOLDS = 2
"""Holds on either side of a jump."""


@register
class BiasJump(Effect):
    """Bias step c for t > t_c; the time t_c is searched for between the holds."""

    name = "bias_jump"
    family = "sudden change"
    parameters = per_axis("c", "m/s^2", "c_%")
    takes = (Setting("t", "s", 600.0),)
    sudden = True
    equation = "c_i for t > t_c"
    typical = (0.005, 0.05)

    def output(self, f, p, g, hold, xp):
        """Return c where t > t_c."""
        jumped = after(hold.time, self.settings["t"], xp)
        return tuple(c * jumped for c in p)

    def candidates(self, hold, f, g):
        """Return times between the holds."""
        return tuple(BiasJump(t=t) for t in step_times(hold.column("time"), MIN_HOLDS))

    def between(self, other, hold):
        """Return some times between those of two candidates."""
        times = times_between(self.settings["t"], other.settings["t"], hold.column("time"))
        return tuple(BiasJump(t=t) for t in times)
