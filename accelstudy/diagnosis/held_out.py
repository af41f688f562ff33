"""Whether a finding holds on positions that were used neither for choosing nor for fitting it.

Base model and extended model are fitted to some positions and predict the others. With r the
misclosures of unit weight that the base model leaves there, A₂ their derivatives, C the cofactors
of the base parameters and d = r − r' the correction that the extended model makes,

    z = dᵀr / √(dᵀ (I + A₂ C A₂ᵀ) d)

is standard normal if the base model is complete, whatever effect was chosen on the fitted
positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from numpy.typing import NDArray
from scipy.special import softmax

from accelstudy.adjustment import Observations
from accelstudy.adjustment.quality import Solution, solve
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import stage
from accelstudy.diagnosis.decision.functions import fit_of_place, most_probable_place
from accelstudy.diagnosis.decision.posterior import Posterior
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.refits import refit
from accelstudy.diagnosis.decision.statement import Finding
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Hypothesis
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import Place
from accelstudy.effects import HoldConditions


@dataclass(frozen=True)
class Confirmation:
    """What held-out positions confirm of a finding.

    Attributes
    ----------
    test : HeldOutTest or None, on positions that were used neither for choosing nor for fitting
    reason : str, why nothing is confirmed, whatever the test says; empty if the test decides
    names : tuple of str, of which one is confirmed against all others: what was found, with all
        that could leave the same; empty if that is open
    """

    test: HeldOutTest | None = None
    reason: str = ""
    names: tuple[str, ...] = ()

    @property
    def confirmed(self) -> bool:
        """Whether it is confirmed that such an effect is missing."""
        return self.test is not None and self.test.significant and not self.reason

    @property
    def statement(self) -> str | None:
        """What is confirmed: "name", that it is this effect, or "effect", that there is one."""
        if not self.confirmed:
            return None
        return "name" if len(self.names) == 1 else "effect"


def confirm(problem: Problem, finding: Finding, seed: np.random.SeedSequence) -> Confirmation:
    """Compare the base model and the final one on held-out positions, if effects were chosen.

    Parameters
    ----------
    problem : Problem
    finding : Finding
    seed : SeedSequence, of the split
    """
    if not finding.chosen or finding.verdict == "gross_error":
        return Confirmation()
    with stage("held-out positions"):
        return _confirm(problem, finding, np.random.default_rng(seed))


def _confirm(problem: Problem, finding: Finding, rng: np.random.Generator) -> Confirmation:
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
        return Confirmation(reason=reason)
    fitted, held = split_positions(problem.frame.forces, problem.frame.hold, count, rng)
    try:
        base = solve(first.model, first.approach, first.observed.take(fitted))
    except (InputError, np.linalg.LinAlgError):
        return Confirmation(reason="the fitted positions do not determine the model")
    part = pose(replace(problem.base, solution=base))
    chosen, others = _chosen_alike(part, finding)
    refitted = _refit(part, chosen, place)
    if isinstance(refitted, str):
        return Confirmation(reason=refitted)
    known, final = problem.evidence.level.known, finding.frame.solution
    variance = final.judge_noise(known).variance if known else None
    rest = first.observed.take(held)
    test = held_out_test(base, refitted, rest, held, variance)
    if others:
        another = "effect" if place is None else "coordinate or target"
        return Confirmation(test, f"the fitted positions alone would have chosen another {another}")
    alone = finding.verdict == "named" and len(finding.chosen) == 1
    # Of what leaves more than the noise the name may be that of something that is not listed.
    if not test.significant or not alone or problem.exceeds_stated(final):
        return Confirmation(test)
    (cause,) = finding.chosen
    # What was found, and all that could leave the same in this campaign.
    imitators = problem.frame.imitators(cause.shape)
    names = tuple(dict.fromkeys((cause.name, *cause.members, *imitators)))

    def log_density(best: Hypothesis) -> float:
        """Log density of the held-out positions with an effect of the fitted ones."""
        fit = refit(part.frame.solution, [best])
        if fit is None:
            return -np.inf
        return -held_out_test(base, fit, rest, held, variance).after * held.size * c / 2

    rivals = [
        (one.names[0], part.singles.best[one.names[0]])
        for one in finding.posterior.reported[: RULES.held_out_rivals + 1]
        if len(one.best) == 1 and one.best[0].outlier is None and one.names[0] in part.singles.best
    ]
    shares = softmax([log_density(best) for _, best in rivals]) if rivals else ()
    sure = sum(share for (name, _), share in zip(rivals, shares, strict=True) if name in names)
    return Confirmation(test, names=names if sure >= RULES.sure else ())


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
    return "the fit to the fitted positions alone has no solution" if fit is None else fit.solution


def _place_of(part: Problem) -> Place | None:
    """Place that a part chooses for something unknown, alone or beside effects."""
    alone = [one for one in part.single_explanations if one.names == (UNKNOWN,)]
    if not alone:
        return None
    found = most_probable_place(part, Posterior.of([*alone, *part.with_unknown]))
    return None if found is None else found.place


# --- the prediction -----------------------------------------------------------------------------


@dataclass(frozen=True)
class HeldOutTest:
    """Evidence from held-out positions, in units of the noise variance.

    Attributes
    ----------
    before, after : float, mean square of the misclosures of the base and of the extended model
    floor : float, what it would be with the right model
    z : float
    held : tuple of int, indices of the held-out positions
    """

    before: float
    after: float
    floor: float
    z: float
    held: tuple[int, ...]

    @property
    def significant(self) -> bool:
        """Whether the correction predicts so well that it confirms what was found."""
        return self.z > RULES.z_confirmed


def split_positions(
    forces: Array, hold: HoldConditions, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Split positions into fitted and held-out ones, alike in direction, time and temperature.

    Of many random splits the one is taken whose two parts agree best in the first and second
    moments. It depends on where and when was measured, never on the readings.

    Parameters
    ----------
    forces : (n, 3) array, of an ideal sensor
    hold : HoldConditions
    count : int, positions to hold out
    rng : Generator
    """
    n = len(forces)
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    columns = [*unit.T, *(unit[:, i] * unit[:, j] for i in range(3) for j in range(i + 1))]
    for values in (hold.time, hold.temperature, hold.vibration):
        if values is not None and np.ptp(values) > 0:
            scaled = (values - np.mean(values)) / np.std(values)
            columns += [scaled, scaled**2]
    features = np.column_stack(columns)
    scale = features.std(axis=0)
    features = (features - features.mean(axis=0)) / np.where(scale > 0, scale, 1.0)
    best, least = np.arange(n), np.inf
    for _ in range(RULES.splits):
        order = rng.permutation(n)
        # The means of the two parts differ in proportion to the sum over either.
        imbalance = float(np.sum(features[order[:count]].sum(axis=0) ** 2))
        if imbalance < least:
            best, least = order, imbalance
    return np.sort(best[count:]), np.sort(best[:count])


def held_out_test(
    base: Solution,
    extended: Solution,
    rest: Observations,
    held: NDArray[np.int_],
    variance: float | None,
) -> HeldOutTest:
    """Predict positions by fits of two models to others.

    Parameters
    ----------
    base, extended : Solution, of the same positions
    rest : Observations, of the others
    held : indices of the others, for the record
    variance : float, of unit weight; None takes that of the base fit
    """
    if variance is None:
        variance = base.omega / base.redundancy
    (white, slopes), (left, extended_slopes) = (_predict(fit, rest) for fit in (base, extended))
    d = white - left
    slope = d @ slopes
    size = float(d @ d + slope @ base.cofactors @ slope)
    cofactors = extended.cofactors / relative_variance(extended, base)
    spread = float(np.einsum("mu,uv,mv->", extended_slopes, cofactors, extended_slopes))
    return HeldOutTest(
        before=float(np.mean(white**2)) / variance,
        after=float(np.mean(left**2)) / variance,
        floor=1 + spread / len(d),
        z=float(d @ white / np.sqrt(size * variance)) if size > 0 else 0.0,
        held=tuple(int(i) for i in held),
    )


def relative_variance(one: Solution, other: Solution) -> float:
    """Ratio of the variances of unit weight of two fits that take different sigmas."""
    return (one.sigma_force / other.sigma_force) ** 2


def _predict(fit: Solution, observed: Observations) -> tuple[Array, Array]:
    """Misclosures of unit weight in positions by a fit to others, (m,), and derivatives, (m, u)."""
    at = Residuals.at(fit.model, fit.approach, observed, fit.parameters)
    rows = at.whitening.shape[0] * at.whitening.shape[1]
    return at.errors[:rows], at.design[:rows]
