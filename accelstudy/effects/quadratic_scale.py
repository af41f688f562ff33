"""Quadratic scale: the second-order nonlinearity of each axis."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class QuadraticScale(Effect):
    """Second-order nonlinearity k_i f_i²/g (K2 of IEEE Std 1293, in units of g)."""

    name = "quadratic_scale"
    family = "even nonlinearity"
    parameters = per_axis("k2", "1", "k_{2%}")
    equation = "k_i f_i² / g"
    typical = (100e-6, 2500e-6)

    def output(self, f, p, g, hold, xp):
        """Return k_i f_i² / g."""
        return tuple(k * f_i * f_i / g for k, f_i in zip(p, f, strict=True))
