"""Encoder eccentricity: an angular error that repeats with each turn."""

from accelstudy.basics.registry import Setting
from accelstudy.effects.base import Effect, Parameter, register


@register
class EncoderEccentricity(Effect):
    """Harmonic A sin mφ + B cos mφ of each encoder, m = 1 for a disk off its axis.

    The order m is searched for: a tilted disk or two reading heads leave the second harmonic.
    """

    name = "encoder_eccentricity"
    family = "attitude of the rig"
    parameters = (
        Parameter("A_roll", "rad", r"$A_\phi$"),
        Parameter("B_roll", "rad", r"$B_\phi$"),
        Parameter("A_pitch", "rad", r"$A_\theta$"),
        Parameter("B_pitch", "rad", r"$B_\theta$"),
    )
    takes = (Setting("order", "1", 1.0, above=0),)
    equation = "δφ = A_φ sin mφ + B_φ cos mφ, same in θ"
    typical = (15e-6, 300e-6)
    part = "rig"

    def reading(self, angles, p, hold, xp):
        """Return A sin mφ + B cos mφ of either angle."""
        order = self.settings["order"]
        roll, pitch = (order * angle for angle in angles)
        return (
            p[0] * xp.sin(roll) + p[1] * xp.cos(roll),
            p[2] * xp.sin(pitch) + p[3] * xp.cos(pitch),
        )

    def candidates(self, hold, f, g):
        """Return the first two harmonics."""
        return (EncoderEccentricity(order=1.0), EncoderEccentricity(order=2.0))
