"""What noise alone would leave in the residuals, by simulation."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.progress import track
from accelstudy.diagnosis.evidence.field import Field
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

SIMULATIONS = 1000
AT_ONCE = 500_000
"""Numbers that are drawn at once; all sets of very many positions would not fit in memory."""


SLOPES = 1
"""Stream of the slopes, apart from all others of the same seed."""
KEPT = 16_000_000
"""Most numbers that are kept; more are drawn anew whenever they are needed."""


@dataclass(frozen=True)
class Chance:
    """Simulated residuals without any effect: white noise of unit weight less what a fit absorbs.

    The same numbers are drawn again whenever they are needed; only small sets are kept.

    Parameters
    ----------
    seed : SeedSequence
    conditions : int, of the positions in the fit with the most
    simulations : int
    """

    seed: np.random.SeedSequence
    conditions: int
    simulations: int = SIMULATIONS

    def noise(self) -> Iterator[Array]:
        """Draw white noise of unit weight, (b, conditions) each."""
        rng = np.random.default_rng(self.seed)
        for count in self.counts:
            yield rng.standard_normal((count, self.conditions))

    @property
    def counts(self) -> list[int]:
        """How many sets are drawn at once."""
        size = max(1, AT_ONCE // self.conditions)
        return [min(size, self.simulations - k) for k in range(0, self.simulations, size)]

    @cached_property
    def kept(self) -> list[Array] | None:
        """All draws, if they are few."""
        few = self.simulations * self.conditions <= KEPT
        return list(self.noise()) if few else None

    def errors(self, residuals: Residuals) -> Iterator[Array]:
        """Yield residuals of a fit, (b, m) each, all simulations one after the other."""
        m = len(residuals.positions.design)
        key = (*self.seed.spawn_key, SLOPES)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))
        for drawn in track(self.kept or self.noise(), "null simulation", len(self.counts)):
            noise = drawn[:, :m]
            if residuals.slopes:
                # From a stream of their own: the draws of the positions stay what they are.
                slopes = rng.standard_normal((len(noise), residuals.slopes))
                noise = np.concatenate([noise, slopes], axis=1)
            yield noise - (noise @ residuals.absorbed) @ residuals.absorbed.T

    def errors_with_effects(self, residuals: Residuals, field: Field) -> Iterator[Array]:
        """Yield residuals without an effect and as many with a random one."""
        key = (*self.seed.spawn_key, 0)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))
        for errors in self.errors(residuals):
            half = len(errors) // 2 or 1
            yield errors[:half]
            changed = field.with_effects(errors[-half:], rng)
            yield changed - (changed @ residuals.absorbed) @ residuals.absorbed.T

    def statistic(self, residuals: Residuals, function: Callable[[Array], Array]) -> Array:
        """Return a statistic of all simulated residuals (b, m); its first axis is the set."""
        return np.concatenate([function(errors) for errors in self.errors(residuals)])
