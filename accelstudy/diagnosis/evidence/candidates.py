"""The evidence for each candidate by itself, over all its shapes, and for something unknown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import (
    OUTLIER,
    Hypotheses,
    Hypothesis,
    Spaces,
    cosines,
)
from accelstudy.diagnosis.space.shapes import LearnedShapes

UNKNOWN = "unknown"
"""Something of one of the learned shapes, or of the attitude alone, that is none of the effects."""


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
    def shapes(self) -> list[Hypothesis]:
        """All shapes with names, (s,)."""
        return [one for shapes in self.candidates.values() for one in shapes.hypotheses]

    @cached_property
    def starts(self) -> NDArray[np.int_]:
        """First shape of each named candidate among all, and their number, (K + 1,)."""
        return np.cumsum([0, *(len(one) for one in self.candidates.values())])

    @cached_property
    def spaces(self) -> Spaces:
        """All shapes with names, side by side; the candidates are equally probable."""
        each = [*self.candidates.values()]
        return Spaces(
            np.concatenate([one.prior for one in each]) / len(each),
            np.concatenate([one.dims for one in each]),
            np.concatenate([one.vectors for one in each], axis=1),
        )

    def densities(self, evidence: Evidence, errors: Array) -> Array:
        """Log density of residuals (..., m) under each candidate, over its shapes, (..., K)."""
        starts, prior = self.starts, self.spaces.prior * len(self.candidates)
        logs = self.spaces.logs(evidence, errors) + np.log(prior)
        top = np.maximum.reduceat(logs, starts[:-1], axis=-1)
        logs -= np.repeat(top, np.diff(starts), axis=-1)
        each = top + np.log(np.add.reduceat(np.exp(logs), starts[:-1], axis=-1))
        if self.unknown is None:
            return np.asarray(each)
        return np.append(each, self.unknown.log_density(evidence, errors)[..., None], axis=-1)

    def odds(self, evidence: Evidence, errors: Array) -> Array:
        """Log odds of each candidate against nothing, (..., K)."""
        noise = evidence.noise_density(np.sum(errors**2, axis=-1))
        nothing = np.logaddexp.reduce(noise, axis=-1)
        return np.asarray(self.densities(evidence, errors) - nothing[..., None])


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
    frame : SessionFit, whose candidates they are
    shapes : dict of candidate to shapes, closer together about the best one where it matters
    logs : dict of candidate to the log densities of the residuals under its shapes, (s,)
    best : dict of candidate to the shape that explains most
    """

    frame: SessionFit
    shapes: Mapping[str, Hypotheses]
    logs: Mapping[str, Array]
    best: Mapping[str, Hypothesis]

    @cached_property
    def densities(self) -> dict[str, float]:
        """Log density of the residuals under each candidate, over its shapes."""
        each = self.shapes.items()
        return {name: float(log_mean(self.logs[name], one.prior)) for name, one in each}

    @cached_property
    def members(self) -> dict[str, tuple[str, ...]]:
        """Names that mean the same as each candidate in this campaign, itself included.

        They do if any shapes are the same between which the residuals do not decide.
        """
        members: dict[str, tuple[str, ...]] = {OUTLIER: (OUTLIER,)}
        for name, logs in self.logs.items():
            if name != OUTLIER:
                undecided = np.flatnonzero(logs > logs.max() - RULES.undecided).tolist()
                probable = [self.shapes[name][i] for i in undecided]
                members[name] = tuple(sorted({*self.frame.indistinguishable(probable), name}))
        return members

    @cached_property
    def classes(self) -> list[Cause]:
        """Candidates with those that mean the same, strongest evidence first."""
        densities = self.densities
        left = sorted(densities, key=lambda name: -densities[name])
        classes = []
        while left:
            same = self.members[left[0]]
            alike = [name for name in left if name in same]
            # Rounding errors must not choose among equally good names: the first one is taken.
            least = densities[left[0]] - RULES.same_evidence
            name = min(name for name in alike if densities[name] >= least)
            classes.append(Cause(name, same, self.best[name]))
            left = [name for name in left if name not in alike]
        return classes

    def cosine(self, name: str, other: str) -> float:
        """Canonical cosine of the best shapes of two candidates; 0 of what is no candidate."""
        one, two = self.best.get(name), self.best.get(other)
        return 0.0 if one is None or two is None else float(cosines(one.ideal, two.ideal)[0])


def weigh_singles(frame: SessionFit, evidence: Evidence) -> Singles:
    """Weigh each candidate by itself."""
    z, first = frame.residuals.z, dict[str, float]()
    if frame.candidates:
        field = Field(frame.candidates)
        first = dict(zip(field.names, field.densities(evidence, z).tolist(), strict=True))
    least = max(first.values(), default=0.0) - RULES.refined_within
    shapes, logs, best = dict[str, Hypotheses](), dict[str, Array](), dict[str, Hypothesis]()
    for name, tried in frame.candidates.items():
        worth = first[name] > least
        own = refine(frame, tried) if worth else tried
        parts, logs[name], shapes[name] = own.parts(z), own.logs(evidence, z), own
        if worth and own[0].estimates is not None:
            within = np.array([within_bounds(one, z, evidence) for one in own.hypotheses])
            logs[name] = logs[name] + within
            parts = parts + 2 * within
        best[name] = own[int(np.argmax(parts))]
    return Singles(frame, shapes, logs, best)


def refine(frame: SessionFit, shapes: Hypotheses) -> Hypotheses:
    """Add shapes between the neighbours of the best one, and again between those."""
    z = frame.residuals.z
    if shapes[0].outlier is not None or len(shapes) < 2:
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
