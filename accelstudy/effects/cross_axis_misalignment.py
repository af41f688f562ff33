"""Cross-axis misalignment: the three angles that only an outside attitude can see."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class CrossAxisMisalignment(Effect):
    """Lower triangle of T (Thalmann & Neuner 2018, eq. 3).

    Together with the non-orthogonality it holds a rotation of the whole triad, to which the norm of
    gravity is blind.
    """

    name = "cross_axis_misalignment"
    family = "alignment of the axes"
    parameters = per_axis("alpha", "rad", r"\alpha_{%}", ("xz", "xy", "yx"))
    equation = "lower triangle of T"
    typical = (1e-3, 0.02)

    def axes(self, p, xp):
        """Return the lower triangle of eq. (3)."""
        xz, xy, yx = p
        return ((0, 0, 0), (xz, 0, 0), (-xy, yx, 0))
