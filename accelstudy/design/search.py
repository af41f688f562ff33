"""The search for the best positions: exchange and refinement from several starts, then repeats."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.design.continuous import allowed, continuous_optimum
from accelstudy.design.criteria import Criterion
from accelstudy.design.exchange import Candidates, exchange
from accelstudy.design.refinement import FIRST_STEPS, STEPS, refine
from accelstudy.design.spaces import Constraints, Space, Sphere
from accelstudy.design.task import Task
from accelstudy.positions.choice import first_best, in_order

Array = NDArray[np.float64]

CANDIDATES = 600
STARTS = 8
REFINED = 3
"""Number of starts that are refined: the best ones after the exchange, which is cheap."""
PARTS = 10
"""Number of parts of a space that are searched in full."""
DIGITS = 9
"""Decimals of the directions, 1e-9 rad."""
TIED = 1e-6
"""Relative difference below which two designs are equally good, and the first one is taken."""


@dataclass(frozen=True, eq=False)
class Design:
    """Positions that were found.

    Attributes
    ----------
    directions : (n, 3) array of unit vectors, gravity in the body frame, to 9 decimals
    value : float, of the criterion
    bound : float, lower bound of the criterion; NaN if it is not wanted
    efficiency : float, against the bound; NaN without a bound
    """

    directions: Array
    value: float
    bound: float
    efficiency: float


def optimal_design(
    task: Task,
    criterion: Criterion,
    n: int,
    space: Space | None = None,
    constraints: Constraints | None = None,
    seed: int = 1,
    starts: int = STARTS,
    bounded: bool = True,
    rough: bool = False,
) -> Design:
    """Find the n positions that are best by a criterion.

    The same arguments give the same positions, on every processor.

    Parameters
    ----------
    task : Task
    criterion : Criterion
    n : int
    space : Space, optional; all attitudes by default
    constraints : Constraints, optional
    seed : int
    starts : int, random sets to begin with, of each part of the space
    bounded : bool, whether the bound, and with it the efficiency, is wanted
    rough : bool, whether positions near the best ones are enough

    Raises
    ------
    InputError
        If no attitude is allowed, the allowed ones do not determine the model, or are too few.
    """
    space, constraints = space or Sphere(), constraints or Constraints()
    everything = allowed(space, constraints, CANDIDATES)
    if not len(everything):
        raise InputError(f"no attitude is left of {space.text} with {_shown(constraints)}")
    _check_determined(task, criterion, everything, n)
    parts = space.parts(np.random.default_rng(np.random.SeedSequence([seed, 0])))
    if len(parts) > PARTS:  # the best ones after a single exchange
        tried = [_best(task, criterion, p, constraints, n, seed, 1, ()) for p in parts]
        parts = [parts[i] for i in in_order([value for _, value in tried], TIED)[:PARTS]]
    steps = FIRST_STEPS if rough else STEPS
    directions, _ = _first_best(
        [_best(task, criterion, part, constraints, n, seed, starts, steps) for part in parts]
    )
    directions = rounded(with_repeats(task, criterion, constraints, directions))
    value = float(criterion.value(task.normal(directions)))
    if reason := undetermined(task, criterion, directions):
        raise InputError(f"no {n} positions of {space.text} were found that suffice: {reason}")
    bound = efficiency = np.nan
    if bounded:
        best = continuous_optimum(task, criterion.convex, space, constraints, n)
        bound = criterion.bound(best.bound)
        efficiency = min(1.0, criterion.efficiency(value, bound))
    return Design(directions, value, bound, efficiency)


def _best(
    task: Task,
    criterion: Criterion,
    space: Space,
    constraints: Constraints,
    n: int,
    seed: int,
    starts: int,
    steps: Sequence[float],
) -> tuple[Array, float]:
    directions = allowed(space, constraints, CANDIDATES)
    if not len(directions):
        return np.zeros((n, 3)), np.inf
    informations = task.informations(directions)
    candidates = Candidates(directions, informations, task.prior, constraints)
    designs = []
    for start in range(1, starts + 1):
        rng = np.random.default_rng(np.random.SeedSequence([seed, start]))
        chosen = directions[exchange(candidates, candidates.random(n, rng), criterion)]
        designs.append((chosen, float(criterion.value(task.normal(chosen)))))
    order = in_order([value for _, value in designs], TIED)
    refined = [
        refine(task, criterion, space, constraints, designs[i][0], steps) for i in order[:REFINED]
    ]
    return _first_best([(u, float(criterion.value(task.normal(u)))) for u in refined])


def _first_best(designs: list[tuple[Array, float]]) -> tuple[Array, float]:
    """First of the designs that are equally good, so that rounding does not choose."""
    return designs[first_best([value for _, value in designs], TIED)]


def rounded(directions: Array) -> Array:
    """Directions as they are returned and as a file holds them."""
    return np.asarray(directions).round(DIGITS) + 0.0  # -0.0 becomes 0.0


def _check_determined(task: Task, criterion: Criterion, directions: Array, n: int) -> None:
    if reason := undetermined(task, criterion, directions):
        raise InputError(f"the allowed attitudes do not suffice: {reason}")
    rank_before = int(np.linalg.matrix_rank(task.prior))
    least = -(-(criterion.unknowns - rank_before) // task.approach.n_conditions)
    if n < least:
        raise InputError(
            f"{n} positions do not determine {criterion.unknowns} parameters; "
            f"at least {least} are needed"
        )


def undetermined(task: Task, criterion: Criterion, directions: Array) -> str:
    """Why positions do not determine what is wanted; empty if they do."""
    return task.missing(directions) or criterion.blind(task.normal(directions))


def _shown(constraints: Constraints) -> str:
    return ", ".join(constraints.texts) or "no constraints"


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
    near = cosines > np.cos(NEAR)
    if constraints.pair is not None or np.count_nonzero(near) == len(directions):
        return directions
    # Each position is in the group of the first one that is near it, by way of others, too.
    group, settled = np.arange(len(directions)), False
    while not settled:
        first = np.where(near, group, len(group)).min(axis=1)
        group, settled = first, bool(np.all(first == group))
    joined = directions.copy()
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        middle = first_best(-cosines[np.ix_(members, members)].sum(axis=1))
        joined[members] = directions[members[middle]]
    before, after = (float(criterion.value(task.normal(u))) for u in (directions, joined))
    return joined if after <= before + COST else directions
