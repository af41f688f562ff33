"""Mounting slip: the sensor turns once on its mounting."""

from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, after, per_axis, register
from accelstudy.effects.step_times import step_times, times_between

MIN_HOLDS = 3
"""Holds on either side of a slip: two hardly show a rotation."""


@register
class MountingSlip(Effect):
    """Small rotation ε × f of the sensor on the flange for t > t_c.

    The time t_c is searched for between the holds; without times it is counted in holds from 1 on.
    """

    name = "mounting_slip"
    family = "sudden change"
    parameters = per_axis("slip", "rad", "\\varepsilon_{s%}")
    takes = (Setting("t", "s", 600.0),)
    sudden = True
    equation = "ε × f for t > t_c"
    typical = (80e-6, 3e-3)
    part = "rig"

    def output(self, f, p, g, hold, xp):
        """Return ε × f where t > t_c."""
        (x, y, z), (a, b, c) = f, p
        slipped = after(hold.order, self.settings["t"], xp)
        return (slipped * (b * z - c * y), slipped * (c * x - a * z), slipped * (a * y - b * x))

    def candidates(self, hold, f, g):
        """Return times between the holds."""
        return tuple(MountingSlip(t=t) for t in step_times(hold.column("order"), MIN_HOLDS))

    def between(self, other, hold):
        """Return some times between those of two candidates."""
        times = times_between(self.settings["t"], other.settings["t"], hold.column("order"))
        return tuple(MountingSlip(t=t) for t in times)
