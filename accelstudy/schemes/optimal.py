"""Positions that minimise the variances of the nine parameters, or of leveling with them."""

import numpy as np

from accelstudy.positions.scheme import Array
from accelstudy.schemes.registry import register

MODEL = "bias-scale-nonorthogonality"


@register(
    "d-optimal-9",
    title="D-optimal",
    status="stand-in",
    source="extremal points of degree 2, Sloan & Womersley (2004), Adv. Comput. Math. 21, "
    "107-125, for the 9 positions of Zhang et al. (2010), Meas. Sci. Technol. 21, 015107",
)
def d_optimal_9() -> Array:
    """Nine positions for nine parameters, with the largest possible determinant; redundancy 0.

    They are a triangular prism with a cap on each side. With triangles of radius r and caps of
    radius 1 the determinant is proportional to (1-r)^5 (1+r)^9 r^8, which 11 r² - 2 r - 4 = 0
    maximises. A rotation does not change it: here the prism stands along x, 44° off the roll pole.
    """
    r = (1 + 3 * np.sqrt(5)) / 11
    x = np.sqrt(1 - r**2)
    angle = np.radians([0, 120, 240])
    triangle = np.column_stack([np.zeros(3), np.sin(angle), np.cos(angle)])
    return np.vstack([triangle, [x, 0, 0] - r * triangle, [-x, 0, 0] - r * triangle])


@register("d-optimal-N", title="D-optimal", status="generated", source="accelstudy.optimal")
def d_optimal(n: int) -> Array:
    """The n positions of the largest determinant for a calibration by the norm of gravity.

    From 16 positions on there are many such sets, all as good as the whole sphere.
    """
    return _optimal(n, "D")


@register("i-optimal-N", title="I-optimal", status="generated", source="accelstudy.optimal")
def i_optimal(n: int) -> Array:
    """The n positions after which roll and pitch are best, for tilts up to 50 gon.

    They are for a calibration by the norm of gravity; `accelstudy design` makes others.
    """
    return _optimal(n, "I")


def _optimal(n: int, criterion: str) -> Array:
    # Slow to import, and only these schemes need them.
    from accelstudy.approaches import get_approach
    from accelstudy.design.optimal.criteria import get_criterion
    from accelstudy.design.optimal.search import optimal_design
    from accelstudy.design.optimal.task import Task
    from accelstudy.sensors.models import get_model

    task = Task(get_model(MODEL), get_approach("gravity"))
    return optimal_design(task, get_criterion(criterion, task), n, bounded=False).directions
