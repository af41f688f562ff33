"""Where a disagreement lives: the share of the excess χ² that each group of regressors takes up.

A group of k regressors takes up k of r redundant conditions. Of a pattern that has nothing to do
with it, it has a share of Beta(k/2, (r − k)/2) by chance, k/r on average. Where that is often
nearly all of it, the share says nothing, and is not told.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.groups import LACK_OF_FIT, REPEAT, ROBOT, all_groups
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.spaces import Spaces

Array = NDArray[np.float64]

SINGLE = "single_position"
"""Group of the one position that is most at odds with the others."""
GROUPS = (
    "direction", ROBOT, REPEAT, "slow_time", "temperature", "previous_position", SINGLE,
)  # fmt: skip
"""All groups."""
ABSENT = {
    "direction": "the model has all effects of the direction",
    ROBOT: "gravity alone does not tell the angles of a robot",
    REPEAT: "no attitude was measured twice",
    "previous_position": "the campaign does not give the order of the positions",
    SINGLE: "no position is checked by the others",
}
"""Why nothing is known of groups that need no column of a name."""
NEARLY_ALL = 0.9
"""Share that would seem to say where a pattern lives."""
SELDOM = 0.05
"""Probability with which any pattern may have such a share in a group by chance."""


@dataclass(frozen=True)
class Location:
    """Where the residuals of a fit have more than noise.

    Attributes
    ----------
    examined : ExaminedFit, of the base fit
    chance : Chance, residuals without any effect
    variance : float, of unit weight, of the noise
    """

    examined: ExaminedFit
    chance: Chance
    variance: float

    @cached_property
    def shares(self) -> dict[str, float]:
        """Share of the excess χ² in the space of each group that can be told, in [0, 1]."""
        return {name: self._share(name) for name in self._spaces if name not in self.untestable}

    @cached_property
    def by_chance(self) -> dict[str, float]:
        """Share that each of these groups has of any pattern, on average."""
        found = {
            n: float(self._spaces[n].dims[0]) / self._residuals.redundancy for n in self.shares
        }
        if SINGLE in found:
            largest, total = self._single.T
            found[SINGLE] = float(np.mean(largest / total))
        return found

    @cached_property
    def untestable(self) -> dict[str, str]:
        """Why nothing can be told of the other groups."""
        reasons = {name: self._reason(name) for name in GROUPS}
        return {name: reason for name, reason in reasons.items() if reason}

    @cached_property
    def _spaces(self) -> dict[str, Spaces]:
        found = {n: q for n, q in all_groups(self.examined).items() if n != LACK_OF_FIT}
        bumped = self.examined.candidates.get(OUTLIER)
        return found if bumped is None else {**found, SINGLE: bumped}

    @property
    def _residuals(self) -> Residuals:
        return self.examined.frame.residuals

    def _share(self, name: str) -> float:
        z, space = self._residuals.z, self._spaces[name]
        excess = float(z @ z) / self.variance - self._residuals.redundancy
        if excess <= 0:
            return 0.0
        expected = float(np.mean(self._single[:, 0]) if name == SINGLE else space.dims[0])
        part = float(space.parts(z).max()) / self.variance
        return float(np.clip((part - expected) / excess, 0.0, 1.0))

    def _reason(self, name: str) -> str:
        """Say why nothing can be told of a group; nothing if something can."""
        if name not in self._spaces:
            return self._absent(name)
        k, r = int(self._spaces[name].dims.max()), self._residuals.redundancy
        if k == 0:
            return "the parameters of the model absorb all of it"
        if self._nearly_all(name, k, r) > SELDOM:
            return f"with a redundancy of {r}, nearly all of any pattern could be in it by chance"
        return ""

    def _absent(self, name: str) -> str:
        hold = self.examined.frame.hold
        columns = {"slow_time": hold.time, "temperature": hold.temperature}
        if name in columns:
            column = name.removeprefix("slow_")
            if columns[name] is None:
                return f"the campaign gives no {column}"
            return f"the {column} is the same in all positions"
        return ABSENT[name]

    def _nearly_all(self, name: str, k: int, r: int) -> float:
        """Probability that a group has nearly all of any pattern by chance."""
        if name == SINGLE:
            largest, total = self._single.T
            return float(np.mean(largest >= NEARLY_ALL * total))
        return 1.0 if k >= r else float(special.betainc((r - k) / 2, k / 2, 1 - NEARLY_ALL))

    @cached_property
    def _single(self) -> Array:
        """Largest part of a single position in simulated residuals, and all of them, (s, 2)."""
        space = self._spaces[SINGLE]

        def parts(errors: Array) -> Array:
            return np.column_stack([space.parts(errors).max(axis=-1), np.sum(errors**2, axis=-1)])

        return self.chance.statistic(self._residuals, parts)
