"""What held-out positions must show to confirm a finding: by simulation of the campaign itself.

Held-out positions take no part in choosing or fitting an effect. But a name is only given, or a
function learned, because all positions together, the held-out ones among them, seem to have
something that the model lacks. So if nothing is missing and it is said all the same, the held-out
positions support it more often than at 5 %.

Noise gets a random effect, or a random function of the place that was learned, and is weighted back
to noise (importance sampling). Of the sets in which something is found and said, the fitted
positions choose an effect, or learn a function, and predict the others.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.diagnosis.decision.learned import SIZES, weighted_shapes
from accelstudy.diagnosis.decision.posterior import Weighing
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.evidence.detection import log_ratio, simulated, total_odds
from accelstudy.diagnosis.evidence.field import Seen
from accelstudy.diagnosis.evidence.singles import Cause
from accelstudy.diagnosis.prediction import Group, LinearSplit
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Shapes, log_sum
from accelstudy.diagnosis.space.shapes import Place

Array = NDArray[np.float64]
Ints = NDArray[np.int_]


def threshold(
    weighing: Weighing,
    place: Place | None,
    beyond: float,
    part: Problem,
    split: LinearSplit,
    rng: np.random.Generator,
) -> float:
    """Value that the statistic exceeds with 5 %, if nothing is missing and yet it was said.

    Parameters
    ----------
    weighing : Weighing, of all positions
    place : Place, of which a function was learned in place of a name; None for a name
    beyond : float, total evidence from which on something counts as missing
    part : Problem, of the fitted positions
    split : LinearSplit
    rng : Generator
    """
    problem, label = weighing.problem, labels(weighing.classes)
    residuals, field = problem.residuals, problem.field
    drawn = list[Shapes](field.named)
    if place is not None:
        if problem.unknown is None or part.unknown is None:
            return RULES.z_significant
        drawn = [problem.unknown.at([place])]
        if not len(drawn[0].dims):
            return RULES.z_significant
    added = simulated(drawn, len(residuals.design), RULES.threshold_sets, rng)
    noise = rng.standard_normal(added.shape) + residuals.project(added.T).T
    z = residuals.project(noise.T).T
    seen = field.seen(z)
    odds = field.odds(problem.evidence, seen)
    claimed = learned(problem, seen, place) if place else named(odds, field.names, label)
    sets = np.flatnonzero((claimed >= 0) & (total_odds(odds) > beyond))
    if not len(sets):
        return RULES.z_significant
    weights = np.exp(-log_ratio(drawn, [shapes.parts(z[sets]) for shapes in drawn]))
    noise = noise[sets]
    found, change = (
        by_place(part, split, noise, place) if place else by_name(part, split, noise, label)
    )
    values = split.statistic(change, noise, part.evidence.level.known)
    order = np.argsort(-values)
    confirmed = np.where(found == claimed[sets], weights, 0.0)
    rate = np.cumsum(confirmed[order]) / weights.sum()
    at = min(int(np.searchsorted(rate, RULES.level_confirmed)), len(order) - 1)
    return max(RULES.z_significant, float(values[order[at]]))


def labels(classes: Sequence[Cause]) -> dict[str, int]:
    """Number of the class of each candidate; a bumped position has none."""
    each = ((name, i) for i, one in enumerate(classes) for name in one.members)
    return {name: i for name, i in each if name != OUTLIER}


def named(odds: Array, names: Sequence[str], label: Mapping[str, int]) -> Ints:
    """Class that residuals would be given as a name, alone or among few, (b,); −1 for none.

    Parameters
    ----------
    odds : (b, K) array, log odds of each candidate
    names : of these
    label : of `labels`
    """
    of = np.array([label.get(name, -1) for name in names])
    classes = np.unique(of[of >= 0])
    each = np.column_stack([*(odds[:, of == c].max(axis=1) for c in classes), odds[:, of < 0]])
    p = softmax(each, axis=1)
    few = np.sort(p, axis=1)[:, -RULES.many :].sum(axis=1) >= RULES.credible
    top = np.append(classes, np.full(each.shape[1] - len(classes), -1))[np.argmax(p, axis=1)]
    return np.where((p.max(axis=1) >= RULES.sure) | few, top, -1)


def by_name(
    part: Problem, split: LinearSplit, noise: Array, label: Mapping[str, int]
) -> tuple[Ints, Array]:
    """Class that the fitted positions choose of noise (b, m), and the corrections that it makes."""
    field, z = part.named, split.residuals(part.residuals, noise)
    seen, names = field.seen(z), field.names
    candidate = np.argmax(field.densities(part.evidence, seen), axis=1)

    def groups() -> Iterator[Group]:
        for k in np.unique(candidate[[names[k] != OUTLIER for k in candidate]]):
            shapes, rows = field.named[k], np.flatnonzero(candidate == k)
            logs = shapes.logs(part.evidence, seen.parts[k][rows], seen.squares[rows])
            places, which = np.unique(np.argmax(logs, axis=1), return_inverse=True)
            tried = split.frame.columns([shapes[int(place)] for place in places])
            for i, columns in enumerate(tried):
                yield rows[which == i], columns, 0.0

    found = np.array([label.get(names[k], -2) for k in candidate])
    return found, split.corrections(noise, groups())


def learned(problem: Problem, seen: Seen, place: Place) -> Ints:
    """Whether a function of a place would be learned of residuals, (b,): 0, or −1 if not."""
    field, evidence, unknown = problem.field, problem.evidence, problem.unknown
    assert unknown is not None
    prior = np.log(problem.prior_unknown)
    densities = field.densities(evidence, seen)
    densities[:, :-1] -= np.log(len(field.named))
    densities[:, -1] += prior
    of_place = unknown.of_place(evidence, seen.parts[-1], seen.squares)[place]
    return np.where(np.exp(of_place + prior - log_sum(densities)) >= RULES.sure, 0, -1)


def by_place(part: Problem, split: LinearSplit, noise: Array, place: Place) -> tuple[Ints, Array]:
    """Whether the fitted positions choose a place for noise (b, m), 0, and its corrections."""
    unknown, z, frame = part.unknown, split.residuals(part.residuals, noise), split.frame
    assert unknown is not None
    each = unknown.of_place(part.evidence, unknown.parts(z), np.sum(z**2, axis=1))
    most = np.max([*each.values()], axis=0)
    found = np.where(each.get(place, np.full(len(z), -np.inf)) >= most, 0, -1)
    shapes = weighted_shapes(place, part.frame, part.residuals, z, part.evidence)

    def groups() -> Iterator[Group]:
        best = np.argmax([log_sum(one.logs) for one in shapes], axis=0)
        for i, one in enumerate(shapes):
            sizes = np.argmax(one.logs, axis=1)
            shown = frame.residuals.whitened(frame.signature(one.effect)) * one.effect.deviations
            for size in np.unique(sizes[best == i]):
                yield (best == i) & (sizes == size), shown, one.trace / SIZES[size]

    return found, split.corrections(noise, groups() if shapes else ())
