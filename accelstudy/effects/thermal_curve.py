"""Thermal curve: the zero offset is no linear function of temperature."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE


@register
class ThermalCurve(Effect):
    """Second-order bias temperature sensitivity b_TT (T − T0)², T0 = 20 °C (IEEE Std 1293)."""

    name = "thermal_curve"
    family = "temperature"
    parameters = per_axis("b_TT", "m/s^2/K^2", "b_{TT%}")
    equation = "b_TT,i (T − T0)²"
    typical = (0.1e-3, 0.5e-3)

    def output(self, f, p, g, hold, xp):
        """Return b_TT (T − T0)²."""
        warmer = hold.temperature - REFERENCE_TEMPERATURE
        return tuple(b * warmer * warmer for b in p)
