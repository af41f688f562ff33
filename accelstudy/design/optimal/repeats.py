"""Repeat one attitude instead of taking several that hardly differ: that is easier to measure."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from accelstudy.basics.units import GON
from accelstudy.design.optimal.constraints import Constraints
from accelstudy.design.optimal.criteria import Criterion
from accelstudy.design.optimal.task import Task
from accelstudy.positions.choice import first_best

Array = NDArray[np.float64]

NEAR = 1 * GON
"""Angle up to which two positions may be joined."""
COST = 1e-4
"""Largest loss of the criterion, a logarithm, by joining."""


def with_repeats(
    task: Task, criterion: Criterion, constraints: Constraints, directions: Array
) -> Array:
    """Replace positions that lie close together by one of them, repeated.

    Where repeats are best, a search ends with such positions: near the optimum nothing draws them
    together completely.

    Parameters
    ----------
    task : Task
    criterion : Criterion
    constraints : Constraints, which `directions` meet; where they ask for a least angle, no
        positions are joined
    directions : (n, 3) array of unit vectors

    Returns
    -------
    (n, 3) array of unit vectors, all of them among `directions`
    """
    cosines = directions @ directions.T
    count, group = connected_components(cosines > np.cos(NEAR), directed=False)
    if constraints.pair is not None or count == len(directions):
        return directions
    joined = directions.copy()
    for i in range(count):
        members = np.flatnonzero(group == i)
        middle = first_best(-cosines[np.ix_(members, members)].sum(axis=1))
        joined[members] = directions[members[middle]]
    before, after = (float(criterion.value(task.normal(u))) for u in (directions, joined))
    return joined if after <= before + COST else directions
