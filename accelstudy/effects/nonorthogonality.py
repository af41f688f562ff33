"""Non-orthogonality: the three angles by which the sensitive axes are not at right angles."""

from accelstudy.effects.base import Effect, per_axis, register


@register
class NonOrthogonality(Effect):
    """Upper triangle of T (Thalmann & Neuner 2018, eq. 4); α_ij turns axis i around body axis j."""

    name = "nonorthogonality"
    family = "alignment of the axes"
    parameters = per_axis("alpha", "rad", r"\alpha_{%}", ("yz", "zy", "zx"))
    equation = "upper triangle of T"
    typical = (200e-6, 0.03)

    def axes(self, p, xp):
        """Return the upper triangle of eq. (4)."""
        yz, zy, zx = p
        return ((0, -yz, zy), (0, 0, -zx), (0, 0, 0))
