"""How large the held-out statistic must be, given that an effect was named.

Held-out positions take no part in choosing or fitting the effect. But a name is only given because
all positions together, the held-out ones among them, seem to lack something. So if nothing is
missing and a name is given all the same, the held-out positions support it more often than at 5 %.

The threshold is found by simulating the campaign's own design. Noise gets a random effect and is
weighted back to noise (importance sampling). Of the sets in which something is found and named, the
fitted positions choose an effect and predict the others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.decision.explanations import CREDIBLE
from accelstudy.diagnosis.decision.priors import MANY, SURE
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.evidence.detection import total_odds
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.held_out.gap import SIGNIFICANT
from accelstudy.diagnosis.held_out.linear import LinearSplit
from accelstudy.diagnosis.space.hypotheses import OUTLIER

Array = NDArray[np.float64]

SETS = 800
"""Simulated sets of residuals."""
LEVEL = 0.05
"""Probability that a name is confirmed though nothing is missing."""


def needed_z(
    search: Search, part: Search, split: LinearSplit, level: float, rng: np.random.Generator
) -> float:
    """Value that the statistic exceeds with 5 %, if nothing is missing and a name was given.

    Parameters
    ----------
    search, part : Search, of all positions and of the fitted ones
    split : LinearSplit
    level : float, of the test that found something
    rng : Generator
    """
    residuals, field = search.residuals, search.field
    added = field.with_effects(np.zeros((SETS, len(residuals.design))), rng)
    noise = rng.standard_normal(added.shape) + residuals.project(added.T).T
    z = residuals.project(noise.T).T
    parts, squares = field.parts(z), np.sum(z**2, axis=-1)
    odds = field.odds(search.evidence, parts, squares)
    label = _labels(search)
    named, top = _named(odds, [label[name] for name in field.names])
    found = np.flatnonzero(named & (total_odds(odds) > search.detection.by_chance.beyond(level)))
    if not len(found):
        return SIGNIFICANT
    weights = np.exp(-field.proposal(parts[found]))
    chosen, values = _on_the_part(part, split, noise[found], rng)
    confirmed = np.array([label.get(name, -2) for name in chosen]) == top[found]
    order = np.argsort(-values)
    rate = np.cumsum(np.where(confirmed, weights, 0.0)[order]) / weights.sum()
    beyond = min(int(np.searchsorted(rate, LEVEL)), len(order) - 1)
    return max(SIGNIFICANT, float(values[order[beyond]]))


def _labels(search: Search) -> dict[str, int]:
    """Number of the class of each candidate; a bumped position and the unknown have none."""
    labels = {name: i for i, (_, names) in enumerate(search.classes) for name in names}
    return {**labels, OUTLIER: -1, UNKNOWN: -1}


def _named(logs: Array, labels: list[int]) -> tuple[NDArray[np.bool_], NDArray[np.int_]]:
    """Whether residuals would be given a name or few, (b,), and the class that comes first."""
    classes, own = sorted(set(labels) - {-1}), np.array(labels)
    each = np.column_stack([*(logs[:, own == c].max(axis=1) for c in classes), logs[:, own < 0]])
    p = np.exp(each - each.max(axis=1, keepdims=True))
    p /= p.sum(axis=1, keepdims=True)
    few = np.sort(p, axis=1)[:, -MANY:].sum(axis=1) >= CREDIBLE
    first = np.argmax(p, axis=1)
    effect = first < len(classes)
    top = np.array([*classes, *[-1] * (each.shape[1] - len(classes))])[first]
    return effect & ((p.max(axis=1) >= SURE) | few), top


def _on_the_part(
    part: Search, split: LinearSplit, noise: Array, rng: np.random.Generator
) -> tuple[list[str], Array]:
    """What the fitted positions choose of noise (b, m), and the held-out statistic, (b,)."""
    own = noise[:, split.rows[0]]
    slopes = rng.standard_normal((len(noise), part.residuals.slopes))
    z = part.residuals.project(np.concatenate([own, slopes], axis=1).T).T
    candidate, shape = _choices(part, z)
    left, missed = split.beside(noise)
    variance = np.ones(len(noise))
    if not part.level.known:
        variance = np.sum(left**2, axis=1) / (own.shape[1] - len(split.cofactors))
    names, values = part.field.names, np.zeros(len(noise))
    for k in np.unique(candidate):
        if names[k] == OUTLIER:
            continue
        places, which = np.unique(shape[candidate == k], return_inverse=True)
        hypotheses = [part.examined.candidates[names[k]][int(place)] for place in places]
        rows = np.flatnonzero(candidate == k)
        for i, (fit, rest) in enumerate(split.predictors(hypotheses)):
            some = rows[which == i]
            change = left[some] @ fit @ rest
            slope = change @ split.designs[1]
            size = np.sum(change**2, axis=1) + np.sum((slope @ split.cofactors) * slope, axis=1)
            scale = np.sqrt(size * variance[some])
            # An effect that does not show in the held-out positions says nothing there.
            shown = scale > 0
            values[some] = np.sum(change * missed[some], axis=1) / np.where(shown, scale, np.inf)
    return [names[k] for k in candidate], values


def _choices(part: Search, z: Array) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Candidate that explains most, and which of its shapes, for each of residuals (b, m)."""
    field = part.field
    logs = part.evidence.of_spaces(field.parts(z), field.dims, np.sum(z**2, axis=-1))
    total = field.combined(logs)
    total[:, [k for k, name in enumerate(field.names) if name == UNKNOWN]] = -np.inf
    candidate = np.argmax(total, axis=1)
    shape = np.zeros(len(z), dtype=int)
    ends = [*field.starts[1:], len(field.dims)]
    for k in np.unique(candidate):
        rows = np.flatnonzero(candidate == k)
        shape[rows] = np.argmax(logs[rows, field.starts[k] : ends[k]], axis=1)
    return candidate, shape
