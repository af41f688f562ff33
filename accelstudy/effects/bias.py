"""Bias: the zero offset of each axis."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class Bias(Effect):
    """Additive offset b_i (Thalmann & Neuner 2018, eq. 1)."""

    name = "bias"
    parameters = per_axis("b", "m/s^2", "b_%")
    equation = "b_i"
    typical = (0.02, 0.5)

    def output(self, f, p, g, hold, xp):
        """Return b."""
        return p
