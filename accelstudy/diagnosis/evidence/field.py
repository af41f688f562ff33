"""All that may be missing, side by side: each candidate with the spaces of its shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.hypotheses import (
    Bases,
    BumpedPositions,
    EffectShapes,
    Shapes,
    Spaces,
)

Array = NDArray[np.float64]

UNKNOWN = "unknown"
"""Something in one of the groups of regressors that is none of the effects."""
PROPOSED = np.array([12.0, 25.0, 50.0])
"""Noncentralities of the simulated effects: where tests at the usual levels decide."""


@dataclass(frozen=True)
class Field:
    """Candidates, each with spaces that are alternatives.

    Attributes
    ----------
    names : tuple of str, K candidates
    spaces : tuple of tuple of Spaces, of each
    weights : tuple of arrays, prior probabilities of the spaces of each, which sum to 1
    """

    names: tuple[str, ...]
    spaces: tuple[tuple[Spaces, ...], ...]
    weights: tuple[Array, ...]

    @classmethod
    def of(cls, candidates: Mapping[str, Shapes], groups: Mapping[str, Spaces]) -> Field:
        """Candidates and, as the last of them, something unknown in a group of regressors."""
        names: list[str] = []
        spaces: list[tuple[Spaces, ...]] = []
        weights: list[Array] = []
        for name, shapes in candidates.items():
            names.append(name)
            spaces.append((shapes,))
            weights.append(shape_weights(shapes))
        if groups:
            names.append(UNKNOWN)
            spaces.append(tuple(groups.values()))
            weights.append(np.full(len(groups), 1 / len(groups)))
        return cls(tuple(names), tuple(spaces), tuple(weights))

    @cached_property
    def dims(self) -> NDArray[np.int_]:
        """Dimensions of all spaces, (s,)."""
        parts = [space.dims for spaces in self.spaces for space in spaces]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=int)

    @cached_property
    def starts(self) -> NDArray[np.int_]:
        """Where the spaces of each candidate begin, (K,)."""
        return np.concatenate([[0], np.cumsum([len(w) for w in self.weights])[:-1]]).astype(int)

    @cached_property
    def _together(self) -> Bases:
        """Bases of all candidates that have one, side by side."""
        bases = [s for spaces in self.spaces for s in spaces if isinstance(s, Bases)]
        if not bases:
            return Bases(np.zeros((0, 0)), np.zeros(0, dtype=int))
        return Bases(
            np.concatenate([b.together for b in bases], axis=1),
            np.concatenate([b.dims for b in bases]),
        )

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each space, (..., s)."""
        squares, first = [], 0
        together = self._together
        seen = together.parts(errors) if len(together.dims) else None
        for spaces in self.spaces:
            for space in spaces:
                if isinstance(space, Bases):
                    assert seen is not None
                    squares.append(seen[..., first : first + len(space.dims)])
                    first += len(space.dims)
                else:
                    squares.append(space.parts(errors))
        return np.concatenate(squares, axis=-1)

    def densities(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) under each candidate, over its shapes, (..., K)."""
        return self.combined(
            evidence.of_spaces(self.parts(errors), self.dims, np.sum(errors**2, axis=-1))
        )

    def combined(self, logs: Array) -> Array:
        """Log of the mean over the shapes of each candidate, (..., K), of logs (..., s)."""
        weighted = logs + np.log(np.concatenate(self.weights))
        # `numpy.logaddexp.reduceat` goes one by one, which takes eight times as long.
        top = np.maximum.reduceat(weighted, self.starts, axis=-1)
        counts = [len(weights) for weights in self.weights]
        weighted -= np.repeat(top, counts, axis=-1)
        sums = np.add.reduceat(np.exp(weighted), self.starts, axis=-1)
        return np.asarray(top + np.log(sums))

    def odds(self, evidence: Evidence, parts: Array, squares: Array) -> Array:
        """Log odds of each candidate against nothing, (b, K).

        Parameters
        ----------
        evidence : Evidence
        parts : (b, s) array, of `parts`
        squares : (b,) array, ‖z‖²
        """
        logs = self.combined(evidence.of_spaces(parts, self.dims, squares))
        return logs - np.logaddexp.reduce(evidence.of_noise(squares), axis=-1)[:, None]

    # --- simulated effects ----------------------------------------------------------------------

    @cached_property
    def _proposed(self) -> tuple[NDArray[np.int_], Array]:
        """Spaces in which effects can be drawn, (p,), and how often each is."""
        able = [
            isinstance(space, EffectShapes | BumpedPositions)
            for spaces in self.spaces
            for space in spaces
            for _ in space.dims
        ]
        weights = np.concatenate([w / len(self.names) for w in self.weights])
        chosen = np.flatnonzero(able)
        return chosen, weights[chosen] / weights[chosen].sum()

    def with_effects(self, noise: Array, rng: np.random.Generator) -> Array:
        """Add a random effect to each of sets of noise (b, m)."""
        chosen, weights = self._proposed
        drawn = rng.choice(chosen, size=len(noise), p=weights)
        sizes = rng.choice(PROPOSED, size=len(noise))
        dims = self.dims[drawn]
        amounts = rng.standard_normal(dims.sum()) * np.repeat(np.sqrt(sizes / dims), dims)
        candidate = np.searchsorted(self.starts, drawn, side="right") - 1
        of_amount = np.repeat(candidate, dims)
        changed = noise.copy()
        for k in np.unique(candidate):
            rows = np.flatnonzero(candidate == k)
            shapes = self.spaces[k][0]
            assert isinstance(shapes, EffectShapes | BumpedPositions)
            changed[rows] += shapes.drawn(drawn[rows] - self.starts[k], amounts[of_amount == k])
        return changed

    def proposal(self, parts: Array) -> Array:
        """Log ratio of the densities of residuals with a random effect and of noise alone, (b,).

        Parameters
        ----------
        parts : (b, s) array
        """
        chosen, weights = self._proposed
        dims = self.dims[chosen]
        seen, sums = parts[:, chosen], []
        for size in PROPOSED:
            g = size / dims
            logs = seen * (g / (1 + g) / 2)
            logs += np.log(weights) - dims / 2 * np.log1p(g)
            sums.append(log_mean(logs) + np.log(len(chosen)))
        return np.asarray(log_mean(np.stack(sums, axis=-1)))


def shape_weights(shapes: Shapes) -> Array:
    """Prior probabilities of shapes: even over the logarithm of a smooth setting, else even."""
    weights = np.ones(len(shapes))
    if isinstance(shapes, EffectShapes) and len(shapes) > 1 and shapes[0].smooth is not None:
        weights = np.gradient(np.log([h.value for h in shapes]))
    return np.asarray(weights / weights.sum())
