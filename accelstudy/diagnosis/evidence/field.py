"""All that may be missing, side by side: each candidate with the spaces of its shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.diagnosis.evidence.size import Evidence, log_mean, log_sum
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.hypotheses import Bases, EffectShapes, Shapes, Spaces
from accelstudy.diagnosis.space.shapes import LearnedShapes, Place

Array = NDArray[np.float64]

UNKNOWN = "unknown"
"""Something of one of the learned shapes, or of the attitude alone, that is none of the effects."""
OF_ATTITUDE = ("force", "bias")
"""Place of anything that repeated positions of one attitude have in common."""
PROPOSED = np.array([12.0, 25.0, 50.0])
"""Noncentralities of the simulated effects: where tests at the usual levels decide."""


@dataclass(frozen=True)
class Unknown:
    """Something without a name: one of the learned shapes, or anything of the attitude alone.

    Attributes
    ----------
    shapes : LearnedShapes
    attitude : Spaces or None, everything but the differences of repeated positions
    """

    shapes: LearnedShapes
    attitude: Spaces | None = None

    @property
    def places(self) -> tuple[Place, ...]:
        """Coordinate and target of each."""
        return (*self.shapes.places, *([OF_ATTITUDE] if self.attitude else []))

    @cached_property
    def weights(self) -> Array:
        """Prior probability of each, which sum to 1; the attitude counts as one coordinate."""
        if self.attitude is None:
            return self.shapes.weights
        count = len({coordinate for coordinate, _ in self.shapes.places}) + 1
        return np.append(self.shapes.weights * (count - 1) / count, 1 / count)

    def parts(self, errors: Array) -> Array:
        """What `densities` needs of residuals (..., m), (..., p)."""
        squares = self.shapes.squares(errors)
        if self.attitude is None:
            return squares
        return np.concatenate([squares, self.attitude.parts(errors)], axis=-1)

    def densities(self, evidence: Evidence, parts: Array, squares: Array) -> Array:
        """Log density of residuals under each of `places`, times its prior weight, (b, s).

        Parameters
        ----------
        evidence : Evidence
        parts : (b, p) array
        squares : (b,) array, ‖z‖²
        """
        shapes, logs = self.shapes, []
        if len(shapes):
            along = shapes.by_shape(parts[:, : shapes.vectors.shape[1]])
            logs.append(evidence.of_shapes(along, shapes.shares, squares))
        if self.attitude is not None:
            logs.append(evidence.of_spaces(parts[:, -1:], self.attitude.dims, squares))
        return np.concatenate(logs, axis=1) + np.log(self.weights)

    def by_place(self, evidence: Evidence, z: Array) -> dict[Place, float]:
        """Log density of residuals z (m,) under the shapes of each place, times its prior."""
        logs = self.densities(evidence, self.parts(z[None]), np.array([z @ z]))[0]
        places: dict[Place, float] = {}
        for place, log in zip(self.places, logs.tolist(), strict=True):
            places[place] = float(np.logaddexp(places.get(place, -np.inf), log))
        return places


@dataclass(frozen=True)
class Field:
    """Candidates, each with spaces that are alternatives, and something without a name.

    Attributes
    ----------
    candidates : dict of name to shapes
    frame : Frame, in which something without a name is looked for; None for the candidates alone
    attitude : Spaces or None, as in `Unknown`
    """

    candidates: Mapping[str, Shapes]
    frame: Frame | None = None
    attitude: Spaces | None = None

    @cached_property
    def unknown(self) -> Unknown | None:
        """Something without a name; None where nothing but the candidates shows."""
        if self.frame is None or not self.candidates:
            return None
        unknown = Unknown(LearnedShapes.of(self.frame), self.attitude)
        return unknown if unknown.places else None

    @cached_property
    def named(self) -> Field:
        """The candidates alone."""
        return Field(self.candidates)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """All candidates, K; the unknown is the last one."""
        return (*self.candidates, *([UNKNOWN] if self.unknown else []))

    @cached_property
    def weights(self) -> list[Array]:
        """Prior probabilities of the shapes of each candidate with a name, which sum to 1."""
        return [shape_weights(shapes) for shapes in self.candidates.values()]

    @cached_property
    def dims(self) -> NDArray[np.int_]:
        """Dimensions of all their shapes, (s,)."""
        return np.concatenate([np.zeros(0, int), *(c.dims for c in self.candidates.values())])

    @cached_property
    def starts(self) -> NDArray[np.int_]:
        """Where the shapes of each of them begin, and where the last ones end."""
        return np.cumsum([0, *map(len, self.candidates.values())])

    @cached_property
    def _together(self) -> Bases:
        """Bases of all candidates that have one, side by side."""
        bases = [one for one in self.candidates.values() if isinstance(one, Bases)]
        if not bases:
            return Bases(np.zeros((0, 0)), np.zeros(0, dtype=int))
        return Bases(
            np.concatenate([b.together for b in bases], axis=1),
            np.concatenate([b.dims for b in bases]),
        )

    def parts(self, errors: Array) -> Array:
        """Squares of what residuals (..., m) have in each shape, (..., s), then of the unknown."""
        squares, first = [np.zeros((*errors.shape[:-1], 0))], 0
        together = self._together
        seen = together.parts(errors) if len(together.dims) else None
        for shapes in self.candidates.values():
            if isinstance(shapes, Bases):
                assert seen is not None
                squares.append(seen[..., first : first + len(shapes)])
                first += len(shapes)
            else:
                squares.append(shapes.parts(errors))
        if self.unknown is not None:
            squares.append(self.unknown.parts(errors))
        return np.concatenate(squares, axis=-1)

    def of_shapes(self, evidence: Evidence, parts: Array, squares: ArrayLike) -> Array:
        """Log density of residuals under each shape of the candidates with a name, (..., s)."""
        return evidence.of_spaces(parts[..., : len(self.dims)], self.dims, squares)

    def densities(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) under each candidate, over its shapes, (..., K)."""
        return self.of_parts(evidence, self.parts(errors), np.sum(errors**2, axis=-1))

    def of_parts(self, evidence: Evidence, parts: Array, squares: ArrayLike) -> Array:
        """Return the same by the `parts` of residuals and ‖z‖²."""
        logs = [self.combined(self.of_shapes(evidence, parts, squares))]
        if self.unknown is not None:
            sets, squares = np.atleast_2d(parts), np.atleast_1d(squares)
            each = self.unknown.densities(evidence, sets[:, len(self.dims) :], squares)
            logs.append(log_sum(each).reshape(*parts.shape[:-1], 1))
        return np.concatenate(logs, axis=-1)

    def combined(self, logs: Array) -> Array:
        """Log of the mean over the shapes of each candidate with a name, of logs (..., s)."""
        if not self.candidates:
            return logs
        weighted, starts = logs + np.log(np.concatenate(self.weights)), self.starts[:-1]
        # `numpy.logaddexp.reduceat` goes one by one, which takes eight times as long.
        top = np.maximum.reduceat(weighted, starts, axis=-1)
        weighted -= np.repeat(top, np.diff(self.starts), axis=-1)
        sums = np.add.reduceat(np.exp(weighted), starts, axis=-1)
        return np.asarray(top + np.log(sums))

    def odds(self, evidence: Evidence, parts: Array, squares: Array) -> Array:
        """Log odds of each candidate against nothing, (b, K).

        Parameters
        ----------
        evidence : Evidence
        parts : (b, ...) array, of `parts`
        squares : (b,) array, ‖z‖²
        """
        logs = self.of_parts(evidence, parts, squares)
        return logs - np.logaddexp.reduce(evidence.of_noise(squares), axis=-1)[:, None]

    # --- simulated effects ----------------------------------------------------------------------

    @cached_property
    def _proposed(self) -> Array:
        """How often an effect is drawn in each shape, (s,)."""
        return np.concatenate(self.weights) / len(self.candidates)

    def with_effects(self, noise: Array, rng: np.random.Generator) -> Array:
        """Add a random effect to each of sets of noise (b, m)."""
        drawn = rng.choice(len(self.dims), size=len(noise), p=self._proposed)
        sizes = rng.choice(PROPOSED, size=len(noise))
        dims = self.dims[drawn]
        amounts = rng.standard_normal(dims.sum()) * np.repeat(np.sqrt(sizes / dims), dims)
        candidate = np.searchsorted(self.starts, drawn, side="right") - 1
        of_candidate = list(self.candidates.values())
        of_amount = np.repeat(candidate, dims)
        changed = noise.copy()
        for k in np.unique(candidate):
            rows = np.flatnonzero(candidate == k)
            changed[rows] += of_candidate[k].drawn(
                drawn[rows] - self.starts[k], amounts[of_amount == k]
            )
        return changed

    def proposal(self, parts: Array) -> Array:
        """Log ratio of the densities of residuals with a random effect and of noise alone, (b,).

        Parameters
        ----------
        parts : (b, ...) array, of `parts`
        """
        seen, sums = parts[:, : len(self.dims)], []
        for size in PROPOSED:
            g = size / self.dims
            logs = seen * (g / (1 + g) / 2)
            logs += np.log(self._proposed) - self.dims / 2 * np.log1p(g)
            sums.append(log_sum(logs))
        return np.asarray(log_mean(np.stack(sums, axis=-1)))


def shape_weights(shapes: Shapes) -> Array:
    """Prior probabilities of shapes: even over the logarithm of a smooth setting, else even."""
    weights = np.ones(len(shapes))
    if isinstance(shapes, EffectShapes) and len(shapes) > 1 and shapes[0].smooth is not None:
        weights = np.gradient(np.log([h.value for h in shapes]))
    return np.asarray(weights / weights.sum())
