"""Axis non-perpendicularity: the robot's roll and pitch axes are not at right angles."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class AxisNonPerpendicularity(Effect):
    """Roll error k tan θ of axes that are not perpendicular (the tilting-axis error)."""

    name = "axis_nonperpendicularity"
    family = "attitude of the rig"
    group = "robot_angles"
    parameters = (Parameter("k_perp", "rad", r"$k_\perp$"),)
    equation = "δφ = k tan θ"
    typical = (0.1e-3, 0.5e-3)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return (k tan θ, 0)."""
        (k,) = p
        return (k * xp.tan(angles[1]), 0)
