"""Hysteresis: the output depends on the direction from which a force was reached."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class Hysteresis(Effect):
    """Output hysteresis h sign(f − f_prev) (IEEE Std 1293)."""

    name = "hysteresis"
    family = "memory of the previous position"
    parameters = per_axis("h", "m/s^2", "h_%")
    equation = "h_i sign(f_i − f_prev,i)"
    typical = (0.5e-3, 5e-3)

    def output(self, f, p, g, hold, xp):
        """Return h sign(f − f_prev)."""
        steps = (hold.step_x, hold.step_y, hold.step_z)
        return tuple(h * xp.sign(step) for h, step in zip(p, steps, strict=True))
