"""The search for the best positions, and a bound of what any positions can reach.

Positions are exchanged for better ones of a list of candidates (Fedorov 1972), from several random
sets. Then they move until no small move makes the criterion better (`newton`), and positions that
nearly coincide become repeats.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON
from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.criteria import Criterion
from accelstudy.design.newton import settle
from accelstudy.design.spaces import Attitudes
from accelstudy.design.task import Task
from accelstudy.positions.choice import CRITERION_TOLERANCE, first_best, stable_order

CANDIDATES = 600
STARTS = 8
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
class Search:
    """The search for positions that are best by a criterion.

    The same search finds the same positions on every processor, but for their last digit.

    Attributes
    ----------
    task : Task
    criterion : Criterion
    allowed : Attitudes
    seed : int
    """

    task: Task
    criterion: Criterion
    allowed: Attitudes = field(default_factory=Attitudes)
    seed: int = 1
    _settled: dict[tuple[int, int], Array] = field(default_factory=dict)

    def optimum(self, n: int, starts: int = STARTS) -> Array:
        """Find the best n positions, (n, 3): directions of gravity in the body frame.

        Parameters
        ----------
        n : int
        starts : int, random sets to begin with; those of an earlier search are not searched again

        Raises
        ------
        InputError
            If no attitude is allowed, the allowed ones do not determine the model, or are too few.
        """
        if not len(self.candidates):
            limits = ", ".join(self.allowed.constraints) or "no constraints"
            raise InputError(f"no attitude is left of {self.allowed.text} with {limits}")
        each = [self._from_start(n, start) for start in range(1, starts + 1)]
        best = each[first_best([self.value(one) for one in each], DESIGN_TOLERANCE)]
        directions = round_directions(self._join(best))
        if reason := self.task.missing(directions):
            if of_all := self.task.missing(self.candidates):
                raise InputError(f"the allowed attitudes do not suffice: {of_all}")
            raise InputError(
                f"no {n} positions of {self.allowed.text} were found that suffice: {reason}"
            )
        return directions

    def bound(self, n: int) -> float:
        """Lower bound of the criterion of any n allowed positions."""
        return continuous_optimum(self.task, self.criterion, self.allowed, n).bound

    def efficiency(self, directions: Array) -> float:
        """Least share that positions reach of the best that as many positions can."""
        return self.criterion.efficiency(self.value(directions), self.bound(len(directions)))

    def _from_start(self, n: int, start: int) -> Array:
        """Positions that a search from one random set ends in, (n, 3)."""
        if (n, start) not in self._settled:
            chosen = self.exchange(n, start)
            self._settled[n, start] = settle(self.task, self.criterion, self.allowed, chosen)
        return self._settled[n, start]

    def exchange(self, n: int, start: int) -> Array:
        """Candidates of which none can be exchanged for a better one, from a random set; (n, 3)."""
        before = self.task.prior + PRIOR_INFORMATION * np.eye(len(self.task.prior))
        informations, k = self._informations, len(self.candidates)
        rng, flat = np.random.default_rng([self.seed, start]), informations.reshape(k, -1)
        chosen = [int(rng.choice(k)) for _ in range(n)]
        for _ in range(MAX_SWEEPS):
            # Computed anew, without the rounding of many exchanges.
            normal = before + informations[chosen].sum(axis=0)
            value, order = float(self.criterion.value(normal)), None
            first = value
            for i, old in enumerate(chosen):
                if order is None:  # the rank of the candidates, until a position is exchanged
                    rank = flat @ self.criterion.gradient(normal).ravel()
                    order = stable_order(rank, CRITERION_TOLERANCE * float(np.abs(rank).max()))
                tried, rest = order[:MAX_TRIED], normal - informations[old]
                values = self.criterion.value(rest + informations[tried])
                best = first_best(values)
                if values[best] < value - LEAST_GAIN:
                    chosen[i], value = int(tried[best]), float(values[best])
                    normal, order = rest + informations[chosen[i]], None
            if not value < first - LEAST_GAIN:
                break
        return self.candidates[chosen]

    def _join(self, directions: Array) -> Array:
        """Positions that lie close together replaced by one of them, repeated.

        Where repeats are best, a search ends with such positions: near the optimum nothing draws
        them together completely.
        """
        first = np.argmax(directions @ directions.T > np.cos(MAX_JOINED_ANGLE), axis=1)
        while not np.array_equal(first, first[first]):  # near each other by way of others
            first = first[first]
        if np.array_equal(first, np.arange(len(directions))):
            return directions
        joined = settle(self.task, self.criterion, self.allowed, directions[first])[first]
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

    def least_value(self, directions: Array) -> float:
        """Lower bound of the criterion of as many positions, by the derivatives at these."""
        normal = self.task.normal(directions)
        least = float(np.tensordot(self._informations, self.criterion.gradient(normal), 2).min())
        return self.criterion.bound(self.task.prior, normal, len(directions), least)


def round_directions(directions: Array) -> Array:
    """Directions as they are returned and as a file holds them."""
    return np.asarray(directions).round(DIGITS) + 0.0  # -0.0 becomes 0.0
