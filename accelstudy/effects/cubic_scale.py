"""Cubic scale: the third-order nonlinearity of each axis."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class CubicScale(Effect):
    """Third-order nonlinearity k_i f_i³/g² (K3 of IEEE Std 1293, in units of g²)."""

    name = "cubic_scale"
    family = "odd nonlinearity"
    parameters = per_axis("k3", "1", "k_{3%}")
    equation = "k_i f_i³ / g²"
    typical = (100e-6, 1000e-6)

    def output(self, f, p, g, hold, xp):
        """Return k_i f_i³ / g²."""
        return tuple(k * f_i * f_i * f_i / (g * g) for k, f_i in zip(p, f, strict=True))
