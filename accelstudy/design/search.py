"""The search for the best positions.

Positions are exchanged for better ones of a list of candidates (Fedorov 1972), from several random
sets. The best sets are refined by small moves until no move of one position makes the criterion
better, and positions that nearly coincide become repeats.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.design.continuous import allowed, continuous_optimum
from accelstudy.design.criteria import Criterion
from accelstudy.design.spaces import Constraints, Space, Sphere
from accelstudy.design.task import Task
from accelstudy.positions.choice import CRITERION_TOLERANCE, first_best, stable_order

Array = NDArray[np.float64]

CANDIDATES = 600
STARTS = 8
REFINED_STARTS = 3
"""Number of starts that are refined: the best ones after the exchange, which is cheap."""
PARTS = 10
"""Number of parts of a space that are searched in full."""
DRAWS = 200
"""Number of random sets that are drawn to find one that keeps its distances."""
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
STEPS = tuple(0.081 / 3.0**k for k in range(5))
"""rad, widths of the grids on which positions move, one after the other; from half the distance of
the candidates to 0.06 gon. All move on grids, and a move must gain more than rounding can: so no
last digit decides where the search ends, as it would where a minimum is flat and derivatives are
followed."""
MIN_GAIN = 0.1
"""Smallest gain of a move, of the square of the step."""
FURTHER = np.array([0.0, 1.0, 2.0, 4.0, 8.0, 16.0])
"""Times that the moves of two sweeps are repeated at once by all positions, if that is better."""
MAX_JOINED_ANGLE = 1 * GON
"""Angle up to which two positions may be joined."""
MAX_JOINING_LOSS = 1e-4
"""Largest loss of the criterion, a logarithm, by joining."""
DIGITS = 9
"""Decimals of the directions, 1e-9 rad."""
DESIGN_TOLERANCE = 1e-6
"""Relative difference below which two designs are equally good, and the first one is taken."""


@dataclass(frozen=True, eq=False)
class Optimum:
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
    bound: float = np.nan
    efficiency: float = np.nan


@dataclass(frozen=True)
class Search:
    """The search for the n positions that are best by a criterion.

    The same search finds the same positions, on every processor.

    Attributes
    ----------
    task : Task
    criterion : Criterion
    n : int
    space : Space
    constraints : Constraints
    seed : int
    """

    task: Task
    criterion: Criterion
    n: int
    space: Space = field(default_factory=Sphere)
    constraints: Constraints = field(default_factory=Constraints)
    seed: int = 1

    def optimum(self, starts: int = STARTS, bounded: bool = True) -> Optimum:
        """Find the positions.

        Parameters
        ----------
        starts : int, random sets to begin with, of each part of the space
        bounded : bool, whether the bound, and with it the efficiency, is wanted

        Raises
        ------
        InputError
            If no attitude is allowed, the allowed ones do not determine the model, or are too few.
        """
        self._check()
        parts = self.space.parts(np.random.default_rng(np.random.SeedSequence([self.seed, 0])))
        searches = [replace(self, space=part) for part in parts]
        searches = [search for search in searches if len(search.candidates)]
        if len(searches) > PARTS:
            tried = [search.value(search.exchange(1)) for search in searches]
            searches = [searches[i] for i in stable_order(tried, DESIGN_TOLERANCE)[:PARTS]]
        return self.finish(self._best([search._refine(starts) for search in searches]), bounded)

    def exchange(self, start: int) -> Array:
        """Candidates of which none can be exchanged for a better one, from a random set; (n, 3)."""
        before = self.task.prior + PRIOR_INFORMATION * np.eye(len(self.task.prior))
        informations = self._informations
        flat, chosen = informations.reshape(len(informations), -1), self._random(start)
        for _ in range(MAX_SWEEPS):
            # Computed anew, without the rounding of many exchanges.
            normal = before + informations[chosen].sum(axis=0)
            value, order = float(self.criterion.value(normal)), None
            first = value
            for i, old in enumerate(chosen):
                if order is None:  # the rank of the candidates, until a position is exchanged
                    rank = flat @ self.criterion.gradient(normal).ravel()
                    order = stable_order(rank, CRITERION_TOLERANCE * float(np.abs(rank).max()))
                others = self.candidates[chosen[:i] + chosen[i + 1 :]]
                apart = self.constraints.are_apart(self.candidates, others)
                tried = order[apart[order]][:MAX_TRIED]
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
        return self.candidates[chosen]

    def move(self, start: Array, step: float) -> Array:
        """Positions of which none gains by a move of one step across gravity, (n, 3)."""
        tangents = step * self.space.tangents(start)
        if not tangents.shape[2]:
            return start
        moves = np.array(list(product((0.0, -1.0, 1.0), repeat=tangents.shape[2])))

        def directions(t: Array) -> Array:
            """Positions (..., n, 3) after whole steps (..., n, d)."""
            moved = start + np.sum(tangents * t[..., None, :], axis=-1)
            return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))

        t = before = np.zeros((self.n, moves.shape[1]))
        for _ in range(MAX_SWEEPS):
            moved = moves[self._sweep(directions(t + moves[:, None, :]), MIN_GAIN * step**2)]
            if not moved.any():
                break
            tried = t + moved + FURTHER[:, None, None] * (t + moved - before)
            before = t + moved
            t = tried[self._furthest(directions(tried), MIN_GAIN * step**2)]
        return directions(t)

    def join(self, directions: Array) -> Array:
        """Positions that lie close together replaced by one of them, repeated.

        Where repeats are best, a search ends with such positions: near the optimum nothing draws
        them together completely. Where a least angle is asked for, none are joined.
        """
        cosines = directions @ directions.T
        near = cosines > np.cos(MAX_JOINED_ANGLE)
        if self.constraints.least_angle is not None or np.count_nonzero(near) == len(directions):
            return directions
        # A position that is near another one by way of others, too, is in its group.
        group = near
        while np.any((wider := group @ group) != group):
            group = wider
        joined = directions.copy()
        for members in map(np.flatnonzero, np.unique(group, axis=0)):
            middle = first_best(-cosines[np.ix_(members, members)].sum(axis=1))
            joined[members] = directions[members[middle]]
        loss = self.value(joined) - self.value(directions)
        return joined if loss <= MAX_JOINING_LOSS else directions

    def finish(self, directions: Array, bounded: bool) -> Optimum:
        """The optimum of positions that were found; `InputError` if they do not suffice."""
        directions = round_directions(self.join(directions))
        found = Optimum(directions, self.value(directions))
        if reason := self._missing(directions):
            raise InputError(
                f"no {self.n} positions of {self.space.text} were found that suffice: {reason}"
            )
        if not bounded:
            return found
        at = self.criterion.convex, self.space, self.constraints, self.n
        bound = self.criterion.bound(continuous_optimum(self.task, *at).bound)
        efficiency = min(1.0, self.criterion.efficiency(found.value, bound))
        return replace(found, bound=bound, efficiency=efficiency)

    @cached_property
    def candidates(self) -> Array:
        """Attitudes for an exchange, (k, 3)."""
        return allowed(self.space, self.constraints, CANDIDATES)

    @cached_property
    def _informations(self) -> Array:
        return self.task.informations(self.candidates)

    def value(self, directions: Array) -> float:
        """The criterion of positions."""
        return float(self.criterion.value(self.task.normal(directions)))

    def _check(self) -> None:
        """Raise `InputError` if no n positions can determine what is wanted."""
        if not len(self.candidates):
            limits = ", ".join(self.constraints.texts) or "no constraints"
            raise InputError(f"no attitude is left of {self.space.text} with {limits}")
        if reason := self._missing(self.candidates):
            raise InputError(f"the allowed attitudes do not suffice: {reason}")
        unknown = max(len(each.estimated) for each in self.criterion.estimators)
        rank_before = int(np.linalg.matrix_rank(self.task.prior))
        least = -(-(unknown - rank_before) // self.task.approach.n_conditions)
        if self.n < least:
            raise InputError(
                f"{self.n} positions do not determine {unknown} parameters; at least {least} are "
                "needed"
            )

    def _missing(self, directions: Array) -> str:
        """Why positions do not determine what is wanted; empty if they do."""
        if reason := self.task.missing(directions):
            return reason
        information = self.task.information(directions)
        if any(information.undetermined(e.estimated).any() for e in self.criterion.estimators):
            return "they do not tell the two effects apart"
        return ""

    def _best(self, found: list[Array]) -> Array:
        """First of the sets that are equally good, so that rounding does not choose."""
        return found[first_best([self.value(each) for each in found], DESIGN_TOLERANCE)]

    def _refine(self, starts: int) -> Array:
        """Best positions from so many random sets."""
        found = [self.exchange(start) for start in range(1, starts + 1)]
        values = [self.value(each) for each in found]
        order = stable_order(values, DESIGN_TOLERANCE)[:REFINED_STARTS]
        for step in STEPS:
            for i in order:
                found[i] = self.move(found[i], step)
        return self._best([found[i] for i in order])

    def _random(self, start: int) -> list[int]:
        """Draw n candidates that may stand together; `InputError` if so many do not fit."""
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, start]))
        most = 0
        for _ in range(DRAWS):
            chosen: list[int] = []
            free = np.ones(len(self.candidates), dtype=bool)
            while len(chosen) < self.n and free.any():
                chosen.append(int(rng.choice(np.flatnonzero(free))))
                free &= self.constraints.are_apart(self.candidates, self.candidates[chosen[-1:]])
            if len(chosen) == self.n:
                return chosen
            most = max(most, len(chosen))
        raise InputError(
            f"{self.n} positions {self.constraints.texts[-1]} were not found among the allowed "
            f"attitudes; {most} were"
        )

    def _sweep(self, around: Array, gain: float) -> NDArray[np.int_]:
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
                tried = tried[self.constraints.are_apart(around[tried, i], others)]
            if not len(tried):
                continue
            values = self.criterion.value(normal + changes[tried, i])
            best = first_best(values)
            if values[best] < value - gain:
                taken[i], value = tried[best], float(values[best])
                normal = normal + changes[taken[i], i]
                slope = self.criterion.gradient(normal).ravel()
        return taken

    def _furthest(self, tried: Array, gain: float) -> int:
        """Index of the best of k sets (k, n, 3) that meet the constraints; 0 if none gains."""
        each = self.task.informations(tried.reshape(-1, 3)).reshape(*tried.shape[:2], -1)
        normals = self.task.prior + each.sum(axis=1).reshape(-1, *self.task.prior.shape)
        values = self.criterion.value(normals)
        values[[not self.constraints.are_met(directions) for directions in tried]] = np.inf
        best = first_best(values)
        return best if values[best] < values[0] - gain else 0


def round_directions(directions: Array) -> Array:
    """Directions as they are returned and as a file holds them."""
    return np.asarray(directions).round(DIGITS) + 0.0  # -0.0 becomes 0.0
