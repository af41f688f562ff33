"""Scale: the linear scale-factor error of each axis."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class Scale(Effect):
    """Scale error s_i, S = diag(1 + s) (Thalmann & Neuner 2018, eq. 1 and 2)."""

    name = "scale"
    family = "linear scale"
    parameters = per_axis("s", "1", "s_%")
    equation = "s_i f_i"
    typical = (300e-6, 0.03)

    def output(self, f, p, g, hold, xp):
        """Return s_i f_i."""
        return tuple(s * f_i for s, f_i in zip(p, f, strict=True))
