"""Whether a learned function holds on positions that were used neither for its place nor for it.

The fitted positions choose the place anew, and the shape, its length scale and its amplitude. The
threshold is that of `held_out`: noise gets a random function of this place and is weighted back to
noise, and of the sets in which such a function would be learned, the fitted positions predict the
others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.learned import (
    SIZES,
    fit_of_place,
    most_probable_place,
    weighted_shapes,
)
from accelstudy.diagnosis.decision.posterior import Posterior, Weighed, weigh_beside
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.decision.verdict import Choice
from accelstudy.diagnosis.evidence.detection import total_odds
from accelstudy.diagnosis.evidence.field import PROPOSED, UNKNOWN, Unknown
from accelstudy.diagnosis.evidence.hypotheses import Singles, classes_of, equivalents
from accelstudy.diagnosis.evidence.size import log_sum
from accelstudy.diagnosis.prediction import LinearSplit
from accelstudy.diagnosis.space.shapes import Place

Array = NDArray[np.float64]


def refit_of_place(
    part: Problem, singles: Singles, place: Place, certain: Sequence[Choice]
) -> tuple[Solution | str, bool]:
    """Learn a function of a place by a part, and say whether the part would choose another place.

    Parameters
    ----------
    part : Problem
    singles : Singles, of the part
    place : Place
    certain : what is in the model beside the function
    """
    beside = []
    for choice in certain:
        shown = [member for member in choice.members if member in singles.best]
        if not shown:
            return f"the fitted positions alone cannot show {choice.best.name}", False
        beside.append(singles.best[shown[0]])
    fit = fit_of_place(part, place, beside)
    if fit is None:
        return "the fitted positions alone cannot show such a function", False
    return fit[1], _place_of(part, singles) != place


def _place_of(part: Problem, singles: Singles) -> Place | None:
    """Place that a part chooses for something unknown, alone or beside an effect."""
    unknown, z = part.field.unknown, part.residuals.z
    if unknown is None:
        return None
    each = unknown.densities(part.evidence, unknown.parts(z[None]), np.array([z @ z]))
    weight = float(log_sum(each[0]) + np.log(priors.UNKNOWN))
    alone = Weighed((UNKNOWN,), ((UNKNOWN,),), weight)
    classes = classes_of(singles, equivalents(part.examined, singles))
    posterior = Posterior.of([alone, *weigh_beside(part, singles, classes)])
    found = most_probable_place(part, posterior)
    return None if found is None else found.place


def simulated_places(
    problem: Problem,
    place: Place,
    beyond: float,
    sets: int,
    part: Problem,
    split: LinearSplit,
    rng: np.random.Generator,
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Simulate what held-out positions say of a learned function if nothing is missing.

    Parameters
    ----------
    problem : Problem, of all positions
    place : Place
    beyond : float, total evidence from which on something counts as missing
    sets : int, simulated sets of residuals
    part : Problem, of the fitted positions
    split : LinearSplit
    rng : Generator

    Returns
    -------
    values, weights : (s,) arrays, the statistic of sets in which the function would be learned
    same : (s,) bool array, whether the fitted positions choose its place, too
    """
    residuals, field = problem.residuals, problem.field
    unknown, of_part = field.unknown, part.field.unknown
    nothing = np.zeros(0)
    if unknown is None or of_part is None or place not in unknown.shapes.places:
        return nothing, nothing, np.zeros(0, dtype=bool)
    noise = rng.standard_normal((sets, len(residuals.design)))
    noise += _drawn(unknown, place, sets, rng)
    z = residuals.project(noise.T).T
    parts, squares = field.parts(z), np.sum(z**2, axis=1)
    named = field.combined(field.of_shapes(problem.evidence, parts, squares))
    without = unknown.densities(problem.evidence, parts[:, len(field.dims) :], squares)
    of_place = np.array([one == place for one in unknown.places])
    weighed = np.concatenate(
        [named - np.log(len(field.candidates)), without + np.log(priors.UNKNOWN)], axis=1
    )
    share = np.exp(log_sum(without[:, of_place]) + np.log(priors.UNKNOWN) - log_sum(weighed))
    odds = total_odds(field.odds(problem.evidence, parts, squares))
    learned = np.flatnonzero((share >= priors.SURE) & (odds > beyond))
    if not len(learned):
        return nothing, nothing, np.zeros(0, dtype=bool)
    weights = np.exp(-_proposal(unknown, place, z[learned]))
    z = split.residuals(part.residuals, noise[learned])
    logs = of_part.densities(part.evidence, of_part.parts(z), np.sum(z**2, axis=1))
    each = {
        one: log_sum(logs[:, [other == one for other in of_part.places]])
        for one in dict.fromkeys(of_part.places)
    }
    most = np.max([*each.values()], axis=0)
    same = each[place] >= most if place in each else np.zeros(len(learned), dtype=bool)
    return _values(part, place, z, split, noise[learned]), weights, same


def _of_place(unknown: Unknown, place: Place) -> NDArray[np.int_]:
    """Which of the shapes are of a place."""
    return np.flatnonzero([one == place for one in unknown.shapes.places])


def _drawn(unknown: Unknown, place: Place, sets: int, rng: np.random.Generator) -> Array:
    """Random functions of a place, (b, m)."""
    shapes, which = unknown.shapes, _of_place(unknown, place)
    p = shapes.weights[which]
    vectors = shapes.by_shape(shapes.vectors)
    drawn, sizes = rng.choice(which, sets, p=p / p.sum()), rng.choice(PROPOSED, sets)
    changes = np.zeros((sets, len(shapes.vectors)))
    for i in np.unique(drawn):
        rows = np.flatnonzero(drawn == i)
        amounts = rng.standard_normal((len(rows), len(shapes.shares[i])))
        scaled = amounts * np.sqrt(sizes[rows, None] * shapes.shares[i])
        changes[rows] = scaled @ vectors[i].T
    return changes


def _proposal(unknown: Unknown, place: Place, errors: Array) -> Array:
    """Log ratio of the densities of residuals with such a function and of noise alone, (b,)."""
    shapes, which = unknown.shapes, _of_place(unknown, place)
    p = shapes.weights[which] / shapes.weights[which].sum()
    along, logs = shapes.by_shape(shapes.squares(errors)), []
    for i, weight in zip(which, p, strict=True):
        for size in PROPOSED:
            g = size * shapes.shares[i]
            log = along[i] @ (g / (1 + g)) / 2 - np.sum(np.log1p(g)) / 2
            logs.append(log + np.log(weight / len(PROPOSED)))
    return np.logaddexp.reduce(logs)


def _values(part: Problem, place: Place, z: Array, split: LinearSplit, noise: Array) -> Array:
    """Held-out statistic, (b,), of what the fitted positions learn of residuals (b, m)."""
    none = np.zeros((z.shape[1], 0))
    shapes = weighted_shapes(place, part.frame, none, z, part.evidence)
    values = np.zeros(len(z))
    if not shapes:
        return values
    best = np.argmax([log_sum(one.logs) for one in shapes], axis=0)
    left, missed = split.beside(noise)
    variance = split.variances(left, part.evidence.level.known)
    residuals = split.frame.residuals
    for i, one in enumerate(shapes):
        shown = residuals.whitened(split.frame.signature(one.effect)) * one.effect.deviations
        fitted, rest = split.beside(shown.T)
        inner = fitted @ fitted.T
        sizes = np.argmax(one.logs, axis=1)
        for size in np.unique(sizes[best == i]):
            some = np.flatnonzero((best == i) & (sizes == size))
            prior = one.trace / SIZES[size] * np.eye(len(inner))
            change = left[some] @ fitted.T @ np.linalg.inv(inner + prior) @ rest
            values[some] = split.statistic(change, missed[some], variance[some])
    return values
