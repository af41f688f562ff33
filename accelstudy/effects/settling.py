"""Settling: part of the step from the previous position is still there."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class Settling(Effect):
    """Low-pass or settling tail k (f_prev − f)."""

    name = "settling"
    family = "memory of the previous position"
    parameters = (Parameter("k_settling", "1", "$k_{set}$"),)
    equation = "k (f_prev − f)"
    typical = (10e-6, 1000e-6)

    def output(self, f, p, g, hold, xp):
        """Return k (f_prev − f)."""
        (k,) = p
        return (-k * hold.step_x, -k * hold.step_y, -k * hold.step_z)
