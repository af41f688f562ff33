"""The search for the best positions.

Positions are exchanged for better ones of a list of candidates (Fedorov 1972), from several random
sets. Then they move until no small move makes the criterion better (`newton`), and positions that
nearly coincide become repeats.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.criteria import Criterion
from accelstudy.design.newton import settle
from accelstudy.design.spaces import Attitudes
from accelstudy.design.task import Task
from accelstudy.positions.choice import CRITERION_TOLERANCE, first_best, stable_order

Array = NDArray[np.float64]

CANDIDATES = 600
STARTS = 8
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
MAX_JOINED_ANGLE = 1 * GON
"""Angle up to which two positions may be joined."""
MAX_JOINING_LOSS = 1e-4
"""Largest loss of the criterion, a logarithm, by joining."""
DIGITS = 8
"""Decimals of the directions, 1e-8 rad."""
DESIGN_TOLERANCE = 1e-6
"""Relative difference below which two designs are equally good, and the first one is taken."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """Positions that were found.

    Attributes
    ----------
    directions : (n, 3) array of unit vectors, gravity in the body frame, to 8 decimals
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

    The same search finds the same positions on every processor, but for their last digit.

    Attributes
    ----------
    task : Task
    criterion : Criterion
    n : int
    allowed : Attitudes
    seed : int
    """

    task: Task
    criterion: Criterion
    n: int
    allowed: Attitudes = field(default_factory=Attitudes)
    seed: int = 1

    def optimum(self, starts: int = STARTS, bounded: bool = True) -> Optimum:
        """Find the positions.

        Parameters
        ----------
        starts : int, random sets to begin with
        bounded : bool, whether the bound, and with it the efficiency, is wanted

        Raises
        ------
        InputError
            If no attitude is allowed, the allowed ones do not determine the model, or are too few.
        """
        self._check()
        each = [self._settle(self.exchange(start)) for start in range(1, starts + 1)]
        best = each[first_best([self.value(one) for one in each], DESIGN_TOLERANCE)]
        directions = round_directions(self._join(best))
        found = Optimum(directions, self.value(directions))
        if reason := self._missing(directions):
            raise InputError(
                f"no {self.n} positions of {self.allowed.text} were found that suffice: {reason}"
            )
        if not bounded:
            return found
        shares = continuous_optimum(self.task, self.criterion.convex, self.allowed, self.n)
        bound = self.criterion.bound(shares.bound)
        efficiency = min(1.0, self.criterion.efficiency(found.value, bound))
        return replace(found, bound=bound, efficiency=efficiency)

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
                apart = self.allowed.are_apart(self.candidates, others)
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

    def _settle(self, directions: Array) -> Array:
        """Positions that have moved to where no small move gains, if they can move."""
        return settle(self.task, self.criterion, self.allowed, directions)

    def _join(self, directions: Array) -> Array:
        """Positions that lie close together replaced by one of them, repeated.

        Where repeats are best, a search ends with such positions: near the optimum nothing draws
        them together completely. Where a least angle is asked for, there are none.
        """
        if self.allowed.least_angle is not None:
            return directions
        first = np.argmax(directions @ directions.T > np.cos(MAX_JOINED_ANGLE), axis=1)
        while not np.array_equal(first, first[first]):  # near each other by way of others
            first = first[first]
        if np.array_equal(first, np.arange(len(directions))):
            return directions
        joined = self._settle(directions[first])[first]
        loss = self.value(joined) - self.value(directions)
        return joined if loss <= MAX_JOINING_LOSS else directions

    @cached_property
    def candidates(self) -> Array:
        """Attitudes for an exchange, (k, 3)."""
        return self.allowed.sample(CANDIDATES)

    @cached_property
    def _informations(self) -> Array:
        return self.task.informations(self.candidates)

    def value(self, directions: Array) -> float:
        """The criterion of positions."""
        return float(self.criterion.value(self.task.normal(directions)))

    def _check(self) -> None:
        """Raise `InputError` if no n positions can determine what is wanted."""
        if not len(self.candidates):
            limits = ", ".join(self.allowed.constraints) or "no constraints"
            raise InputError(f"no attitude is left of {self.allowed.text} with {limits}")
        if not self._determined(self.candidates):
            reason = self._missing(self.candidates)
            raise InputError(f"the allowed attitudes do not suffice: {reason}")
        unknown = max(len(each.estimated) for each in self.criterion.estimators)
        rank_before = int(np.linalg.matrix_rank(self.task.prior))
        least = -(-(unknown - rank_before) // self.task.approach.n_conditions)
        if self.n < least:
            raise InputError(
                f"{self.n} positions do not determine {unknown} parameters; at least {least} are "
                "needed"
            )

    def _determined(self, directions: Array) -> bool:
        """Whether positions determine what is wanted, but for noise."""
        information = self.task.information(directions)
        each = self.criterion.estimators
        return not any(information.undetermined(one.estimated).any() for one in each)

    def _missing(self, directions: Array) -> str:
        """Why positions do not determine what is wanted; empty if they do."""
        if reason := self.task.missing(directions):
            return reason
        return "" if self._determined(directions) else "they do not tell the two effects apart"

    def _random(self, start: int) -> list[int]:
        """Draw n candidates that may stand together; `InputError` if so many do not fit."""
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, start]))
        most = 0
        for _ in range(DRAWS):
            chosen: list[int] = []
            free = np.ones(len(self.candidates), dtype=bool)
            while len(chosen) < self.n and free.any():
                chosen.append(int(rng.choice(np.flatnonzero(free))))
                free &= self.allowed.are_apart(self.candidates, self.candidates[chosen[-1:]])
            if len(chosen) == self.n:
                return chosen
            most = max(most, len(chosen))
        raise InputError(
            f"{self.n} positions {self.allowed.constraints[-1]} were not found among the allowed "
            f"attitudes; {most} were"
        )


def round_directions(directions: Array) -> Array:
    """Directions as they are returned and as a file holds them."""
    return np.asarray(directions).round(DIGITS) + 0.0  # -0.0 becomes 0.0
