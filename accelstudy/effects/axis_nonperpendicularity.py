"""Axis non-perpendicularity: the robot's roll and pitch axes are not at right angles."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class AxisNonPerpendicularity(Effect):
    """Roll error k tan θ of axes that are not perpendicular (the tilting-axis error).

    It is written as a change of the force, which stays finite where the roll axis is vertical and
    tan θ does not.
    """

    name = "axis_nonperpendicularity"
    family = "attitude of the rig"
    parameters = (Parameter("k_perp", "rad", r"$k_\perp$"),)
    equation = "δφ = k tan θ"
    typical = (0.1e-3, 0.5e-3)
    part = "rig"

    def output(self, f, p, g, hold, xp):
        """Return k g sin θ [0, cos φ, −sin φ]ᵀ."""
        (k,) = p
        aside = k * g * xp.sin(hold.pitch)
        return (0, aside * xp.cos(hold.roll), -aside * xp.sin(hold.roll))
