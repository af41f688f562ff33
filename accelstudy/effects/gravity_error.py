"""Gravity error: the value of gravity is wrong."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class GravityError(Effect):
    """A value of gravity that is wrong by δg makes all forces too large by δg f/g.

    It is a common scale factor to either approach, and no calibration can tell the two apart.
    """

    name = "gravity_error"
    family = "linear scale"
    parameters = (Parameter("delta_g", "m/s^2", r"$\delta g$"),)
    equation = "δg f / g"
    typical = (1e-4, 27e-3)
    part = "rig"

    def output(self, f, p, g, hold, xp):
        """Return δg f/g."""
        (error,) = p
        return tuple(error * f_i / g for f_i in f)
