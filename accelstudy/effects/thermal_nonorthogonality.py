"""Thermal non-orthogonality: the angles between the sensitive axes depend on temperature."""

from accelstudy.effects.base import Effect, get_effect, per_axis, register
from accelstudy.effects.components import multiply
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE


@register
class ThermalNonOrthogonality(Effect):
    """Angles of the upper triangle of T (Thalmann & Neuner 2018, eq. 4) that grow with T − T0.

    T0 is 20 °C. A package that warms bends; its three dies turn against each other.
    """

    name = "thermal_nonorthogonality"
    family = "temperature"
    parameters = per_axis("alpha_T", "rad/K", r"\alpha_{T,%}", ("yz", "zy", "zx"))
    equation = "(T − T0) times the upper triangle of T"
    typical = (2e-6, 100e-6)

    def output(self, f, p, g, hold, xp):
        """Return the upper triangle of eq. (4), with angles α_T (T − T0), times f."""
        warmer = hold.temperature - REFERENCE_TEMPERATURE
        angles = tuple(alpha * warmer for alpha in p)
        return multiply(get_effect("nonorthogonality").axes(angles, xp), f)
