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
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypotheses, Hypothesis, Spaces, log_sum
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import LearnedShapes

Array = NDArray[np.float64]
Ints = NDArray[np.int_]

UNKNOWN = "unknown"
"""Something of one of the learned shapes, or of the attitude alone, that is none of the effects."""


class Projection(NamedTuple):
    """What densities need of residuals: parts in all named and unknown shapes, and ‖z‖²."""

    parts: Array
    of_unknown: Array
    squares: Array


@dataclass(frozen=True)
class Field:
    """Candidates, each with shapes that are alternatives.

    Attributes
    ----------
    candidates : dict of name to shapes, at least one
    unknown : LearnedShapes or None, what has no name, the last candidate
    """

    candidates: Mapping[str, Hypotheses]
    unknown: LearnedShapes | None = None

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return (*self.candidates, *([] if self.unknown is None else [UNKNOWN]))

    @cached_property
    def starts(self) -> Ints:
        """First shape of each named candidate among all, and their number, (K + 1,)."""
        return np.cumsum([0, *(len(one) for one in self.candidates.values())])

    @cached_property
    def spaces(self) -> Spaces:
        """All shapes with names, side by side; the candidates are equally probable."""
        each = [*self.candidates.values()]
        return Spaces(
            np.concatenate([one.prior for one in each]) / len(each),
            tuple(share for one in each for share in one.shares),
            np.concatenate([one.vectors for one in each], axis=1),
        )

    def project(self, errors: Array) -> Projection:
        """What the densities need of residuals (..., m)."""
        beyond = errors[..., :0] if self.unknown is None else self.unknown.parts(errors)
        return Projection(self.spaces.parts(errors), beyond, np.sum(errors**2, axis=-1))

    def densities(self, evidence: Evidence, seen: Projection) -> Array:
        """Log density of residuals under each candidate, over its shapes, (..., K)."""
        starts, prior = self.starts, self.spaces.prior * len(self.candidates)
        logs = self.spaces.logs(evidence, seen.parts, seen.squares) + np.log(prior)
        top = np.maximum.reduceat(logs, starts[:-1], axis=-1)
        logs -= np.repeat(top, np.diff(starts), axis=-1)
        each = top + np.log(np.add.reduceat(np.exp(logs), starts[:-1], axis=-1))
        if self.unknown is None:
            return np.asarray(each)
        unknown = self.unknown.log_density(evidence, seen.of_unknown, seen.squares)
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


def weigh_singles(frame: SessionFit, evidence: Evidence) -> Singles:
    """Weigh each candidate by itself."""
    z, first = frame.residuals.z, dict[str, float]()
    if frame.candidates:
        field = Field(frame.candidates)
        densities = field.densities(evidence, field.project(z))
        first = dict(zip(field.names, densities.tolist(), strict=True))
    least = max(first.values(), default=0.0) - RULES.refined_within
    shapes, logs, best = dict[str, Hypotheses](), dict[str, Array](), dict[str, Hypothesis]()
    for name, tried in frame.candidates.items():
        worth = first[name] > least
        own = refine(frame, tried) if worth else tried
        parts = own.parts(z)
        shapes[name], logs[name] = own, own.logs(evidence, parts, z @ z)
        if worth and own[0].estimates is not None:
            within = np.array([within_bounds(one, z, evidence) for one in own.hypotheses])
            logs[name] = logs[name] + within
            parts = parts + 2 * within
        best[name] = own[int(np.argmax(parts))]
    total = {name: float(log_sum(log + np.log(shapes[name].prior))) for name, log in logs.items()}
    return Singles(shapes, logs, total, best)


def equivalents(frame: SessionFit, singles: Singles) -> dict[str, tuple[str, ...]]:
    """Names that mean the same as each candidate in this campaign, itself included.

    They do if any shapes are the same between which the residuals do not decide.
    """
    members: dict[str, tuple[str, ...]] = {}
    for name, shapes in singles.shapes.items():
        if name == OUTLIER:
            members[name] = (name,)
            continue
        logs = singles.logs[name]
        probable = [shapes[int(i)] for i in np.flatnonzero(logs > logs.max() - RULES.undecided)]
        members[name] = tuple(sorted({*frame.indistinguishable(probable), name}))
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


def refine(frame: SessionFit, shapes: Hypotheses) -> Hypotheses:
    """Add shapes between the neighbours of the best one, and again between those."""
    z = frame.residuals.z
    if shapes[0].place is not None or len(shapes) < 2:
        return shapes
    if shapes[0].smooth is None:
        return _complete(frame, shapes)
    for _ in range(RULES.refinements):
        best = int(np.argmax(shapes.parts(z)))
        around = (shapes[max(best - 1, 0)].value, shapes[min(best + 1, len(shapes) - 1)].value)
        tried = _reshape_all(
            frame, shapes[best], np.geomspace(*around, RULES.refined_shapes + 2)[1:-1]
        )
        fine = [*shapes.hypotheses, *(h for h in tried if h is not None)]
        shapes = Hypotheses.of(sorted(fine, key=lambda h: h.value))
    return shapes


def reshape(frame: SessionFit, hypothesis: Hypothesis, value: float) -> Hypothesis | None:
    """Return a smooth effect with another value of its setting; None if less of it shows."""
    return _reshape_all(frame, hypothesis, [value])[0]


def _reshape_all(
    frame: SessionFit, hypothesis: Hypothesis, values: Iterable[float]
) -> list[Hypothesis | None]:
    """Return one hypothesis per value of the smooth setting; None where less of it shows.

    None stands for settings that cannot be, too.
    """
    assert hypothesis.smooth is not None
    kind, name = type(hypothesis.effect), hypothesis.smooth
    shapes, hold = [kind(**{name: float(f"{v:.6g}")}) for v in values], frame.hold
    return [
        h if h is not None and h.dim == hypothesis.dim and shape.possible(hold) else None
        for h, shape in zip(frame.hypotheses(shapes), shapes, strict=True)
    ]


def _complete(frame: SessionFit, shapes: Hypotheses) -> Hypotheses:
    """Add the shapes next to the best one that were passed over, until none is left."""
    z, hold = frame.residuals.z, frame.hold
    while True:
        best = int(np.argmax(shapes.parts(z)))
        fine = [*shapes.hypotheses]
        for near in (best + 1, best - 1):
            if 0 <= near < len(shapes):
                between = shapes[best].effect.between(shapes[near].effect, hold)
                tried = frame.hypotheses(between)
                fitting = [h for h in tried if h is not None and h.dim == shapes[best].dim]
                fine[max(best, near) : max(best, near)] = fitting
        if len(fine) == len(shapes):
            return shapes
        shapes = Hypotheses.of(fine)


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
