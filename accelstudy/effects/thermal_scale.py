"""Thermal scale: the scale factor depends on temperature."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE


@register
class ThermalScale(Effect):
    """Scale-factor temperature sensitivity s_T (T − T0) f_i, T0 = 20 °C (IEEE Std 1293)."""

    name = "thermal_scale"
    family = "temperature"
    parameters = per_axis("s_T", "1/K", "s_{T%}")
    equation = "s_T,i (T − T0) f_i"
    typical = (10e-6, 200e-6)

    def output(self, f, p, g, hold, xp):
        """Return s_T (T − T0) f_i."""
        warmer = hold.temperature - REFERENCE_TEMPERATURE
        return tuple(s * warmer * f_i for s, f_i in zip(p, f, strict=True))
