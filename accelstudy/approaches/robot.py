"""Robot-aided calibration: a robot also observes roll and pitch of every attitude."""

from accelstudy.approaches.base import Approach, register
from accelstudy.leveling.angles import specific_force


@register
class Robot(Approach):
    """Three conditions per position, f_b = f(φ_r, θ_r, g).

    They hold exactly where the three of Thalmann & Neuner (2018, eq. 10, with the sign of f_y
    corrected) hold, so the adjustment is the same; but in components they need no wrapping of roll
    residuals and stay regular where the x axis is vertical and roll has no meaning.
    """

    name = "robot"
    n_conditions = 3
    uses_angles = True

    def force(self, angles, g, xp):
        """Return f(φ_r, θ_r, g)."""
        return specific_force(angles[0], angles[1], g, xp)
