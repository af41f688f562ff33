"""The verdict: a table of rules over the posterior, of which the first that matches wins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.functions import learn_function
from accelstudy.diagnosis.decision.posterior import NOT_LISTED, Explanation, Posterior
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.refits import Refit, impossible
from accelstudy.diagnosis.decision.statement import Finding, Part, Reason, Statement, statement_of
from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Cause
from accelstudy.diagnosis.evidence.noise import COLOUR, LEVEL, NOISES, STEPS, NoiseTest, worst_of
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import effect_names, get_effect


def decide(problem: Problem, campaign: Campaign) -> Finding:
    """Judge the evidence: the first of these rules that matches decides.

    * Only rounding errors are left: nothing is missing.
    * The evidence that anything is missing is significant, and one explanation, or a few, are
      probable enough and leave no misfit: they are named.
    * It is significant, and yet so weak that a calibration accepts its fit, and nothing is certain:
      nothing is missing, unless a test of the noise fails.
    * One coordinate and target have what is missing: its function is learned.
    * Whatever else is significant is unknown; what is certain of it is added.
    * A test of the noise fails: the noise is not as it is said to be, or an effect looks like it.
    * Nothing is missing.
    """
    if problem.exact:
        return Finding("no_effect", problem.frame, Reason.of("exact"))
    nothing = Finding("no_effect", problem.frame)
    if problem.p_value < RULES.level(problem.evidence.level.known):
        explained = explain(problem)
        finding = add_certain_effects(problem, explained)
        if finding.verdict != "unknown":
            return finding
        dismissed = dismiss_weak_evidence(problem, finding)
        if dismissed is None:
            return learn_function(problem, explained.posterior, finding) or finding
        nothing = dismissed
    worst = worst_of(problem.noise_tests(campaign))
    return nothing if worst is None else add_certain_effects(problem, judge_noise(problem, worst))


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
        found = [replace(cause, posterior=top.posterior) for cause in fit.causes]
        found.sort(key=lambda one: one.shape.outlier is None)
        credible, verdict = posterior.credible_set, ""
        of_effects = sum(one.posterior for one in credible if one.is_effects)
        sure = top.posterior >= RULES.sure
        if sure and found[0].shape.outlier is not None:
            verdict = "gross_error"
        elif top.posterior >= RULES.named:
            verdict = "named"
        elif (sure or len(credible) <= RULES.many) and of_effects >= RULES.sure:
            verdict = "narrowed"
        if verdict:
            return Finding(verdict, SessionFit.of(fit.solution), Reason(), tuple(found), posterior)
    if top.is_noise and top.posterior >= RULES.sure:
        reason = Reason.of("noise", name=top.names[0], remark=NOISES[top.names[0]])
        return Finding("noise_model", frame, reason, posterior=posterior)
    reason = Reason.of("not in the catalogue" if UNKNOWN in top.names else "undecided")
    return Finding("unknown", frame, reason, posterior=posterior)


def _against(problem: Problem, top: Explanation, fit: Refit | None) -> Reason:
    """Why an explanation cannot be the answer, however probable; empty if it can."""
    if fit is None:
        return Reason.of("no solution", names=top.names)
    if left := problem.misfit(fit.solution):
        return Reason.of("misfit", names=top.names, left=left)
    if beyond := impossible(fit.solution):
        return Reason.of("impossible", names=top.names, beyond=beyond)
    return Reason()


def dismiss_weak_evidence(problem: Problem, finding: Finding) -> Finding | None:
    """Find "no effect" where the calibration is right to accept its fit; None elsewhere.

    The evidence for something is wider than the test of the calibration, and its level less strict.
    What it finds beyond that level counts if something of it has a name, or is certain.
    """
    if not problem.evidence.level.known or problem.p_value < REFUTATION_LEVEL:
        return None
    test = problem.base.solution.global_test
    if test is None or not test.accepted or test.powerless:
        return None
    if any(part.is_effect for part in finding.statement.certain):
        return None
    return Finding("no_effect", problem.frame, Reason.of("weak", p=problem.p_value))


# --- what is large: to first order it leaves so much that anything seems to be beside it --------


def is_large(problem: Problem, single: Explanation) -> bool:
    """Whether an effect is so large that its signature to first order is not enough."""
    z, basis = problem.residuals.z, single.best[0].basis
    return single.best[0].outlier is None and float(np.sum((z @ basis) ** 2)) > RULES.large


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
    others = [one for one in problem.single_explanations if one.names != single.names]
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
    odds = inner.field.odds(inner.evidence, z) + alone.log_weight
    for name, log in zip(inner.field.names, odds.tolist(), strict=True):
        cause, more = NOT_LISTED, np.log(inner.prior_unknown)
        if name != UNKNOWN:
            other = inner.frame.candidates[name].strongest(z)
            cause = Cause(name, inner.singles.members[name], other)
            more = within_bounds(other, z, inner.evidence) - np.log(len(problem.singles.classes))
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
    posterior, cosine = finding.posterior, problem.singles.cosine
    if finding.verdict != "unknown":
        return replace(finding, statement=statement_of(posterior.credible_set, cosine))
    beyond = sum(one.posterior for one in posterior.all if UNKNOWN in one.names)
    if finding.reason.code == "misfit" or beyond > 1 - RULES.credible:
        posterior = posterior.doubting(_perhaps_imitations(problem, posterior))
    says = statement_of(posterior.all, cosine)
    finding = replace(finding, posterior=posterior, statement=says)
    chosen = [cause for _, cause in _certain_effects(problem, posterior, says)]
    if not chosen:
        return finding
    fit = problem.refit(chosen)
    if fit is None:
        return replace(finding, statement=Statement())
    return replace(finding, frame=SessionFit.of(fit.solution), chosen=fit.causes)


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
    says = statement_of(posterior.all, problem.singles.cosine)
    seeming = _certain_effects(problem, posterior, says)
    chosen, names = [cause for _, cause in seeming], set[str]()
    after = _disagreement(problem, chosen)
    for i, (part, _) in enumerate(seeming):
        without = _disagreement(problem, [*chosen[:i], *chosen[i + 1 :]])
        if after > (1 - RULES.nearly_all) * without:
            names |= {name.name for name in part.names}
    return names


def _disagreement(problem: Problem, chosen: Sequence[Cause]) -> float:
    """Ω that a fit leaves beyond the given noise, all if none is given; ∞ without a solution."""
    fit = problem.refit(chosen) if chosen else Refit((), problem.frame.solution)
    if fit is None:
        return np.inf
    noise = fit.solution.redundancy * float(problem.evidence.level.known)
    return max(fit.solution.omega - noise, 1e-9)


# --- a test of the noise fails, though no effect was significant --------------------------------


def judge_noise(problem: Problem, worst: NoiseTest) -> Finding:
    """Judge a failed test of the noise, when no effect was significant."""
    posterior = problem.posterior
    verdict, name, noise = "noise_model", worst.name, posterior.p_noise
    reason = Reason.of("noise", name=name, remark=worst.remark)
    if problem.lack_of_fit < REFUTATION_LEVEL and name != STEPS:
        verdict, reason = "unknown", Reason.of("lack of fit")
    # Larger residuals may be an effect that the test for a pattern could not see.
    elif name == LEVEL and problem.residuals.variance >= 1 and noise < RULES.more_probable:
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
    if problem.unknown is not None:
        places = problem.unknown.place_densities(problem.evidence, problem.residuals.z)
        if max(places, key=places.__getitem__)[0] in ("time", "temperature"):
            courses.add(UNKNOWN)
    return sum(one.posterior for one in posterior.reported if courses.issuperset(one.names))
