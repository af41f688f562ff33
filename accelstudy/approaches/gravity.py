"""Gravity-based calibration: the norm of the calibrated force is g in every attitude."""

from accelstudy.approaches.base import Approach, register


@register
class Gravity(Approach):
    """One condition per position, |f_b| − g = 0 (Thalmann & Neuner 2018, eq. 9)."""

    name = "gravity"
    n_conditions = 1
    uses_angles = False

    def conditions(self, f, angles, g, xp):
        """Return |f_b| − g."""
        x, y, z = f
        return (xp.sqrt(x * x + y * y + z * z) - g,)
