"""Encoder offset: the robot's axes do not read zero at zero."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class EncoderOffset(Effect):
    """Zero offsets of the robot's roll and pitch."""

    name = "encoder_offset"
    family = "attitude of the rig"
    parameters = (
        Parameter("c_roll", "rad", r"$c_\phi$"),
        Parameter("c_pitch", "rad", r"$c_\theta$"),
    )
    equation = "δφ = c_φ, δθ = c_θ"
    typical = (30e-6, 300e-6)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return (c_φ, c_θ)."""
        return p
