"""Encoder scale: the robot's angles are too large by a factor."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class EncoderScale(Effect):
    """Scale errors of the robot's roll and pitch."""

    name = "encoder_scale"
    family = "attitude of the rig"
    parameters = (
        Parameter("k_roll", "1", r"$k_\phi$"),
        Parameter("k_pitch", "1", r"$k_\theta$"),
    )
    equation = "δφ = k_φ φ, δθ = k_θ θ"
    typical = (20e-6, 200e-6)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return (k_φ φ, k_θ θ)."""
        return tuple(k * angle for k, angle in zip(p, angles, strict=True))
