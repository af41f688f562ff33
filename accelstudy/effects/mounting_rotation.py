"""Mounting rotation: the sensor is turned on the robot's flange."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.components import cross


@register
class MountingRotation(Effect):
    """Small rotation ε × f of the sensor against the flange whose tilt it measures."""

    name = "mounting_rotation"
    family = "alignment of the axes"
    parameters = per_axis("eps", "rad", "\\varepsilon_%")
    equation = "ε × f"
    typical = (2e-3, 17e-3)

    def output(self, f, p, g, hold, xp):
        """Return ε × f."""
        return cross(p, f)
