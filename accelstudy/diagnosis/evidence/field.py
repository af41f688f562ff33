"""All that may be missing, side by side: each candidate with its shapes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.space.hypotheses import Hypotheses, Shapes

Array = NDArray[np.float64]
Ints = NDArray[np.int_]

UNKNOWN = "unknown"
"""Something of one of the learned shapes, or of the attitude alone, that is none of the effects."""


class Seen(NamedTuple):
    """What densities need of residuals: their parts by candidate, (..., p) each, and ‖z‖² (...)."""

    parts: tuple[Array, ...]
    squares: Array


@dataclass(frozen=True)
class Field:
    """Candidates, each with shapes that are alternatives.

    Attributes
    ----------
    candidates : dict of name to shapes, K; what has no name, if it is there, is the last one
    """

    candidates: Mapping[str, Shapes]

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(self.candidates)

    @cached_property
    def named(self) -> list[Hypotheses]:
        """Shapes of the candidates that have names."""
        return [one for one in self.candidates.values() if isinstance(one, Hypotheses)]

    def seen(self, errors: Array) -> Seen:
        """What the densities need of residuals (..., m)."""
        parts = tuple(shapes.parts(errors) for shapes in self.candidates.values())
        return Seen(parts, np.sum(errors**2, axis=-1))

    @cached_property
    def _spaces(self) -> tuple[Ints, Array, Ints]:
        """Dimensions and log prior of all named shapes, (s,), and where those of each begin."""
        dims = np.concatenate([one.dims for one in self.named])
        log_prior = np.log(np.concatenate([one.prior for one in self.named]))
        return dims, log_prior, np.cumsum([0, *(len(one) for one in self.named[:-1])])

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
        if UNKNOWN not in self.candidates:
            return np.asarray(each)
        unknown = self.candidates[UNKNOWN].log_density(evidence, seen.parts[-1], seen.squares)
        return np.append(each, unknown[..., None], axis=-1)

    def odds(self, evidence: Evidence, seen: Seen) -> Array:
        """Log odds of each candidate against nothing, (..., K)."""
        nothing = np.logaddexp.reduce(evidence.of_noise(seen.squares), axis=-1)
        return np.asarray(self.densities(evidence, seen) - nothing[..., None])
