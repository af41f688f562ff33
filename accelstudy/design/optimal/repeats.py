"""One attitude, repeated, in place of several that hardly differ: it is easier to take."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from accelstudy.basics.units import GON
from accelstudy.design.optimal.constraints import Constraints
from accelstudy.design.optimal.criteria import Criterion
from accelstudy.design.optimal.task import Task

Array = NDArray[np.float64]

NEAR = 1 * GON
"""Angle up to which two positions may be one."""
COST = 1e-4
"""What the criterion, a logarithm, may lose by it."""


def with_repeats(
    task: Task, criterion: Criterion, constraints: Constraints, directions: Array
) -> Array:
    """Let positions that lie next to each other be one of them, repeated.

    A search ends with such positions where repeats are best, since nothing draws them together in
    the end.

    Parameters
    ----------
    task : Task
    criterion : Criterion
    constraints : Constraints, which `directions` keep; where they ask for a least angle, no
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
        middle = cosines[np.ix_(members, members)].sum(axis=1).argmax()
        joined[members] = directions[members[middle]]
    before, after = (float(criterion.value(task.normal(u))) for u in (directions, joined))
    return joined if after <= before + COST else directions
