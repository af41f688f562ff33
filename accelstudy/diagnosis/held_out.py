"""Whether a finding holds on positions that were used neither for choosing nor for fitting it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.special import softmax

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.diagnosis.decision.learned import fit_of_place, most_probable_place
from accelstudy.diagnosis.decision.noise import exceeds_stated, unit_variance
from accelstudy.diagnosis.decision.posterior import Case, Posterior, Weighing
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.verdict import Finding
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.singles import Cause
from accelstudy.diagnosis.held_out_threshold import threshold
from accelstudy.diagnosis.prediction import (
    HeldOutGap,
    LinearSplit,
    held_out_gap,
    relative_variance,
    split_positions,
)
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.shapes import Place


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


def gap_of(case: Case, finding: Finding, seeds: Sequence[np.random.SeedSequence]) -> Gap:
    """Compare the models on the positions to which they were fitted, and on held-out ones.

    Parameters
    ----------
    case : Case
    finding : Finding
    seeds : of the split, the resampling, and the simulated threshold
    """
    base, final = case.problem.base.solution, finding.frame.solution
    before = base.omega / base.redundancy
    if not finding.chosen:
        return Gap(before)
    gap = Gap(before, final.omega / final.redundancy * relative_variance(final, base))
    if finding.verdict == "gross_error":
        return gap
    with stage("held-out positions"):
        return _predicted(case, finding, gap, [np.random.default_rng(seed) for seed in seeds])


def _predicted(case: Case, finding: Finding, gap: Gap, rngs: Sequence[np.random.Generator]) -> Gap:
    """Choose and fit on a part of the positions, and predict the rest."""
    problem, first, place = case.problem, case.problem.base.solution, finding.place
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
    part = Weighing(pose(replace(problem.base, solution=base)))
    chosen, others = _chosen_alike(part, finding)
    refit = _refitted(part, chosen, place)
    if isinstance(refit, str):
        return replace(gap, reason=refit)
    known = problem.evidence.level.known
    variance = unit_variance(problem, finding.frame) if known else None
    test = held_out_gap(base, refit, first.observed.take(held), held, variance, rngs[1])
    if others:
        another = "effect" if place is None else "coordinate or target"
        reason = f"the fitted positions alone would have chosen another {another}"
        return replace(gap, held_out=test, reason=reason)
    split = LinearSplit(problem.frame, fitted, held)
    beyond = case.detection.by_chance.beyond(RULES.level(known))
    test = replace(test, needed=threshold(case, place, beyond, part.problem, split, rngs[2]))
    gap = replace(gap, held_out=test, confirmed=test.significant)
    alone = finding.verdict == "named" and len(finding.chosen) == 1
    # Of what leaves more than the noise the name may be that of something that is not listed.
    if not gap.confirmed or not alone or exceeds_stated(problem, finding.frame):
        return gap
    (cause,) = finding.chosen
    # What was found, and all that could leave the same in this campaign.
    imitators = problem.examined.imitators(cause.shape)
    names = tuple(dict.fromkeys((cause.name, *cause.members, *imitators)))
    sure = _is_of(names, problem, part.problem, finding, split)
    return replace(gap, names=names) if sure else gap


def _chosen_alike(part: Weighing, finding: Finding) -> tuple[Sequence[Cause], bool]:
    """Effects of the credible set that a part chooses, and whether it would choose something else.

    Of a learned function they are what is certain beside it.
    """
    chosen, credible = finding.chosen, finding.alternatives
    if finding.place is not None:
        return chosen[1:], _place_of(part) != finding.place
    if len(chosen) > 1:
        sets = [one for one in part.sets if len(one.best) == len(chosen)]
        best = max(sets, key=lambda one: one.log_weight, default=None)
        same = [one for one in credible if best and _same(one.classes, best.names)]
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


def _same(classes: Sequence[Sequence[str]], names: Sequence[str]) -> bool:
    """Whether names are each of another one of some classes."""
    return len(classes) == len(names) and any(
        all(name in alike for name, alike in zip(order, classes, strict=True))
        for order in permutations(names)
    )


def _refitted(part: Weighing, chosen: Sequence[Cause], place: Place | None) -> Solution | str:
    """Fit to a part with what was chosen, and a function of a place; or say why that cannot be."""
    alternatives = []
    for cause in chosen:
        shown = tuple(m for m in cause.members if m in part.singles.best)
        if not shown:
            return f"the fitted positions alone cannot show {cause.name}"
        alternatives.append(Cause(shown[0], shown, part.singles.best[shown[0]]))
    if place is not None:
        learned = fit_of_place(part.problem, place, [cause.shape for cause in alternatives])
        reason = "the fitted positions alone cannot show such a function"
        return reason if learned is None else learned[1]
    fit = part.refit(alternatives)
    return "the fit to the fitted positions alone has no solution" if fit is None else fit[1]


def _place_of(part: Weighing) -> Place | None:
    """Place that a part chooses for something unknown, alone or beside effects."""
    alone = [one for one in part.alone if one.names == (UNKNOWN,)]
    if not alone:
        return None
    found = most_probable_place(part.problem, Posterior.of([*alone, *part.with_unknown]))
    return None if found is None else found.place


def _is_of(
    group: Sequence[str], problem: Problem, part: Problem, finding: Finding, split: LinearSplit
) -> bool:
    """Whether held-out positions by themselves prefer some names to the other explanations."""
    assert finding.posterior is not None
    errors = problem.residuals.errors[None]
    variance = 1.0 if part.evidence.level.known else part.residuals.variance
    logs, of_group = [], []
    for one in finding.posterior.told[: RULES.held_out_rivals + 1]:
        if len(one.best) == 1 and one.best[0].effect is not None:
            (columns,) = problem.frame.columns(one.best)
            missed = split.beside(errors)[1] - split.corrections(errors, [(0, columns, 0.0)])
            logs.append(-float(np.sum(missed**2)) / (2 * variance))
            of_group.append(one.names[0] in group)
    return bool(np.sum(softmax(logs)[of_group]) >= RULES.sure)
