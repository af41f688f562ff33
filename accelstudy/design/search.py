"""The search for the best positions.

Positions are exchanged for better ones of a list of candidates (Fedorov 1972), from several random
sets. The best sets are refined by small moves until no move of one position makes the criterion
better, and positions that nearly coincide become repeats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.design.continuous import allowed, continuous_optimum
from accelstudy.design.criteria import Criterion
from accelstudy.design.spaces import Constraints, Space, Sphere
from accelstudy.design.task import Task
from accelstudy.positions.choice import CRITERION_TOLERANCE, first_best, in_order

Array = NDArray[np.float64]

CANDIDATES = 600
STARTS = 8
REFINED_STARTS = 3
"""Number of starts that are refined: the best ones after the exchange, which is cheap."""
PARTS = 10
"""Number of parts of a space that are searched in full."""
DIGITS = 9
"""Decimals of the directions, 1e-9 rad."""
DESIGN_TOLERANCE = 1e-6
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
    refined: bool = True,
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
    refined : bool, whether positions move between the candidates, which makes the variance some
        percent smaller, and takes most of the time

    Raises
    ------
    InputError
        If no attitude is allowed, the allowed ones do not determine the model, or are too few.
    """
    space, constraints = space or Sphere(), constraints or Constraints()
    everything = allowed(space, constraints, CANDIDATES)
    if not len(everything):
        limits = ", ".join(constraints.texts) or "no constraints"
        raise InputError(f"no attitude is left of {space.text} with {limits}")
    _check_determined(task, criterion, everything, n)
    search = _Search(task, criterion, constraints, n, seed)
    parts = space.parts(np.random.default_rng(np.random.SeedSequence([seed, 0])))
    if len(parts) > PARTS:  # the best ones after a single exchange
        tried = [search.best(part, 1, ()) for part in parts]
        parts = [
            parts[i] for i in in_order([value for _, value in tried], DESIGN_TOLERANCE)[:PARTS]
        ]
    found = [search.best(part, starts, STEPS if refined else ()) for part in parts]
    directions, _ = _first_best(found)
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


def rounded(directions: Array) -> Array:
    """Directions as they are returned and as a file holds them."""
    return np.asarray(directions).round(DIGITS) + 0.0  # -0.0 becomes 0.0


def undetermined(task: Task, criterion: Criterion, directions: Array) -> str:
    """Why positions do not determine what is wanted; empty if they do."""
    if reason := task.missing(directions):
        return reason
    information = task.information(directions)
    if any(information.undetermined(each.estimated).any() for each in criterion.estimators):
        return "they do not tell the two effects apart"
    return ""


def _check_determined(task: Task, criterion: Criterion, directions: Array, n: int) -> None:
    if reason := undetermined(task, criterion, directions):
        raise InputError(f"the allowed attitudes do not suffice: {reason}")
    unknown = max(len(each.estimated) for each in criterion.estimators)
    rank_before = int(np.linalg.matrix_rank(task.prior))
    least = -(-(unknown - rank_before) // task.approach.n_conditions)
    if n < least:
        raise InputError(
            f"{n} positions do not determine {unknown} parameters; at least {least} are needed"
        )


def _first_best(designs: list[tuple[Array, float]]) -> tuple[Array, float]:
    """First of the designs that are equally good, so that rounding does not choose."""
    return designs[first_best([value for _, value in designs], DESIGN_TOLERANCE)]


MAX_TRIED = 24
"""Number of places that are tried for a position, in the order in which the derivative of the
criterion ranks them: the KL exchange of Atkinson & Donev (1989)."""
LEAST_GAIN = 1e-9
"""Relative improvement below which a position is not exchanged."""
PRIOR_INFORMATION = 1e-6
"""Scaled information that is known of each parameter during an exchange. Where a choice does not
determine all parameters, rounding would decide without it."""
MAX_SWEEPS = 100
"""Most sweeps through all positions."""
DRAWS = 200
"""Number of random sets that are drawn to find one that keeps its distances."""
STEPS = tuple(0.081 / 3.0**k for k in range(5))
"""rad, widths of the grids on which positions move, one after the other; from half the distance of
the candidates to 0.06 gon. All move on grids, and a move must gain more than rounding can: so no
last digit decides where the search ends, as it would where a minimum is flat and derivatives are
followed."""
MIN_GAIN = 0.1
"""Smallest gain of a move, of the square of the step."""
FURTHER = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 16.0])
"""Times that the moves of two sweeps are repeated at once by all positions, if that is better."""


@dataclass(frozen=True)
class _Search:
    """The search for n positions of a task."""

    task: Task
    criterion: Criterion
    constraints: Constraints
    n: int
    seed: int

    def value(self, directions: Array) -> float:
        return float(self.criterion.value(self.task.normal(directions)))

    def best(self, space: Space, starts: int, steps: Sequence[float]) -> tuple[Array, float]:
        """Best positions of a part of the space, and their value."""
        candidates = allowed(space, self.constraints, CANDIDATES)
        if not len(candidates):
            return np.zeros((self.n, 3)), np.inf
        informations = self.task.informations(candidates)
        designs = []
        for start in range(1, starts + 1):
            rng = np.random.default_rng(np.random.SeedSequence([self.seed, start]))
            chosen = self.exchanged(candidates, informations, self.random(candidates, rng))
            designs.append((candidates[chosen], self.value(candidates[chosen])))
        order = in_order([value for _, value in designs], DESIGN_TOLERANCE)
        refined = []
        for i in order[:REFINED_STARTS]:
            directions = designs[i][0]
            for step in steps if space.tangents(directions).shape[2] else ():
                directions = self.settled(directions, step * space.tangents(directions), step)
            refined.append((directions, self.value(directions)))
        return _first_best(refined)

    def random(self, candidates: Array, rng: np.random.Generator) -> list[int]:
        """Draw n candidates that may stand together; `InputError` if so many do not fit."""
        most = 0
        for _ in range(DRAWS):
            chosen: list[int] = []
            free = np.ones(len(candidates), dtype=bool)
            while len(chosen) < self.n and free.any():
                chosen.append(int(rng.choice(np.flatnonzero(free))))
                free &= self.constraints.apart(candidates, candidates[chosen[-1:]])
            if len(chosen) == self.n:
                return chosen
            most = max(most, len(chosen))
        raise InputError(
            f"{self.n} positions {self.constraints.texts[-1]} were not found among the allowed "
            f"attitudes; {most} were"
        )

    def exchanged(self, candidates: Array, informations: Array, chosen: list[int]) -> list[int]:
        """Exchange positions until none can be exchanged for a better one."""
        flat = informations.reshape(len(candidates), -1)
        before = self.task.prior + PRIOR_INFORMATION * np.eye(len(self.task.prior))
        for _ in range(MAX_SWEEPS):
            # Computed anew, without the rounding of many exchanges.
            normal = before + informations[chosen].sum(axis=0)
            value, order = float(self.criterion.value(normal)), None
            first = value
            for i, old in enumerate(chosen):
                if order is None:  # the rank of the candidates, until a position is exchanged
                    rank = flat @ self.criterion.gradient(normal).ravel()
                    order = in_order(rank, CRITERION_TOLERANCE * float(np.abs(rank).max()))
                others = candidates[chosen[:i] + chosen[i + 1 :]]
                tried = order[self.constraints.apart(candidates, others)[order]][:MAX_TRIED]
                if not len(tried):
                    continue
                rest = normal - informations[old]
                values = self.criterion.value(rest + informations[tried])
                best = first_best(values)
                if values[best] < value - LEAST_GAIN:
                    chosen[i], value = int(tried[best]), float(values[best])
                    normal, order = rest + informations[chosen[i]], None
            if not value < first - LEAST_GAIN:
                break
        return chosen

    def settled(self, start: Array, tangents: Array, step: float) -> Array:
        """Positions of which none gains by a move of one step along its tangents (n, 3, d)."""

        def directions(t: Array) -> Array:
            """Positions (..., n, 3) after whole steps (..., n, d)."""
            moved = start + np.sum(tangents * t[..., None, :], axis=-1)
            return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))

        moves = np.array(list(product((0.0, -1.0, 1.0), repeat=tangents.shape[2])))
        t = before = np.zeros((self.n, moves.shape[1]))
        for _ in range(MAX_SWEEPS):
            moved = moves[self.swept(directions(t + moves[:, None, :]), MIN_GAIN * step**2)]
            if not moved.any():
                break
            tried = t + moved + FURTHER[:, None, None] * (t + moved - before)
            before = t + moved
            t = tried[self.furthest(directions(tried), MIN_GAIN * step**2)]
        return directions(t)

    def swept(self, around: Array, gain: float) -> NDArray[np.int_]:
        """Move each position in turn to the best of m places (m, n, 3); the places taken, (n,)."""
        m, n = around.shape[:2]
        flat = around.reshape(-1, 3)
        informations = self.task.informations(flat).reshape(m, n, *self.task.prior.shape)
        inside = self.constraints.allow(flat).reshape(m, n)
        changes = informations - informations[0]
        flat_changes = changes.reshape(m, n, -1)
        normal = self.task.prior + informations[0].sum(axis=0)
        value, taken = float(self.criterion.value(normal)), np.zeros(n, dtype=int)
        slope = self.criterion.gradient(normal).ravel()
        for i in range(n):
            # A convex criterion cannot fall by more than its derivative says.
            tried = np.flatnonzero(inside[:, i] & (flat_changes[:, i] @ slope < -gain))
            if len(tried) and self.constraints.least_angle is not None:
                others = np.delete(around[taken, np.arange(n)], i, axis=0)
                tried = tried[self.constraints.apart(around[tried, i], others)]
            if not len(tried):
                continue
            values = self.criterion.value(normal + changes[tried, i])
            best = first_best(values)
            if values[best] < value - gain:
                taken[i], value = tried[best], float(values[best])
                normal = normal + changes[taken[i], i]
                slope = self.criterion.gradient(normal).ravel()
        return taken

    def furthest(self, tried: Array, gain: float) -> int:
        """Index of the best of k sets (k, n, 3) that meet the constraints; 0 if none gains."""
        each = self.task.informations(tried.reshape(-1, 3)).reshape(*tried.shape[:2], -1)
        normals = self.task.prior + each.sum(axis=1).reshape(-1, *self.task.prior.shape)
        values = self.criterion.value(normals)
        values[[not self.constraints.met(directions) for directions in tried]] = np.inf
        best = first_best(values)
        return best if values[best] < values[0] - gain else 0


MAX_JOINED_ANGLE = 1 * GON
"""Angle up to which two positions may be joined."""
MAX_JOINING_LOSS = 1e-4
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
    near = cosines > np.cos(MAX_JOINED_ANGLE)
    if constraints.least_angle is not None or np.count_nonzero(near) == len(directions):
        return directions
    # A position that is near another one by way of others, too, is in its group.
    _, group = connected_components(near, directed=False)
    joined = directions.copy()
    for number in np.unique(group):
        members = np.flatnonzero(group == number)
        middle = first_best(-cosines[np.ix_(members, members)].sum(axis=1))
        joined[members] = directions[members[middle]]
    before, after = (float(criterion.value(task.normal(u))) for u in (directions, joined))
    return joined if after <= before + MAX_JOINING_LOSS else directions
