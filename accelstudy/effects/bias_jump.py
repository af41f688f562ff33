"""Bias jump: the bias steps after a knock."""

from accelstudy.effects.base import per_axis, register
from accelstudy.effects.sudden import SuddenEffect


@register
class BiasJump(SuddenEffect):
    """Bias step c for t > t_c; the time t_c is searched for between the holds."""

    name = "bias_jump"
    parameters = per_axis("c", "m/s^2", "c_%")
    equation = "c_i for t > t_c"
    typical = (0.005, 0.05)
    clock = "time"
    min_holds = 2

    def output(self, f, p, g, hold, xp):
        """Return c where t > t_c."""
        begun = self.begun(hold, xp)
        return tuple(c * begun for c in p)
