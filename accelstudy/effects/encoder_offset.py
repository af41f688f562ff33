"""Encoder offset: the robot's axes do not read zero at zero."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.components import ANGLES


@register
class EncoderOffset(Effect):
    """Zero offsets of the robot's roll and pitch."""

    name = "encoder_offset"
    family = "attitude of the rig"
    parameters = per_axis("c", "rad", "c_%", ANGLES)
    equation = "δφ = c_φ, δθ = c_θ"
    typical = (30e-6, 300e-6)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return (c_φ, c_θ)."""
        return p
