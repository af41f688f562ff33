"""A new effect: a ripple of the converter that turns volts into numbers."""

# --8<-- [start:effect]
import math

from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, per_axis, register


@register
class Ripple(Effect):
    """Ripple a_i sin(2π f_i / P) of the analogue-to-digital converter, with the period P."""

    name = "ripple"
    family = "odd nonlinearity"
    parameters = per_axis("a_ripple", "m/s^2", "a_%")
    takes = (Setting("period", "m/s^2", 8.0, above=0, smooth=True),)
    equation = "a_i sin(2π f_i / P)"
    typical = (0.001, 0.01)

    def output(self, f, p, g, hold, xp):
        """Return a sin(2π f / P)."""
        wave = 2 * math.pi / self.settings["period"]
        return tuple(a * xp.sin(wave * f_i) for a, f_i in zip(p, f, strict=True))

    def candidates(self, hold, f, g):
        """Return periods that are worth a search: some waves within ±g, and not too many."""
        return tuple(Ripple(period=period) for period in (3.0, 4.0, 5.0, 6.5, 8.0))


# --8<-- [end:effect]
