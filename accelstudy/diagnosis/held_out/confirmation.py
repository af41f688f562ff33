"""Whether a finding holds on positions that were used neither for choosing nor for fitting it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.decision.priors import SURE
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.decision.verdict import Choice, Finding
from accelstudy.diagnosis.held_out.gap import HELD_OUT, HeldOutGap, held_out_gap, split_positions
from accelstudy.diagnosis.held_out.given_a_name import needed_z
from accelstudy.diagnosis.held_out.linear import LinearSplit

Array = NDArray[np.float64]

LEAST = 3
"""Least number of positions to predict."""
BESIDE = 3
"""Other explanations with which a name is compared."""


@dataclass(frozen=True)
class HeldOut:
    """What held-out positions say of a finding.

    Attributes
    ----------
    gap : HeldOutGap or None
    reason : str, why nothing is confirmed; empty if it is
    confirmed : bool, whether such an effect is confirmed
    names : tuple of str, of which one is confirmed against all others; empty if none is
    """

    gap: HeldOutGap | None
    reason: str
    confirmed: bool = False
    names: tuple[str, ...] = ()


def held_out(
    search: Search,
    finding: Finding,
    known: float | None,
    level: float,
    seeds: Sequence[np.random.SeedSequence],
) -> HeldOut:
    """Choose and fit on a part of the positions, and predict the rest.

    Parameters
    ----------
    search : Search, of all positions
    finding : Finding, named or narrowed
    known : float, variance of unit weight; None takes that of the fit to the part
    level : float, of the test that found something
    seeds : of the split, the resampling, the part, and the simulation
    """
    frame, first = search.examined.frame, search.first
    n, c = len(first.misclosures), search.first.approach.n_conditions
    k = sum(choice.best.dim for choice in finding.chosen)
    needed = int(np.ceil((first.design.shape[1] + k + 3) / c))
    count = min(round(n * HELD_OUT), n - needed)
    if count < LEAST:
        return HeldOut(
            None,
            f"no held-out positions: choosing and fitting needs {needed} positions and at least "
            f"{LEAST} are to be predicted, {needed + LEAST} in all; there are {n}",
        )
    rng = np.random.default_rng(seeds[0])
    fitted, held = split_positions(frame.forces, frame.hold, count, rng)
    try:
        base = solve(first.model, first.approach, first.observed.take(fitted))
    except (InputError, np.linalg.LinAlgError):
        return HeldOut(None, "the fitted positions do not determine the model")
    part = Search(base, seeds[2], search.level, search.within)
    chosen, others = _chosen_alike(part, finding)
    refit = _refit(part, chosen)
    if isinstance(refit, str):
        return HeldOut(None, refit)
    rest, rng = first.observed.take(held), np.random.default_rng(seeds[1])
    gap = held_out_gap(base, refit, rest, held, known, rng)
    if others:
        return HeldOut(gap, "the fitted positions alone would have chosen another effect")
    rng = np.random.default_rng(seeds[3])
    split = LinearSplit(frame, fitted, held)
    gap = replace(gap, needed=needed_z(search, part, split, level, rng))
    if not gap.significant:
        return HeldOut(gap, "")
    alone = finding.verdict == "named" and len(finding.chosen) == 1
    group = _group(search, finding.chosen[0]) if alone else ()
    sure = alone and _is_of(group, search, part, finding, split)
    return HeldOut(gap, "", True, group if sure else ())


def _chosen_alike(part: Search, finding: Finding) -> tuple[Sequence[Choice], bool]:
    """Explanation of the credible set that a part chooses, and whether it would choose another."""
    chosen, credible = finding.chosen, finding.credible_set
    if len(chosen) == 2:
        pairs = [one for one in part.pairs if len(one.best) == 2]
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
    name = max(part.densities, key=part.densities.__getitem__, default="")
    if name not in wanted:
        return chosen, True
    return [Choice(part.best_shape(name), wanted[name], chosen[0].probability)], False


def _same(classes: Sequence[Sequence[str]], names: Sequence[str]) -> bool:
    """Whether two names are of two classes, in either order."""
    if len(classes) != 2:
        return False
    (one, other), (a, b) = classes, names
    return (a in one and b in other) or (b in one and a in other)


def _refit(part: Search, chosen: Sequence[Choice]) -> Solution | str:
    """Fit to a part with what was chosen, or say why that cannot be."""
    alternatives = []
    for choice in chosen:
        shown = tuple(m for m in choice.members if m in part.examined.candidates)
        if not shown:
            return f"the fitted positions alone cannot show {choice.best.name}"
        alternatives.append((part.best_shape(shown[0]), shown))
    fit = part.refits.best(alternatives)
    return "the fit to the fitted positions alone has no solution" if fit is None else fit[1]


def _group(search: Search, choice: Choice) -> tuple[str, ...]:
    """Name of an effect, and all that could leave the same in this campaign."""
    others = search.imitators(choice.best, choice.members)
    return tuple(dict.fromkeys((choice.best.name, *choice.members, *others)))


def _is_of(
    group: Sequence[str], search: Search, part: Search, finding: Finding, split: LinearSplit
) -> bool:
    """Whether held-out positions by themselves prefer some names to the other explanations."""
    assert finding.posterior is not None
    left, missed = split.beside(search.residuals.errors[None])
    variance = 1.0 if part.level.known else part.residuals.variance
    logs, own = [], []
    for one in finding.posterior.told[: BESIDE + 1]:
        if len(one.best) == 1 and one.best[0].effect is not None:
            rest = missed - split.corrections(one.best[0], left)
            logs.append(-float(np.sum(rest**2)) / (2 * variance))
            own.append(one.names[0] in group)
    return bool(np.sum(softmax(logs)[own]) >= SURE)
