"""Whether a finding holds on positions that were used neither for choosing nor for fitting it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.diagnosis.decision.functions import (
    SIZES,
    fit_of_place,
    most_probable_place,
    weigh_place,
)
from accelstudy.diagnosis.decision.noise import exceeds_stated, judged_noise
from accelstudy.diagnosis.decision.posterior import Posterior
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause, Projection
from accelstudy.diagnosis.evidence.detection import draw_effects, log_ratio
from accelstudy.diagnosis.evidence.size import log_mean
from accelstudy.diagnosis.prediction import (
    Group,
    HeldOutGap,
    LinearSplit,
    held_out_gap,
    relative_variance,
    split_positions,
)
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Shapes, log_sum
from accelstudy.diagnosis.space.shapes import Place

Array = NDArray[np.float64]
Ints = NDArray[np.int_]


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


def gap_of(problem: Problem, finding: Finding, seeds: Sequence[np.random.SeedSequence]) -> Gap:
    """Compare the models on the positions to which they were fitted, and on held-out ones.

    Parameters
    ----------
    problem : Problem
    finding : Finding
    seeds : of the split and of the simulated threshold
    """
    base, final = problem.base.solution, finding.frame.solution
    before = base.omega / base.redundancy
    if not finding.chosen:
        return Gap(before)
    gap = Gap(before, final.omega / final.redundancy * relative_variance(final, base))
    if finding.verdict == "gross_error":
        return gap
    with stage("held-out positions"):
        return _predict(problem, finding, gap, [np.random.default_rng(seed) for seed in seeds])


def _predict(
    problem: Problem, finding: Finding, gap: Gap, rngs: Sequence[np.random.Generator]
) -> Gap:
    """Choose and fit on a part of the positions, and predict the rest."""
    first, place = problem.base.solution, finding.place
    n, c = len(first.misclosures), first.approach.n_conditions
    k = sum(cause.shape.dim for cause in finding.chosen)
    needed = int(np.ceil((first.design.shape[1] + k + 3) / c))
    count, fewest = min(round(n * RULES.held_out), n - needed), RULES.held_out_least
    if count < fewest:
        reason = (
            f"no held-out positions: choosing and fitting needs {needed} positions and at least "
            f"{fewest} are to be predicted, {needed + fewest} in all; there are {n}"
        )
        return replace(gap, reason=reason)
    fitted, held = split_positions(problem.frame.forces, problem.frame.hold, count, rngs[0])
    try:
        base = solve(first.model, first.approach, first.observed.take(fitted))
    except (InputError, np.linalg.LinAlgError):
        return replace(gap, reason="the fitted positions do not determine the model")
    part = pose(replace(problem.base, solution=base))
    chosen, others = _chosen_alike(part, finding)
    refit = _refit(part, chosen, place)
    if isinstance(refit, str):
        return replace(gap, reason=refit)
    known = problem.evidence.level.known
    variance = judged_noise(problem, finding.frame).variance if known else None
    test = held_out_gap(base, refit, first.observed.take(held), held, variance)
    if others:
        another = "effect" if place is None else "coordinate or target"
        reason = f"the fitted positions alone would have chosen another {another}"
        return replace(gap, held_out=test, reason=reason)
    split = LinearSplit(problem.frame, fitted, held)
    beyond = problem.detection.threshold(RULES.level(known))
    test = replace(test, needed=threshold(problem, place, beyond, part, split, rngs[1]))
    gap = replace(gap, held_out=test, confirmed=test.significant)
    alone = finding.verdict == "named" and len(finding.chosen) == 1
    # Of what leaves more than the noise the name may be that of something that is not listed.
    if not gap.confirmed or not alone or exceeds_stated(problem, finding.frame):
        return gap
    (cause,) = finding.chosen
    # What was found, and all that could leave the same in this campaign.
    imitators = problem.frame.imitators(cause.shape)
    names = tuple(dict.fromkeys((cause.name, *cause.members, *imitators)))
    sure = _prefers(names, problem, part, finding, split)
    return replace(gap, names=names) if sure else gap


def _chosen_alike(part: Problem, finding: Finding) -> tuple[Sequence[Cause], bool]:
    """Effects of the credible set that a part chooses, and whether it would choose something else.

    Of a learned function they are what is certain beside it.
    """
    chosen, credible = finding.chosen, finding.alternatives
    if finding.place is not None:
        return chosen[1:], _place_of(part) != finding.place
    if len(chosen) > 1:
        sets = [one for one in part.sets if len(one.best) == len(chosen)]
        best = max(sets, key=lambda one: one.log_weight, default=None)
        same = [one for one in credible if best and _match(one.classes, best.names)]
        if best is None or not same:
            return chosen, True
        return best.causes, False
    alone = [one.causes[0] for one in credible if len(one.causes) == 1]
    wanted = {name: cause.members for cause in alone for name in cause.members}
    densities = part.singles.densities
    name = max(densities, key=densities.__getitem__, default="")
    if name not in wanted:
        return chosen, True
    return [Cause(name, wanted[name], part.singles.best[name])], False


def _match(classes: Sequence[Sequence[str]], names: Sequence[str]) -> bool:
    """Whether names are each of another one of some classes."""
    return len(classes) == len(names) and any(
        all(name in alike for name, alike in zip(order, classes, strict=True))
        for order in permutations(names)
    )


def _refit(part: Problem, chosen: Sequence[Cause], place: Place | None) -> Solution | str:
    """Fit to a part with what was chosen, and a function of a place; or say why that cannot be."""
    alternatives = []
    for cause in chosen:
        shown = tuple(m for m in cause.members if m in part.singles.best)
        if not shown:
            return f"the fitted positions alone cannot show {cause.name}"
        alternatives.append(Cause(shown[0], shown, part.singles.best[shown[0]]))
    if place is not None:
        learned = fit_of_place(part, place, [cause.shape for cause in alternatives])
        reason = "the fitted positions alone cannot show such a function"
        return reason if learned is None else learned[1]
    fit = part.refit(alternatives)
    return "the fit to the fitted positions alone has no solution" if fit is None else fit[1]


def _place_of(part: Problem) -> Place | None:
    """Place that a part chooses for something unknown, alone or beside effects."""
    alone = [one for one in part.alone if one.names == (UNKNOWN,)]
    if not alone:
        return None
    found = most_probable_place(part, Posterior.of([*alone, *part.with_unknown]))
    return None if found is None else found.place


def _prefers(
    group: Sequence[str], problem: Problem, part: Problem, finding: Finding, split: LinearSplit
) -> bool:
    """Whether held-out positions by themselves prefer some names to the other explanations."""
    errors = problem.residuals.errors[None]
    missed = split.base_residuals(errors)[1]
    variance = 1.0 if part.evidence.level.known else part.residuals.variance
    logs, of_group = [], []
    for one in finding.posterior.reported[: RULES.held_out_rivals + 1]:
        if len(one.best) == 1 and one.best[0].place is None:
            (columns,) = problem.frame.columns(one.best)
            left = missed - split.corrections(errors, [(0, columns, 0.0)])
            logs.append(-float(np.sum(left**2)) / (2 * variance))
            of_group.append(one.names[0] in group)
    return bool(np.sum(softmax(logs)[of_group]) >= RULES.sure)


# --- what held-out positions must show: by simulation of the campaign itself --------------------

# Held-out positions take no part in choosing or fitting an effect. But a name is only given, or a
# function learned, because all positions together, the held-out ones among them, seem to have
# something that the model lacks. So if nothing is missing and it is said all the same, the held-out
# positions support it more often than at 5 %.
#
# Noise gets a random effect, or a random function of the place that was learned, and is weighted
# back to noise (importance sampling). Of the sets in which something is found and said, the fitted
# positions choose an effect, or learn a function, and predict the others.


def threshold(
    problem: Problem,
    place: Place | None,
    beyond: float,
    part: Problem,
    split: LinearSplit,
    rng: np.random.Generator,
) -> float:
    """Value that the statistic exceeds with 5 %, if nothing is missing and yet it was said.

    Parameters
    ----------
    problem : Problem, of all positions
    place : Place, of which a function was learned in place of a name; None for a name
    beyond : float, total evidence from which on something counts as missing
    part : Problem, of the fitted positions
    split : LinearSplit
    rng : Generator
    """
    label, residuals, field = labels(problem.classes), problem.residuals, problem.field
    drawn: Shapes = field.spaces
    if place is not None:
        if problem.unknown is None or part.unknown is None:
            return RULES.z_significant
        drawn = problem.unknown.at([place])
        if not len(drawn.dims):
            return RULES.z_significant
    added = draw_effects(drawn, RULES.threshold_sets, rng)
    noise = rng.standard_normal(added.shape) + residuals.project(added.T).T
    z = residuals.project(noise.T).T
    seen = field.project(z)
    odds = field.odds(problem.evidence, seen)
    claimed = (
        claimed_place(problem, z, seen, place) if place else claimed_names(odds, field.names, label)
    )
    sets = np.flatnonzero((claimed >= 0) & (log_mean(odds) > beyond))
    if not len(sets):
        return RULES.z_significant
    weights = np.exp(-log_ratio(drawn, drawn.parts(z[sets])))
    noise = noise[sets]
    found, change = (
        chosen_place(part, split, noise, place)
        if place
        else chosen_names(part, split, noise, label)
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


def claimed_names(odds: Array, names: Sequence[str], label: Mapping[str, int]) -> Ints:
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


def chosen_names(
    part: Problem, split: LinearSplit, noise: Array, label: Mapping[str, int]
) -> tuple[Ints, Array]:
    """Class that the fitted positions choose of noise (b, m), and the corrections that it makes."""
    field, z = part.named_field, split.residuals(part.residuals, noise)
    seen, names = field.project(z), field.names
    candidate = np.argmax(field.densities(part.evidence, seen), axis=1)

    def groups() -> Iterator[Group]:
        for k in np.unique(candidate):
            if names[k] == OUTLIER:
                continue
            shapes, rows = field.candidates[names[k]], np.flatnonzero(candidate == k)
            along = seen.parts[rows, field.starts[k] : field.starts[k + 1]]
            logs = shapes.logs(part.evidence, along, seen.squares[rows])
            places, which = np.unique(np.argmax(logs, axis=1), return_inverse=True)
            tried = split.frame.columns([shapes[int(place)] for place in places])
            for i, columns in enumerate(tried):
                yield rows[which == i], columns, 0.0

    found = np.array([label.get(names[k], -2) for k in candidate])
    return found, split.corrections(noise, groups())


def claimed_place(problem: Problem, z: Array, seen: Projection, place: Place) -> Ints:
    """Whether a function of a place would be learned of residuals z (b, m): 0, or −1 if not."""
    field, evidence, unknown = problem.field, problem.evidence, problem.unknown
    assert unknown is not None
    prior = np.log(problem.prior_unknown)
    densities = field.densities(evidence, seen)
    densities[:, :-1] -= np.log(len(field.candidates))
    densities[:, -1] += prior
    of_place = unknown.place_densities(evidence, z)[place]
    return np.where(np.exp(of_place + prior - log_sum(densities)) >= RULES.sure, 0, -1)


def chosen_place(
    part: Problem, split: LinearSplit, noise: Array, place: Place
) -> tuple[Ints, Array]:
    """Whether the fitted positions choose a place for noise (b, m), 0, and its corrections."""
    unknown, z = part.unknown, split.residuals(part.residuals, noise)
    assert unknown is not None
    each = unknown.place_densities(part.evidence, z)
    most = np.max([*each.values()], axis=0)
    found = np.where(each.get(place, np.full(len(z), -np.inf)) >= most, 0, -1)
    shapes = weigh_place(place, part.frame, part.residuals, z, part.evidence)

    def groups() -> Iterator[Group]:
        best = np.argmax([log_sum(one.logs) for one in shapes], axis=0)
        for i, one in enumerate(shapes):
            sizes = np.argmax(one.logs, axis=1)
            shown = split.frame.rows(one.effect) * one.effect.deviations
            for size in np.unique(sizes[best == i]):
                yield (best == i) & (sizes == size), shown, one.trace / SIZES[size]

    return found, split.corrections(noise, groups() if shapes else ())
