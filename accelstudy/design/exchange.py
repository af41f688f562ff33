"""Exchange of positions for better ones, from a list of candidates (Fedorov 1972).

Each position in turn is replaced by the candidate with which the criterion is best. The derivative
of the criterion ranks the candidates, and only the first of them are tried, as in the KL exchange
of Atkinson & Donev (1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.design.criteria import Criterion
from accelstudy.design.spaces import Constraints
from accelstudy.positions.choice import TIED, first_best, in_order

Array = NDArray[np.float64]

TRIED = 24
"""Number of candidates that are tried for each position, in the order of their rank."""
GAIN = 1e-9
"""Relative improvement below which a position stays."""
KNOWN = 1e-6
"""Scaled information that is known of each parameter during an exchange. Where a choice does not
determine all parameters, rounding would decide without it."""
SWEEPS = 100
DRAWS = 200
"""Number of random sets that are drawn to find one that keeps its distances."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Attitudes to choose from.

    Attributes
    ----------
    directions : (k, 3) array
    informations : (k, u, u) array, scaled
    prior : (u, u) array, information before the first position
    constraints : Constraints; all candidates meet those on single attitudes
    """

    directions: Array
    informations: Array
    prior: Array
    constraints: Constraints

    def allowed(self, chosen: list[int]) -> NDArray[np.bool_]:
        """Which candidates, (k,), may join those that are chosen."""
        if self.constraints.pair is None or not chosen:
            return np.ones(len(self.directions), dtype=bool)
        apart = self.constraints.pair.apart(self.directions, self.directions[chosen])
        return np.asarray(apart.all(axis=1))

    def normal(self, chosen: list[int]) -> Array:
        """Normal matrix of a choice."""
        before = self.prior + KNOWN * np.eye(len(self.prior))
        return np.asarray(before + self.informations[chosen].sum(axis=0))

    def random(self, n: int, rng: np.random.Generator) -> list[int]:
        """Draw n candidates that may stand together.

        Raises
        ------
        InputError
            If so many do not fit.
        """
        most = 0
        for _ in range(DRAWS):
            chosen: list[int] = []
            free = np.ones(len(self.directions), dtype=bool)
            while len(chosen) < n and free.any():
                new = int(rng.choice(np.flatnonzero(free)))
                chosen.append(new)
                if self.constraints.pair is not None:
                    pair = self.directions[[new]]
                    free &= self.constraints.pair.apart(self.directions, pair)[:, 0]
            if len(chosen) == n:
                return chosen
            most = max(most, len(chosen))
        assert self.constraints.pair is not None
        raise InputError(
            f"{n} positions {self.constraints.pair.text} were not found among the allowed "
            f"attitudes; {most} were"
        )


def exchange(candidates: Candidates, chosen: list[int], criterion: Criterion) -> list[int]:
    """Exchange positions until none can be exchanged for a better one.

    Parameters
    ----------
    candidates : Candidates
    chosen : indices of the positions to begin with
    criterion : Criterion
    """
    chosen = list(chosen)
    flat = candidates.informations.reshape(len(candidates.directions), -1)
    normal = candidates.normal(chosen)
    value = float(criterion.value(normal))
    for _ in range(SWEEPS):
        before, order = value, None  # the rank of the candidates, until a position is exchanged
        for i, old in enumerate(chosen):
            rest = normal - candidates.informations[old]
            if order is None:
                rank = flat @ criterion.gradient(normal).ravel()
                order = in_order(rank, TIED * float(np.abs(rank).max()))
            tried = order[candidates.allowed(chosen[:i] + chosen[i + 1 :])[order]][:TRIED]
            if not len(tried):
                continue
            values = criterion.value(rest + candidates.informations[tried])
            best = first_best(values)
            if values[best] < value - GAIN:
                chosen[i], value = int(tried[best]), float(values[best])
                normal, order = rest + candidates.informations[chosen[i]], None
        normal = candidates.normal(chosen)  # computed anew, without the rounding of many exchanges
        if not value < before - GAIN:
            break
    return chosen
