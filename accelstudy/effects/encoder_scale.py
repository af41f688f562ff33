"""Encoder scale: the robot's angles are too large by a factor."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.components import ANGLES


@register
class EncoderScale(Effect):
    """Scale errors of the robot's roll and pitch."""

    name = "encoder_scale"
    family = "attitude of the rig"
    parameters = per_axis("k", "1", "k_%", ANGLES)
    equation = "δφ = k_φ φ, δθ = k_θ θ"
    typical = (20e-6, 200e-6)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return (k_φ φ, k_θ θ)."""
        return tuple(k * angle for k, angle in zip(p, angles, strict=True))
