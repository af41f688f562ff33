"""Mounting rotation: the sensor is turned on the robot's flange."""

from accelstudy.effects.base import Effect, per_axis, register


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
        (x, y, z), (a, b, c) = f, p
        return (b * z - c * y, c * x - a * z, a * y - b * x)
