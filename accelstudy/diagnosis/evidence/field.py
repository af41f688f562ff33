"""All that may be missing, side by side: each candidate with its shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.hypotheses import Hypotheses, Shapes, Spaces, log_sum
from accelstudy.diagnosis.space.shapes import LearnedShapes

Array = NDArray[np.float64]
Ints = NDArray[np.int_]

UNKNOWN = "unknown"
"""Something of one of the learned shapes, or of the attitude alone, that is none of the effects."""
PROPOSED = np.array([12.0, 25.0, 50.0])
"""Noncentralities of the simulated effects: where tests at the usual levels decide."""


class Seen(NamedTuple):
    """What densities need of residuals: their parts by candidate, (..., p) each, and ‖z‖² (...)."""

    parts: tuple[Array, ...]
    squares: Array


@dataclass(frozen=True)
class Field:
    """Candidates, each with shapes that are alternatives, and something without a name.

    Attributes
    ----------
    candidates : dict of name to shapes
    frame : Frame, in which something without a name is looked for; None for the candidates alone
    attitude : Spaces or None, everything but the differences of repeated positions
    """

    candidates: Mapping[str, Hypotheses]
    frame: Frame | None = None
    attitude: Spaces | None = None

    @cached_property
    def unknown(self) -> LearnedShapes | None:
        """Something without a name; None where nothing but the candidates shows."""
        if self.frame is None or not self.candidates:
            return None
        unknown = LearnedShapes.of(self.frame, attitude=self.attitude)
        return unknown if unknown.places else None

    @cached_property
    def named(self) -> Field:
        """The candidates alone."""
        return Field(self.candidates)

    @cached_property
    def all(self) -> dict[str, Shapes]:
        """All candidates, K; the unknown is the last one."""
        unknown: dict[str, Shapes] = {} if self.unknown is None else {UNKNOWN: self.unknown}
        return {**self.candidates, **unknown}

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.all)

    def seen(self, errors: Array) -> Seen:
        """What the densities need of residuals (..., m)."""
        parts = tuple(shapes.parts(errors) for shapes in self.all.values())
        return Seen(parts, np.sum(errors**2, axis=-1))

    @cached_property
    def _spaces(self) -> tuple[Ints, Array, Ints]:
        """Dimensions and log prior of all named shapes, (s,), and where those of each begin."""
        spaces = [*self.candidates.values()]
        dims = np.concatenate([one.dims for one in spaces])
        log_prior = np.log(np.concatenate([one.prior for one in spaces]))
        return dims, log_prior, np.cumsum([0, *(len(one) for one in spaces[:-1])])

    def densities(self, evidence: Evidence, seen: Seen) -> Array:
        """Log density of residuals under each candidate, over its shapes, (..., K)."""
        if not self.candidates:
            return np.zeros((*np.shape(seen.squares), 0))
        # All spaces at once, which takes half as long as one candidate after the other.
        dims, log_prior, starts = self._spaces
        parts = np.concatenate(seen.parts[: len(starts)], axis=-1)
        logs = evidence.of_spaces(parts, dims, seen.squares) + log_prior
        top = np.maximum.reduceat(logs, starts, axis=-1)
        logs -= np.repeat(top, np.diff(starts, append=len(dims)), axis=-1)
        each = top + np.log(np.add.reduceat(np.exp(logs), starts, axis=-1))
        if self.unknown is None:
            return np.asarray(each)
        unknown = self.unknown.log_density(evidence, seen.parts[-1], seen.squares)
        return np.append(each, unknown[..., None], axis=-1)

    def odds(self, evidence: Evidence, seen: Seen) -> Array:
        """Log odds of each candidate against nothing, (..., K)."""
        nothing = np.logaddexp.reduce(evidence.of_noise(seen.squares), axis=-1)
        return np.asarray(self.densities(evidence, seen) - nothing[..., None])


# --- simulated effects --------------------------------------------------------------------------


def simulated(
    candidates: Sequence[Shapes], conditions: int, count: int, rng: np.random.Generator
) -> Array:
    """Draw what a random candidate adds to so many conditions, (count, conditions).

    Its shape is any of its shapes, and its size one of `PROPOSED`.
    """
    ends = np.cumsum([0, *(len(one.dims) for one in candidates)])
    probable = np.concatenate([one.prior for one in candidates]) / len(candidates)
    drawn = rng.choice(ends[-1], size=count, p=probable)
    sizes = rng.choice(PROPOSED, size=count)
    candidate = np.searchsorted(ends, drawn, side="right") - 1
    dims = np.concatenate([one.dims for one in candidates])[drawn]
    normal = np.split(rng.standard_normal(dims.sum()), np.cumsum(dims)[:-1])
    added = np.zeros((count, conditions))
    for k in np.unique(candidate):
        rows, shapes = np.flatnonzero(candidate == k), candidates[k]
        places = drawn[rows] - ends[k]
        shares = np.concatenate([shapes.shares[place] for place in places])
        variances = np.repeat(sizes[rows], dims[rows]) * shares
        amounts = np.concatenate([normal[row] for row in rows]) * np.sqrt(variances)
        added[rows] = shapes.drawn(places, amounts)
    return added


def log_ratio(candidates: Sequence[Shapes], parts: Sequence[Array]) -> Array:
    """Log ratio of the densities of residuals with such an effect and of noise alone, (b,).

    Parameters
    ----------
    candidates : Shapes
    parts : arrays (b, p), of residuals, by candidate
    """
    logs = []
    for size in PROPOSED.tolist():
        of_size = []
        for shapes, seen in zip(candidates, parts, strict=False):
            taken, growth = shapes.taken(seen, size)
            of_size.append((taken - growth) / 2 + np.log(shapes.prior / len(candidates)))
        logs.append(log_sum(np.concatenate(of_size, axis=-1)))
    return log_mean(np.stack(logs, axis=-1))
