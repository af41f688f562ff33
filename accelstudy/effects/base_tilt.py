"""Base tilt: the robot's base is not level."""

from accelstudy.effects.base import Effect, Parameter, register


@register
class BaseTilt(Effect):
    """Tilt (a, b) of the robot's base: C(φ, θ, ψ) [a, b, 0]ᵀ g in the frame of the sensor.

    C turns the frame of the base into that of the flange; only a yaw ψ that varies tells the tilt
    from the zero offsets of the robot's encoders.
    """

    name = "base_tilt"
    family = "attitude of the rig"
    parameters = (Parameter("tilt_a", "rad", "$a$"), Parameter("tilt_b", "rad", "$b$"))
    equation = "C(φ, θ, ψ) [a, b, 0]ᵀ g"
    typical = (0.1e-3, 1e-3)
    part = "rig"

    def output(self, f, p, g, hold, xp):
        """Return C [a, b, 0]ᵀ g, with C = R_x(φ) R_y(θ) R_z(ψ) of frames."""
        a, b = p
        sin_r, cos_r = xp.sin(hold.roll), xp.cos(hold.roll)
        sin_p, cos_p = xp.sin(hold.pitch), xp.cos(hold.pitch)
        sin_y, cos_y = xp.sin(hold.yaw), xp.cos(hold.yaw)
        ahead = g * (a * cos_y + b * sin_y)
        aside = g * (b * cos_y - a * sin_y)
        return (
            cos_p * ahead,
            sin_r * sin_p * ahead + cos_r * aside,
            cos_r * sin_p * ahead - sin_r * aside,
        )
