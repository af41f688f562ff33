"""Cross-coupling: the output of an axis depends on products with the other two."""

from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.components import AXES


@register
class CrossCoupling(Effect):
    """Second-order cross-coupling k_ij f_i f_j/g, i ≠ j (Kip and Kio of IEEE Std 1293)."""

    name = "cross_coupling"
    family = "even nonlinearity"
    parameters = per_axis("k", "1", "k_{%}", [i + j for i in AXES for j in AXES if i != j])
    equation = "Σ k_ij f_i f_j / g, i ≠ j"
    typical = (50e-6, 500e-6)

    def output(self, f, p, g, hold, xp):
        """Return f_i (k_ij f_j + k_ik f_k) / g."""
        x, y, z = f
        xy, xz, yx, yz, zx, zy = p
        return (x * (xy * y + xz * z) / g, y * (yx * x + yz * z) / g, z * (zx * x + zy * y) / g)
