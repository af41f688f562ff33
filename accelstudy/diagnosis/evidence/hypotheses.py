"""The evidence for each hypothesis, by itself and together with another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.field import Field
from accelstudy.diagnosis.evidence.size import Evidence
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.examined import ExaminedFit
from accelstudy.diagnosis.space.hypotheses import (
    OUTLIER,
    BumpedPositions,
    EffectShapes,
    Hypotheses,
    Hypothesis,
    log_sum,
)
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import LearnedShapes

Array = NDArray[np.float64]


ROWS = 4096
"""Conditions in one block of work."""

Class: TypeAlias = tuple[Hypothesis, tuple[str, ...]]
"""A hypothesis, and all names that mean the same in this campaign."""


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


def weigh_singles(examined: ExaminedFit, field: Field, evidence: Evidence) -> Singles:
    """Weigh each candidate by itself.

    Parameters
    ----------
    examined : ExaminedFit
    field : Field, all its candidates, in the shapes that are tried at first
    evidence : Evidence
    """
    z = examined.frame.residuals.z
    if not examined.candidates:
        return Singles({}, {}, {}, {})
    named = field.named
    densities = named.densities(evidence, named.seen(z))
    first = dict(zip(named.names, densities.tolist(), strict=True))
    least = max(first.values()) - RULES.refined_within
    shapes, logs, best = dict[str, Hypotheses](), dict[str, Array](), dict[str, Hypothesis]()
    for name, tried in examined.candidates.items():
        worth = first[name] > least
        own = refined(examined, tried) if worth else tried
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
        members[name] = tuple(sorted({*examined.alike(probable), name}))
    return members


def classes_of(singles: Singles, members: Mapping[str, tuple[str, ...]]) -> list[Class]:
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
        classes.append((singles.best[name], same))
    return classes


def refined(examined: ExaminedFit, shapes: Hypotheses) -> Hypotheses:
    """Add shapes between the neighbours of the best one, and again between those."""
    z = examined.frame.residuals.z
    if not isinstance(shapes, EffectShapes) or len(shapes) < 2:
        return shapes
    if shapes[0].smooth is None:
        return _completed(examined, shapes)
    for _ in range(RULES.refinements):
        best = int(np.argmax(shapes.parts(z)))
        around = (shapes[max(best - 1, 0)].value, shapes[min(best + 1, len(shapes) - 1)].value)
        tried = _all_shaped(
            examined, shapes[best], np.geomspace(*around, RULES.refined_shapes + 2)[1:-1]
        )
        fine = [*shapes, *(h for h in tried if h is not None)]
        shapes = EffectShapes.of(sorted(fine, key=lambda h: h.value))
    return shapes


def shaped(examined: ExaminedFit, hypothesis: Hypothesis, value: float) -> Hypothesis | None:
    """Return a smooth effect with another value of its setting; None if less of it shows."""
    return _all_shaped(examined, hypothesis, [value])[0]


def _all_shaped(
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


def _completed(examined: ExaminedFit, shapes: EffectShapes) -> EffectShapes:
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
    hypothesis: Hypothesis, unknown: LearnedShapes, residuals: Residuals, evidence: Evidence
) -> float | None:
    """Log evidence of something unknown beside a hypothesis, against the hypothesis alone.

    None where no shape has anything of its own beside it.
    """
    rest, left = unknown.beside(hypothesis.basis), residuals.beside(hypothesis.basis)
    if not rest.places:
        return None
    evidence = replace(evidence, redundancy=left.redundancy)
    squares = left.z @ left.z
    density = rest.log_density(evidence, rest.parts(left.z), squares)
    return float(density - np.logaddexp.reduce(evidence.of_noise(squares)))


@dataclass(frozen=True)
class Together:
    """Two candidates in their best shapes, and the log density of the residuals with both."""

    best: tuple[Hypothesis, ...]
    log_density: float


def all_pairs(
    candidates: Mapping[str, Hypotheses], residuals: Residuals, evidence: Evidence
) -> list[Together]:
    """Evidence for all pairs of candidates, over all shapes of both.

    Of the bumped positions only the `paired_positions` of the rules that explain most by themselves
    are tried; pairs with the others count as pairs without any evidence.

    Parameters
    ----------
    candidates : mapping of name to shapes
    residuals : Residuals
    evidence : Evidence
    """
    z, r = residuals.z, residuals.redundancy
    tried, weights = _tried(candidates, z)
    if len(tried) < 2:
        return []
    names = [h.name for h in tried]
    order = {name: i for i, name in enumerate(dict.fromkeys(names))}
    number = np.array([order[name] for name in names])
    dims = np.array([h.dim for h in tried])
    products = _Products.of(tried, z)
    one, other = np.triu_indices(len(tried), 1)
    # Shapes of one effect are alternatives, but two positions may both be bumped.
    apart = (number[one] != number[other]) | (number[one] == order.get(OUTLIER, -1))
    apart &= dims[one] + dims[other] < r
    one, other = one[apart], other[apart]
    part, independent = np.zeros(len(one)), np.zeros(len(one), dtype=bool)
    # The smaller space is taken beside the larger one, which is less to compute.
    large = np.where(dims[one] < dims[other], other, one)
    small = one + other - large
    sizes = dims[large] * r + dims[small]
    for size in np.unique(sizes):
        alike = np.flatnonzero(sizes == size)
        for some in np.array_split(alike, len(alike) // ROWS + 1):
            part[some], independent[some] = products.of_both(large[some], small[some])
    if not independent.any():
        return []
    one, other, part = one[independent], other[independent], part[independent]
    logs = evidence.of_spaces(part, dims[one] + dims[other], float(z @ z))
    weighted = logs + np.log(weights[one]) + np.log(weights[other])
    keys = number[one] * len(order) + number[other]
    sequence = np.argsort(keys, kind="stable")
    starts = np.flatnonzero(np.diff(keys[sequence], prepend=-1))
    groups = np.split(sequence, starts[1:])
    totals = np.logaddexp.reduceat(weighted[sequence], starts)
    top, pairs = -np.inf, dict[int, Together]()
    for k in np.argsort(-totals, kind="stable").tolist():
        alike = groups[k]
        a, b = one[alike], other[alike]
        for some, beside in ((a, b), (b, a)):
            # What bounds do to pairs of no weight does not matter.
            if tried[some[0]].estimates is not None and totals[k] > top - RULES.pair_within:
                within = _within_bounds(tried, some, beside, weighted[alike], z, evidence)
                logs[alike] += within
                weighted[alike] += within
        best = int(np.argmax(logs[alike]))
        twice = np.log(2.0) if number[a[best]] == number[b[best]] else 0.0
        total = float(np.logaddexp.reduce(weighted[alike]) + twice)
        top = max(top, total)
        pairs[k] = Together((tried[a[best]], tried[b[best]]), total)
    return [pairs[k] for k in range(len(groups))]


def _within_bounds(
    tried: Sequence[Hypothesis],
    some: NDArray[np.int_],
    beside: NDArray[np.int_],
    weighted: Array,
    z: Array,
    evidence: Evidence,
) -> Array:
    """Factors of bounds on shapes of one effect beside others, (j,), as logs.

    They are those of the pairs with the most evidence; for all others the least of these stands.
    """
    most = np.argsort(-weighted, kind="stable")[: RULES.pair_shapes]
    found = within_bounds(
        [tried[i] for i in some[most]], z, evidence, [tried[i].basis for i in beside[most]]
    )
    within = np.full(len(some), found.min())
    within[most] = found
    return within


def _tried(candidates: Mapping[str, Hypotheses], z: Array) -> tuple[list[Hypothesis], Array]:
    """Shapes of which pairs are made, and the prior probability of each in its candidate."""
    tried: list[Hypothesis] = []
    weights: list[Array] = []
    for name, shapes in candidates.items():
        places = np.arange(len(shapes))
        if name == OUTLIER and len(places) > RULES.paired_positions:
            places = np.sort(np.argsort(-shapes.parts(z), kind="stable")[: RULES.paired_positions])
        tried += [shapes[int(k)] for k in places]
        weights.append(shapes.prior[places])
    return tried, np.concatenate(weights) if weights else np.zeros(0)


@dataclass(frozen=True)
class _Products:
    """Products of the columns of the bases of hypotheses.

    Attributes
    ----------
    gram : (Σ l, Σ l) array, of each with each
    seen : (Σ l,) array, of each with residuals
    starts, dims : (h,) int arrays, where the columns of each hypothesis begin, and their number l
    """

    gram: Array
    seen: Array
    starts: NDArray[np.int_]
    dims: NDArray[np.int_]

    @classmethod
    def of(cls, hypotheses: Sequence[Hypothesis], z: Array) -> _Products:
        """Multiply the bases of hypotheses (m, l) with each other and with residuals z (m,)."""
        dims = np.array([h.dim for h in hypotheses])
        starts = np.cumsum(dims) - dims
        gram = np.zeros((dims.sum(),) * 2)
        seen = np.zeros(len(gram))
        # In blocks of conditions: all bases together would need twice the memory.
        for rows in np.array_split(np.arange(len(z)), len(z) // ROWS + 1):
            part = np.concatenate([h.basis[rows[0] : rows[-1] + 1] for h in hypotheses], axis=1)
            gram += part.T @ part
            seen += z[rows] @ part
        return cls(gram, seen, starts, dims)

    def of_both(
        self, large: NDArray[np.int_], small: NDArray[np.int_]
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Squares of what residuals have in two spaces together, and whether these are two.

        (j,) each. All large ones have one dimension, and all small ones.
        """
        a, b = (
            self.starts[places][:, None] + np.arange(self.dims[places[0]])
            for places in (large, small)
        )
        cross = self.gram[a[:, :, None], b[:, None, :]]
        left = np.eye(b.shape[1]) - np.swapaxes(cross, 1, 2) @ cross
        if b.shape[1] == 1:
            values, vectors = left[:, 0], np.ones_like(left)
        else:
            values, vectors = np.linalg.eigh(left)
        rest = self.seen[b] - np.einsum("jab,ja->jb", cross, self.seen[a])
        along = np.einsum("jab,ja->jb", vectors, rest) ** 2
        part = np.sum(self.seen[a] ** 2, axis=1)
        part += np.sum(along / np.maximum(values, RULES.collinear), axis=1)
        return part, values[:, 0] > RULES.collinear
