"""The evidence for each candidate by itself, over all its shapes, and for something unknown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.hypotheses import (
    BumpedPositions,
    EffectShapes,
    Hypotheses,
    Hypothesis,
    Shapes,
    log_sum,
)
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import LearnedShapes

Array = NDArray[np.float64]
Ints = NDArray[np.int_]

UNKNOWN = "unknown"
"""Something of one of the learned shapes, or of the attitude alone, that is none of the effects."""


class Projection(NamedTuple):
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
    def named_shapes(self) -> list[Hypotheses]:
        """Shapes of the candidates that have names."""
        return [one for one in self.candidates.values() if isinstance(one, Hypotheses)]

    def project(self, errors: Array) -> Projection:
        """What the densities need of residuals (..., m)."""
        parts = tuple(shapes.parts(errors) for shapes in self.candidates.values())
        return Projection(parts, np.sum(errors**2, axis=-1))

    @cached_property
    def _spaces(self) -> tuple[Ints, Array, Ints]:
        """Dimensions and log prior of all named shapes, (s,), and where those of each begin."""
        dims = np.concatenate([one.dims for one in self.named_shapes])
        log_prior = np.log(np.concatenate([one.prior for one in self.named_shapes]))
        return dims, log_prior, np.cumsum([0, *(len(one) for one in self.named_shapes[:-1])])

    def densities(self, evidence: Evidence, seen: Projection) -> Array:
        """Log density of residuals under each candidate, over its shapes, (..., K)."""
        if not self.candidates:
            return np.zeros((*np.shape(seen.squares), 0))
        # All spaces at once, which takes half as long as one candidate after the other.
        dims, log_prior, starts = self._spaces
        parts = np.concatenate(seen.parts[: len(starts)], axis=-1)
        logs = evidence.spaces_density(parts, dims, seen.squares) + log_prior
        top = np.maximum.reduceat(logs, starts, axis=-1)
        logs -= np.repeat(top, np.diff(starts, append=len(dims)), axis=-1)
        each = top + np.log(np.add.reduceat(np.exp(logs), starts, axis=-1))
        if UNKNOWN not in self.candidates:
            return np.asarray(each)
        unknown = self.candidates[UNKNOWN].log_density(evidence, seen.parts[-1], seen.squares)
        return np.append(each, unknown[..., None], axis=-1)

    def odds(self, evidence: Evidence, seen: Projection) -> Array:
        """Log odds of each candidate against nothing, (..., K)."""
        nothing = np.logaddexp.reduce(evidence.noise_density(seen.squares), axis=-1)
        return np.asarray(self.densities(evidence, seen) - nothing[..., None])


# --- which shapes explain most, and which names mean the same ------------------------------------


@dataclass(frozen=True)
class Cause:
    """One thing that may be missing or wrong.

    Attributes
    ----------
    name : str: an effect, a noise effect, "outlier_position", "learned" or "unknown"
    members : tuple of str, the names that mean the same in this campaign, itself included
    best : Hypothesis, the shape that explains most; None of noise and of the unknown
    posterior : float, that what is missing is this, where that is asked
    """

    name: str
    members: tuple[str, ...]
    best: Hypothesis | None = None
    posterior: float = np.nan

    @property
    def shape(self) -> Hypothesis:
        """The shape that explains most, where there is one."""
        assert self.best is not None
        return self.best


@dataclass(frozen=True)
class Singles:
    """The evidence for each candidate by itself.

    Attributes
    ----------
    shapes : dict of candidate to shapes, closer together about the best one where it matters
    logs : dict of candidate to the log densities of the residuals under its shapes, (s,)
    densities : dict of candidate to the log density over its shapes
    best : dict of candidate to the shape that explains most
    """

    shapes: Mapping[str, Hypotheses]
    logs: Mapping[str, Array]
    densities: Mapping[str, float]
    best: Mapping[str, Hypothesis]


def weigh_singles(examined: ExaminedFit, evidence: Evidence) -> Singles:
    """Weigh each candidate by itself."""
    z, field = examined.frame.residuals.z, Field(examined.candidates)
    densities = field.densities(evidence, field.project(z))
    first = dict(zip(field.names, densities.tolist(), strict=True))
    least = max(first.values(), default=0.0) - RULES.refined_within
    shapes, logs, best = dict[str, Hypotheses](), dict[str, Array](), dict[str, Hypothesis]()
    for name, tried in examined.candidates.items():
        worth = first[name] > least
        own = refine(examined, tried) if worth else tried
        parts = own.parts(z)
        shapes[name], logs[name] = own, own.logs(evidence, parts, z @ z)
        if worth and own[0].estimates is not None:
            within = within_bounds([*own], z, evidence)
            logs[name] = logs[name] + within
            parts = parts + 2 * within
        best[name] = own[int(np.argmax(parts))]
    total = {name: float(log_sum(log + np.log(shapes[name].prior))) for name, log in logs.items()}
    return Singles(shapes, logs, total, best)


def equivalents(examined: ExaminedFit, singles: Singles) -> dict[str, tuple[str, ...]]:
    """Names that mean the same as each candidate in this campaign, itself included.

    They do if any shapes are the same between which the residuals do not decide.
    """
    members: dict[str, tuple[str, ...]] = {}
    for name, shapes in singles.shapes.items():
        if isinstance(shapes, BumpedPositions):
            members[name] = (name,)
            continue
        logs = singles.logs[name]
        probable = [shapes[int(i)] for i in np.flatnonzero(logs > logs.max() - RULES.undecided)]
        members[name] = tuple(sorted({*examined.indistinguishable(probable), name}))
    return members


def classes_of(singles: Singles, members: Mapping[str, tuple[str, ...]]) -> list[Cause]:
    """Candidates with those that mean the same, strongest evidence first."""
    densities = singles.densities
    left = sorted(densities, key=lambda name: -densities[name])
    classes = []
    while left:
        name = left.pop(0)
        same = members[name]
        alike = [other for other in left if other in same]
        left = [other for other in left if other not in same]
        # Rounding errors must not choose among equally good names: the first one is taken.
        least = densities[name] - RULES.same_evidence
        name = min(other for other in (name, *alike) if densities[other] >= least)
        classes.append(Cause(name, same, singles.best[name]))
    return classes


def refine(examined: ExaminedFit, shapes: Hypotheses) -> Hypotheses:
    """Add shapes between the neighbours of the best one, and again between those."""
    z = examined.frame.residuals.z
    if not isinstance(shapes, EffectShapes) or len(shapes) < 2:
        return shapes
    if shapes[0].smooth is None:
        return _complete(examined, shapes)
    for _ in range(RULES.refinements):
        best = int(np.argmax(shapes.parts(z)))
        around = (shapes[max(best - 1, 0)].value, shapes[min(best + 1, len(shapes) - 1)].value)
        tried = _reshape_all(
            examined, shapes[best], np.geomspace(*around, RULES.refined_shapes + 2)[1:-1]
        )
        fine = [*shapes, *(h for h in tried if h is not None)]
        shapes = EffectShapes.of(sorted(fine, key=lambda h: h.value))
    return shapes


def reshape(examined: ExaminedFit, hypothesis: Hypothesis, value: float) -> Hypothesis | None:
    """Return a smooth effect with another value of its setting; None if less of it shows."""
    return _reshape_all(examined, hypothesis, [value])[0]


def _reshape_all(
    examined: ExaminedFit, hypothesis: Hypothesis, values: Iterable[float]
) -> list[Hypothesis | None]:
    """Return one hypothesis per value of the smooth setting; None where less of it shows.

    None stands for settings that cannot be, too.
    """
    assert hypothesis.effect is not None
    assert hypothesis.smooth is not None
    kind, name = type(hypothesis.effect), hypothesis.smooth
    shapes, hold = [kind(**{name: float(f"{v:.6g}")}) for v in values], examined.frame.hold
    return [
        h if h is not None and h.dim == hypothesis.dim and shape.possible(hold) else None
        for h, shape in zip(examined.frame.hypotheses(shapes), shapes, strict=True)
    ]


def _complete(examined: ExaminedFit, shapes: EffectShapes) -> EffectShapes:
    """Add the shapes next to the best one that were passed over, until none is left."""
    z, hold = examined.frame.residuals.z, examined.frame.hold
    while True:
        best = int(np.argmax(shapes.parts(z)))
        effect = shapes[best].effect
        assert effect is not None
        fine = list(shapes)
        for near in (best + 1, best - 1):
            if 0 <= near < len(shapes):
                other = shapes[near].effect
                assert other is not None
                between = effect.between(other, hold)
                tried = examined.frame.hypotheses(between) if between else []
                fitting = [h for h in tried if h is not None and h.dim == shapes[best].dim]
                fine[max(best, near) : max(best, near)] = fitting
        if len(fine) == len(shapes):
            return shapes
        shapes = EffectShapes.of(fine)


def unknown_beside(
    basis: Array, unknown: LearnedShapes, residuals: Residuals, evidence: Evidence
) -> float | None:
    """Log evidence of something unknown beside a space, against the space alone.

    None where no shape has anything of its own beside it.

    Parameters
    ----------
    basis : (m, l) array, of the space
    unknown : LearnedShapes
    residuals : Residuals
    evidence : Evidence
    """
    rest, left = unknown.orthogonal_to(basis), residuals.orthogonal_to(basis)
    if not rest.places:
        return None
    evidence = replace(evidence, redundancy=left.redundancy)
    squares = left.z @ left.z
    density = rest.log_density(evidence, rest.parts(left.z), squares)
    return float(density - np.logaddexp.reduce(evidence.noise_density(squares)))
