"""Mounting slip: the sensor turns once on its mounting."""

from accelstudy.effects.base import per_axis, register
from accelstudy.effects.components import cross
from accelstudy.effects.sudden import SuddenEffect


@register
class MountingSlip(SuddenEffect):
    """Small rotation ε × f of the sensor on the flange for t > t_c.

    The time t_c is searched for between the holds; without times it is counted in holds from 1 on.
    """

    name = "mounting_slip"
    parameters = per_axis("slip", "rad", "\\varepsilon_{s%}")
    equation = "ε × f for t > t_c"
    typical = (80e-6, 3e-3)
    part = "rig"
    clock = "order"
    min_holds = 3  # two hardly show a rotation

    def output(self, f, p, g, hold, xp):
        """Return ε × f where t > t_c."""
        begun = self.begun(hold, xp)
        return tuple(begun * moved for moved in cross(p, f))
