"""Whether a finding holds on positions that were used neither for choosing nor for fitting it.

Held-out positions take no part in choosing or fitting the effect. But a name is only given because
all positions together, the held-out ones among them, seem to have something that the model lacks.
So if nothing is missing and a name is given all the same, the held-out positions support it more
often than at 5 %.

The threshold of the statistic is therefore found by simulating the campaign's own design. Noise
gets a random effect and is weighted back to noise (importance sampling). Of the sets in which
something is found and named, the fitted positions choose an effect and predict the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.decision.posterior import CREDIBLE, Weighing, weigh_pairs
from accelstudy.diagnosis.decision.priors import MANY, SURE
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.refits import best_refit
from accelstudy.diagnosis.decision.verdict import Choice, Finding
from accelstudy.diagnosis.evidence.detection import total_odds
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.hypotheses import (
    Class,
    Singles,
    all_pairs,
    classes_of,
    equivalents,
    weigh_singles,
)
from accelstudy.diagnosis.held_out_places import refit_of_place, simulated_places
from accelstudy.diagnosis.prediction import (
    HELD_OUT,
    SIGNIFICANT,
    HeldOutGap,
    LinearSplit,
    held_out_gap,
    relative_variance,
    split_positions,
)
from accelstudy.diagnosis.space.hypotheses import OUTLIER

Array = NDArray[np.float64]


LEAST = 3
"""Least number of positions to predict."""
BESIDE = 3
"""Other explanations with which a name is compared."""


@dataclass(frozen=True)
class Gap:
    """How far the disagreement shrinks; None where it does not apply.

    Attributes
    ----------
    before, after : float, variance of unit weight of the base fit and of the final one
    held_out : HeldOutGap, on positions that were used neither for choosing nor for fitting
    confirmed : bool, whether it is confirmed that such an effect is missing
    reason : str, why nothing is confirmed; empty if it is, or if the test did not
    names : tuple of str, of which one is confirmed against all others: what was found, with all
        that could leave the same; empty if that is open
    """

    before: float
    after: float | None = None
    held_out: HeldOutGap | None = None
    confirmed: bool = False
    reason: str = ""
    names: tuple[str, ...] = ()

    @property
    def statement(self) -> str | None:
        """What is confirmed: "name", that it is this effect, or "effect", that there is one."""
        if not self.confirmed:
            return None
        return "name" if len(self.names) == 1 else "effect"


def measured_gap(finding: Finding, base: Solution) -> Gap:
    """Compare the models on the positions to which they were fitted."""
    before = base.omega / base.redundancy
    if not finding.chosen:
        return Gap(before)
    final = finding.frame.solution
    return Gap(before, final.omega / final.redundancy * relative_variance(final, base))


def predicted_gap(
    gap: Gap,
    problem: Problem,
    weighing: Weighing,
    finding: Finding,
    beyond: float,
    known: float | None,
    seeds: Sequence[np.random.SeedSequence],
) -> Gap:
    """Choose and fit on a part of the positions, and predict the rest.

    Parameters
    ----------
    gap : Gap, on the positions to which the models were fitted
    problem, weighing : Problem, Weighing, of all positions
    finding : Finding, with what was chosen
    beyond : float, total evidence from which on something counted as missing
    known : float, variance of unit weight; None takes that of the fit to the part
    seeds : of the split, the resampling, and the simulation
    """
    frame, first = problem.frame, problem.base.solution
    n, c = len(first.misclosures), first.approach.n_conditions
    k = sum(choice.best.dim for choice in finding.chosen)
    needed = int(np.ceil((first.design.shape[1] + k + 3) / c))
    count = min(round(n * HELD_OUT), n - needed)
    if count < LEAST:
        reason = (
            f"no held-out positions: choosing and fitting needs {needed} positions and at least "
            f"{LEAST} are to be predicted, {needed + LEAST} in all; there are {n}"
        )
        return replace(gap, reason=reason)
    rng = np.random.default_rng(seeds[0])
    fitted, held = split_positions(frame.forces, frame.hold, count, rng)
    try:
        base = solve(first.model, first.approach, first.observed.take(fitted))
    except (InputError, np.linalg.LinAlgError):
        return replace(gap, reason="the fitted positions do not determine the model")
    part = pose(replace(problem.base, solution=base))
    singles = weigh_singles(part.examined, part.field, part.evidence)
    place = finding.place
    if place is None:
        chosen, others = _chosen_alike(part, singles, finding)
        refit = _refit(part, singles, chosen)
    else:
        refit, others = refit_of_place(part, singles, place, finding.chosen[1:])
    if isinstance(refit, str):
        return replace(gap, reason=refit)
    rest, rng = first.observed.take(held), np.random.default_rng(seeds[1])
    test = held_out_gap(base, refit, rest, held, known, rng)
    if others:
        another = "effect" if place is None else "coordinate or target"
        reason = f"the fitted positions alone would have chosen another {another}"
        return replace(gap, held_out=test, reason=reason)
    rng = np.random.default_rng(seeds[2])
    split = LinearSplit(frame, fitted, held)
    if place is None:
        least = threshold(problem, weighing.classes, beyond, part, split, rng)
    else:
        least = _exceeded(*simulated_places(problem, place, beyond, SETS, part, split, rng))
    test = replace(test, needed=least)
    gap = replace(gap, held_out=test, confirmed=test.significant)
    alone = finding.verdict == "named" and len(finding.chosen) == 1
    if not gap.confirmed or not alone:
        return gap
    (choice,) = finding.chosen
    # What was found, and all that could leave the same in this campaign.
    imitators = problem.examined.imitators(choice.best)
    names = tuple(dict.fromkeys((choice.best.name, *choice.members, *imitators)))
    sure = _is_of(names, problem, part, finding, split)
    return replace(gap, names=names) if sure else gap


def _chosen_alike(
    part: Problem, singles: Singles, finding: Finding
) -> tuple[Sequence[Choice], bool]:
    """Explanation of the credible set that a part chooses, and whether it would choose another."""
    chosen, credible = finding.chosen, finding.alternatives
    if len(chosen) > 1:
        members = equivalents(part.examined, singles)
        classes, together = classes_of(singles, members), []
        if len(classes) > 1:
            together = all_pairs(singles.shapes, part.residuals, part.evidence)
        pairs = weigh_pairs(together, singles, members, classes)
        pairs = [one for one in pairs if len(one.best) == len(chosen)]
        best = max(pairs, key=lambda one: one.log_weight, default=None)
        same = [one for one in credible if best and _same(one.classes, best.names)]
        if best is None or not same:
            return chosen, True
        p = same[0].posterior
        return [Choice(h, m, p) for h, m in zip(best.best, best.classes, strict=True)], False
    wanted = {
        name: members
        for one in credible
        if len(one.names) == 1
        for members in one.classes
        for name in members
    }
    name = max(singles.densities, key=singles.densities.__getitem__, default="")
    if name not in wanted:
        return chosen, True
    return [Choice(singles.best[name], wanted[name], chosen[0].probability)], False


def _same(classes: Sequence[Sequence[str]], names: Sequence[str]) -> bool:
    """Whether names are each of another one of some classes."""
    return len(classes) == len(names) and any(
        all(name in alike for name, alike in zip(order, classes, strict=True))
        for order in permutations(names)
    )


def _refit(part: Problem, singles: Singles, chosen: Sequence[Choice]) -> Solution | str:
    """Fit to a part with what was chosen, or say why that cannot be."""
    alternatives = []
    for choice in chosen:
        shown = tuple(m for m in choice.members if m in singles.best)
        if not shown:
            return f"the fitted positions alone cannot show {choice.best.name}"
        alternatives.append((singles.best[shown[0]], shown))
    fit = best_refit(part.examined, singles, alternatives)
    return "the fit to the fitted positions alone has no solution" if fit is None else fit[1]


def _is_of(
    group: Sequence[str], problem: Problem, part: Problem, finding: Finding, split: LinearSplit
) -> bool:
    """Whether held-out positions by themselves prefer some names to the other explanations."""
    assert finding.posterior is not None
    left, missed = split.beside(problem.residuals.errors[None])
    variance = 1.0 if part.evidence.level.known else part.residuals.variance
    logs, of_group = [], []
    for one in finding.posterior.told[: BESIDE + 1]:
        if len(one.best) == 1 and one.best[0].effect is not None:
            rest = missed - split.corrections(one.best[0], left)
            logs.append(-float(np.sum(rest**2)) / (2 * variance))
            of_group.append(one.names[0] in group)
    return bool(np.sum(softmax(logs)[of_group]) >= SURE)


SETS = 800
"""Simulated sets of residuals."""
LEVEL = 0.05
"""Probability that a name is confirmed though nothing is missing."""


def threshold(
    problem: Problem,
    classes: Sequence[Class],
    beyond: float,
    part: Problem,
    split: LinearSplit,
    rng: np.random.Generator,
) -> float:
    """Value that the statistic exceeds with 5 %, if nothing is missing and a name was given.

    Parameters
    ----------
    problem : Problem, of all positions
    classes : of its candidates
    beyond : float, total evidence from which on something counts as missing
    part : Problem, of the fitted positions
    split : LinearSplit
    rng : Generator
    """
    residuals, field = problem.residuals, problem.field
    added = field.with_effects(np.zeros((SETS, len(residuals.design))), rng)
    noise = rng.standard_normal(added.shape) + residuals.project(added.T).T
    z = residuals.project(noise.T).T
    parts, squares = field.parts(z), np.sum(z**2, axis=-1)
    odds = field.odds(problem.evidence, parts, squares)
    label = _labels(classes)
    named, top = _named(odds, [label[name] for name in field.names])
    sets = np.flatnonzero(named & (total_odds(odds) > beyond))
    if not len(sets):
        return SIGNIFICANT
    weights = np.exp(-field.proposal(parts[sets]))
    chosen, values = _on_the_part(part, split, noise[sets], rng)
    confirmed = np.array([label.get(name, -2) for name in chosen]) == top[sets]
    return _exceeded(values, weights, confirmed)


def _exceeded(values: Array, weights: Array, confirmed: NDArray[np.bool_]) -> float:
    """Value that `confirmed` values (s,) with weights exceed with the probability `LEVEL`."""
    if not len(values):
        return SIGNIFICANT
    order = np.argsort(-values)
    rate = np.cumsum(np.where(confirmed, weights, 0.0)[order]) / weights.sum()
    place = min(int(np.searchsorted(rate, LEVEL)), len(order) - 1)
    return max(SIGNIFICANT, float(values[order[place]]))


def _labels(classes: Sequence[Class]) -> dict[str, int]:
    """Number of the class of each candidate; a bumped position and the unknown have none."""
    labels = {name: i for i, (_, names) in enumerate(classes) for name in names}
    return {**labels, OUTLIER: -1, UNKNOWN: -1}


def _named(logs: Array, labels: list[int]) -> tuple[NDArray[np.bool_], NDArray[np.int_]]:
    """Whether residuals would be given a name or few, (b,), and the class that comes first."""
    classes, of = sorted(set(labels) - {-1}), np.array(labels)
    each = np.column_stack([*(logs[:, of == c].max(axis=1) for c in classes), logs[:, of < 0]])
    p = np.exp(each - each.max(axis=1, keepdims=True))
    p /= p.sum(axis=1, keepdims=True)
    few = np.sort(p, axis=1)[:, -MANY:].sum(axis=1) >= CREDIBLE
    first = np.argmax(p, axis=1)
    effect = first < len(classes)
    top = np.array([*classes, *[-1] * (each.shape[1] - len(classes))])[first]
    return effect & ((p.max(axis=1) >= SURE) | few), top


def _on_the_part(
    part: Problem, split: LinearSplit, noise: Array, rng: np.random.Generator
) -> tuple[list[str], Array]:
    """What the fitted positions choose of noise (b, m), and the held-out statistic, (b,)."""
    candidate, shape = _choices(part, split.residuals(part.residuals, noise))
    left, missed = split.beside(noise)
    variance = split.variances(left, part.evidence.level.known)
    names, values = tuple(part.field.candidates), np.zeros(len(noise))
    for k in np.unique(candidate):
        if names[k] == OUTLIER:
            continue
        places, which = np.unique(shape[candidate == k], return_inverse=True)
        hypotheses = [part.examined.candidates[names[k]][int(place)] for place in places]
        rows = np.flatnonzero(candidate == k)
        for i, (fit, rest) in enumerate(split.predictors(hypotheses)):
            some = rows[which == i]
            change = left[some] @ fit @ rest
            values[some] = split.statistic(change, missed[some], variance[some])
    return [names[k] for k in candidate], values


def _choices(part: Problem, z: Array) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Candidate that explains most, and which of its shapes, for each of residuals (b, m)."""
    field = part.field.named
    logs = field.of_shapes(part.evidence, field.parts(z), np.sum(z**2, axis=-1))
    candidate = np.argmax(field.combined(logs), axis=1)
    shape = np.zeros(len(z), dtype=int)
    for k in np.unique(candidate):
        rows = np.flatnonzero(candidate == k)
        shape[rows] = np.argmax(logs[rows, field.starts[k] : field.starts[k + 1]], axis=1)
    return candidate, shape
