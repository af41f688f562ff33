"""Scale asymmetry: the scale factor differs between positive and negative input."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class ScaleAsymmetry(Effect):
    """Scale-factor asymmetry k_i |f_i| (IEEE Std 1293)."""

    name = "scale_asymmetry"
    family = "even nonlinearity"
    parameters = per_axis("k_abs", "1", "k_{\\pm %}")
    equation = "k_i |f_i|"
    typical = (100e-6, 500e-6)

    def output(self, f, p, g, hold, xp):
        """Return k_i |f_i|."""
        return tuple(k * xp.abs(f_i) for k, f_i in zip(p, f, strict=True))
