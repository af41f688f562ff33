"""Thermal bias: the zero offset depends on temperature."""

from accelstudy.effects.base import REFERENCE_TEMPERATURE, Effect, per_axis, register


@register
class ThermalBias(Effect):
    """Bias temperature sensitivity b_T (T − T0), T0 = 20 °C (IEEE Std 1293)."""

    name = "thermal_bias"
    family = "temperature"
    group = "temperature"
    parameters = per_axis("b_T", "m/s^2/K", "b_{T%}")
    equation = "b_T,i (T − T0)"
    typical = (0.5e-3, 7e-3)

    def output(self, f, p, g, hold, xp):
        """Return b_T (T − T0)."""
        return tuple(b * (hold.temperature - REFERENCE_TEMPERATURE) for b in p)
