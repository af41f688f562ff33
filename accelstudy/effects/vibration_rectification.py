"""Vibration rectification: vibration shifts the mean output."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class VibrationRectification(Effect):
    """Vibration rectification error K σ_v² (IEEE Std 1293)."""

    name = "vibration_rectification"
    parameters = per_axis("K_vre", "s^2/m", "K_%")
    equation = "K_i σ_v²"
    typical = (1e-5, 1e-3)

    def output(self, f, p, g, hold, xp):
        """Return K σ_v²."""
        square = hold.vibration * hold.vibration
        return tuple(k * square for k in p)
