"""The verdict: a table of rules over the posterior, of which the first that matches wins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from accelstudy.adjustment.quality import Solution, global_test
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.diagnosis.decision.posterior import NOT_LISTED, Explanation, Posterior
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.statement import Part, Statement, statement_of
from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.evidence.noise_tests import (
    COLOUR,
    LEVEL,
    NOISES,
    STEPS,
    NoiseTest,
    lack_of_fit,
    misfit,
)
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.shapes import Place
from accelstudy.effects import effect_names, get_effect
from accelstudy.sensors.plausibility import impossible_parameters


class Reason(NamedTuple):
    """Why a verdict is what it is; empty where it needs no reason.

    Attributes
    ----------
    code : str
    facts : mapping, names and numbers of the sentence for it, which `report/words.txt.j2` has
    """

    code: str = ""
    facts: Mapping[str, Any] = {}

    @classmethod
    def of(cls, code: str, **facts: Any) -> Reason:
        """Reason with its names and numbers."""
        return cls(code, facts)


@dataclass(frozen=True)
class Finding:
    """What is said of a problem, with the hypotheses and the fit that it is said by.

    Attributes
    ----------
    verdict : str, "no_effect", "named", "narrowed", "learned", "gross_error", "noise_model" or
        "unknown"
    frame : SessionFit, of the fit with what was chosen, or of the base fit
    reason : Reason
    chosen : tuple of Cause; of the unknown, what is certain
    posterior : Posterior, empty where nothing is missing
    statement : Statement, what is missing whatever else is open, and what may be beside that
    place : Place or None, coordinate and target of a learned function, which is the first chosen
    """

    verdict: str
    frame: SessionFit
    reason: Reason = field(default=Reason())
    chosen: tuple[Cause, ...] = ()
    posterior: Posterior = field(default=Posterior())
    statement: Statement = field(default=Statement())
    place: Place | None = None

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds what is missing."""
        return self.posterior.credible_set

    @property
    def alternatives(self) -> tuple[Explanation, ...]:
        """Explanations any of which would be what was chosen."""
        if self.verdict != "unknown":
            return self.credible_set
        added = {cause.members for cause in self.chosen}
        parts = [part for part in self.statement.certain if part.names[0].members in added]
        alternatives = product(*(part.names for part in parts))
        return tuple(Explanation(one, posterior=parts[0].posterior) for one in alternatives)


# --- something is missing -----------------------------------------------------------------------


def explain(problem: Problem) -> Finding:
    """Find the explanation, or the few, of what is missing; "unknown" where none is enough."""
    posterior = problem.posterior
    single = next((one for one in posterior.all if len(one.best) == 1), None)
    if single is not None and is_large(problem, single):
        posterior = posterior_by_refits(problem, single, 1)
    finding = _judge(problem, posterior)
    if finding.reason.code == "misfit" and single is not None:
        # To first order the best explanation was enough; the others were not asked by their refits.
        posterior = posterior_by_refits(problem, single, RULES.refitted_sets)
        finding = _judge(problem, posterior)
    return finding


def _judge(problem: Problem, posterior: Posterior) -> Finding:
    """Judge the explanations of a posterior: the first rule that matches."""
    frame, top = problem.frame, posterior.reported[0]
    if top.best:
        fit = problem.refit(top.causes)
        reason = _against(problem, top, fit)
        if fit is None or reason.code:
            return Finding("unknown", frame, reason, posterior=posterior)
        found = [replace(cause, posterior=top.posterior) for cause in fit[0]]
        found.sort(key=lambda one: one.shape.place is None)
        credible, verdict = posterior.credible_set, ""
        of_effects = sum(one.posterior for one in credible if one.is_effects)
        sure = top.posterior >= RULES.sure
        if sure and found[0].shape.place is not None:
            verdict = "gross_error"
        elif top.posterior >= RULES.named:
            verdict = "named"
        elif (sure or len(credible) <= RULES.many) and of_effects >= RULES.sure:
            verdict = "narrowed"
        if verdict:
            return Finding(verdict, SessionFit.of(fit[1]), Reason(), tuple(found), posterior)
    if top.is_noise and top.posterior >= RULES.sure:
        reason = Reason.of("noise", name=top.names[0], remark=NOISES[top.names[0]])
        return Finding("noise_model", frame, reason, posterior=posterior)
    reason = Reason.of("not in the catalogue" if UNKNOWN in top.names else "undecided")
    return Finding("unknown", frame, reason, posterior=posterior)


def _against(
    problem: Problem, top: Explanation, fit: tuple[tuple[Cause, ...], Solution] | None
) -> Reason:
    """Why an explanation cannot be the answer, however probable; empty if it can."""
    if fit is None:
        return Reason.of("no solution", names=top.names)
    if left := misfit(problem, fit[1]):
        return Reason.of("misfit", names=top.names, left=left)
    if beyond := impossible(fit[1]):
        return Reason.of("impossible", names=top.names, beyond=beyond)
    return Reason()


def impossible(solution: Solution) -> list[str]:
    """Parameters that are beyond their physical bounds."""
    sigma = np.sqrt(np.diag(solution.cofactors) * max(1.0, solution.omega / solution.redundancy))
    u = solution.model.n_parameters
    return impossible_parameters(solution.model.effects, solution.parameters[:u], sigma[:u])


def dismiss_weak_evidence(problem: Problem, finding: Finding) -> Finding | None:
    """Find "no effect" where the calibration is right to accept its fit; None elsewhere.

    The evidence for something is wider than the test of the calibration, and its level less strict.
    What it finds beyond that level counts if something of it has a name, or is certain.
    """
    if not problem.evidence.level.known or problem.detection.p_value < REFUTATION_LEVEL:
        return None
    base = problem.base.solution
    test = global_test(base.omega, base.redundancy, sigma_dof=base.sigma_dof)
    if test is None or not test.accepted or test.powerless:
        return None
    if any(part.is_effect for part in finding.statement.certain):
        return None
    return Finding("no_effect", problem.frame, Reason.of("weak", p=problem.detection.p_value))


# --- what is large: to first order it leaves so much that anything seems to be beside it --------


def is_large(problem: Problem, single: Explanation) -> bool:
    """Whether an effect is so large that its signature to first order is not enough."""
    z, basis = problem.residuals.z, single.best[0].basis
    return single.best[0].place is None and float(np.sum((z @ basis) ** 2)) > RULES.large


def posterior_by_refits(problem: Problem, single: Explanation, count: int) -> Posterior:
    """Posterior by refits: of an effect alone, with more in what its refit leaves, and of sets.

    Parameters
    ----------
    problem : Problem
    single : Explanation, the effect
    count : int, sets of candidates that are refitted, the most probable to first order
    """
    tried = [single, *sorted(problem.sets, key=lambda one: -one.log_weight)[:count]]
    refitted = [_weigh_by_refit(problem, one) for one in tried]
    alone, solution = refitted[0]
    weighed = [one for one, _ in refitted]
    if solution is not None:
        weighed += _pairs_with(problem, alone, solution)
    others = [one for one in problem.alone if one.names != single.names]
    return Posterior.of([*weighed, *others, *problem.noises])


def _weigh_by_refit(problem: Problem, one: Explanation) -> tuple[Explanation, Solution | None]:
    """Weigh an explanation by its refit instead of by first order."""
    fit = problem.refit(one.causes)
    if fit is None:
        return one, None
    refitted, solution = fit
    z, basis = problem.residuals.z, np.concatenate([h.basis for h in one.best], axis=1)
    left = z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]
    gain = max(float(left @ left) - solution.omega, 0.0)
    parts = float(z @ z - left @ left) + np.array([0.0, gain])
    first, refit = problem.evidence.spaces_density(parts, [basis.shape[1]] * 2, z @ z)
    weight = one.log_weight + float(refit - first)
    both = zip(one.causes, refitted, strict=True)
    causes = tuple(replace(cause, best=other.best) for cause, other in both)
    return Explanation(causes, weight), solution


def _pairs_with(problem: Problem, alone: Explanation, solution: Solution) -> list[Explanation]:
    """One effect with another one, or with something unknown, in what its refit leaves."""
    inner, weighed = pose(replace(problem.base, solution=solution)), list[Explanation]()
    z = inner.residuals.z
    odds = inner.field.odds(inner.evidence, inner.field.project(z)) + alone.log_weight
    for name, log in zip(inner.field.names, odds.tolist(), strict=True):
        cause, more = NOT_LISTED, np.log(inner.prior_unknown)
        if name != UNKNOWN:
            other = inner.frame.candidates[name].strongest(z)
            cause = Cause(name, inner.members[name], other)
            more = within_bounds(other, z, inner.evidence) - np.log(len(problem.classes))
        weight = log + float(more + np.log(RULES.prior_two))
        weighed.append(Explanation((*alone.causes, cause), weight))
    return weighed


# --- what is certain, whatever else is open -----------------------------------------------------

# Explanations that share an effect may leave no doubt of it, while none of them is probable enough
# to be the answer, or all of them leave a misfit. But where more is missing than the catalogue
# explains, an effect of it may only imitate what has no name. That is hardly ever so well done that
# the effect explains nearly all there is; what explains less is doubted.


def add_certain_effects(problem: Problem, finding: Finding) -> Finding:
    """Say what is certain, and add it to the fit whatever else is missing."""
    posterior = finding.posterior
    if finding.verdict != "unknown":
        return replace(finding, statement=statement_of(finding.credible_set, problem.cosine))
    beyond = sum(one.posterior for one in posterior.all if UNKNOWN in one.names)
    if finding.reason.code == "misfit" or beyond > 1 - RULES.credible:
        posterior = posterior.doubting(_perhaps_imitations(problem, posterior))
    says = statement_of(posterior.all, problem.cosine)
    finding = replace(finding, posterior=posterior, statement=says)
    chosen = [cause for _, cause in _certain_effects(problem, posterior, says)]
    if not chosen:
        return finding
    fit = problem.refit(chosen)
    if fit is None:
        return replace(finding, statement=Statement())
    return replace(finding, frame=SessionFit.of(fit[1]), chosen=fit[0])


def _certain_effects(
    problem: Problem, posterior: Posterior, says: Statement
) -> list[tuple[Part, Cause]]:
    """Components that are certain and effects, each with its most probable name."""
    chosen = []
    for part in says.certain:
        if (name := part.names[0]).name in effect_names():
            shapes = (h for one in posterior.all for h in one.best if h.name == name.name)
            best = next(shapes, problem.singles.best[name.name])
            chosen.append((part, replace(name, best=best, posterior=part.posterior)))
    return chosen


def _perhaps_imitations(problem: Problem, posterior: Posterior) -> set[str]:
    """Names of what seems certain, and yet does not explain nearly all that is left without it.

    More is missing than the catalogue explains. An effect of it may imitate what is in none, though
    hardly ever nearly all of that.
    """
    seeming = _certain_effects(problem, posterior, statement_of(posterior.all, problem.cosine))
    chosen, names = [cause for _, cause in seeming], set[str]()
    after = _disagreement(problem, chosen)
    for i, (part, _) in enumerate(seeming):
        without = _disagreement(problem, [*chosen[:i], *chosen[i + 1 :]])
        if after > (1 - RULES.nearly_all) * without:
            names |= {name.name for name in part.names}
    return names


def _disagreement(problem: Problem, chosen: Sequence[Cause]) -> float:
    """Ω that a fit leaves beyond the given noise, all if none is given; ∞ without a solution."""
    fit = problem.refit(chosen) if chosen else ((), problem.frame.solution)
    if fit is None:
        return np.inf
    noise = fit[1].redundancy * float(problem.evidence.level.known)
    return max(fit[1].omega - noise, 1e-9)


# --- a test of the noise fails, though no effect was significant --------------------------------


def judge_noise(problem: Problem, worst: NoiseTest) -> Finding:
    """Judge a failed test of the noise, when no effect was significant."""
    posterior = problem.posterior
    verdict, name, noise = "noise_model", worst.name, posterior.p_noise
    reason = Reason.of("noise", name=name, remark=worst.remark)
    if lack_of_fit(problem) < REFUTATION_LEVEL and name != STEPS:
        verdict, reason = "unknown", Reason.of("lack of fit")
    # Larger residuals may be an effect that the test for a pattern could not see.
    elif name == LEVEL and worst.values[0] >= 1 and noise < RULES.more_probable:
        other = next(n for e in posterior.reported for n in e.names if n not in NOISES)
        reason = Reason.of("noise or effect", name=name, remark=worst.remark, p=noise, other=other)
        verdict = "unknown"
    return Finding(verdict, problem.frame, reason, posterior=posterior)


# --- a cause that nobody recorded ---------------------------------------------------------------

# A temperature that wanders moves the biases. Without a thermometer no effect of the catalogue can
# stand for it, so that slow noise does, and drifts that look like it. Neither shows that the sensor
# model is adequate.


def p_coloured(problem: Problem, finding: Finding) -> float:
    """Probability of coloured noise that may be an effect of an absent column."""
    posterior = finding.posterior
    if finding.verdict not in ("noise_model", "unknown"):
        return 0.0
    slow = [one.posterior for one in posterior.all if one.names == (COLOUR,)]
    return sum(slow) if problem.frame.absent else 0.0


def reason_of_unrecorded(problem: Problem, finding: Finding) -> Reason | None:
    """Why noise, or nothing with a name, may be an effect of what was not recorded; else None."""
    posterior, absent = finding.posterior, problem.frame.absent
    if finding.verdict not in ("noise_model", "unknown") or not absent or not posterior.all:
        return None
    probability = p_coloured(problem, finding)
    if finding.verdict == "noise_model":
        enough = probability >= posterior.p_noise / 2
    else:
        enough = probability + _p_courses(problem, posterior) >= RULES.sure
    if not enough:
        return None
    repeated = problem.attitude is not None
    return Reason.of("unrecorded", absent=absent, repeated=repeated, why=finding.reason)


def _p_courses(problem: Problem, posterior: Posterior) -> float:
    """Probability of effects of time or temperature, and of something unknown like them."""
    courses = {name for name in effect_names() if get_effect(name).is_course}
    unknown = problem.unknown
    if unknown is not None:
        places = unknown.place_densities(problem.evidence, problem.residuals.z)
        if max(places, key=places.__getitem__)[0] in ("time", "temperature"):
            courses.add(UNKNOWN)
    return sum(one.posterior for one in posterior.reported if courses.issuperset(one.names))
