"""The verdict: which explanation of the posterior is given, and what is said of the noise."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import Solution, global_test, pooled_variance
from accelstudy.basics.levels import REFUTED
from accelstudy.basics.wording import comma_list, grouped, p_value
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.posterior import (
    Explanation,
    Posterior,
    Weighed,
    Weighing,
    of_effects,
)
from accelstudy.diagnosis.decision.problem import Problem, pose
from accelstudy.diagnosis.decision.refits import best_refit, with_settings
from accelstudy.diagnosis.decision.statement import Part
from accelstudy.diagnosis.evidence.bounds import within_bounds
from accelstudy.diagnosis.evidence.detection import Chance, Detection
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.hypotheses import equivalents, weigh_singles
from accelstudy.diagnosis.evidence.noise_tests import (
    AXES,
    COLOUR,
    LEVEL,
    NOISES,
    STEPS,
    TAILS,
    NoiseTest,
    axis_test,
    colour_test,
    level_test,
    resolution_test,
    tail_test,
    within_hold_test,
)
from accelstudy.diagnosis.space.examined import Frame
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypothesis, Spaces
from accelstudy.diagnosis.space.repeats import LackOfFit, clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import Place
from accelstudy.effects.learned import LEARNED
from accelstudy.sensors.plausibility import impossible_parameters

LARGE = 300.0
"""Noncentrality beyond which first order is not enough, and a refit judges an effect."""
PAIRS = 5
"""Pairs that are refitted where the best explanation leaves a misfit."""
LEVEL_NOISE = 0.01
"""Family-wise level of all tests of the noise but that of its level, which has `REFUTED`. With the
test for anything that is missing they make 5 % false alarms."""
RIVAL = 0.5
"""Canonical cosine from which on an effect is listed as a rival."""
SPECIFIC = (STEPS, COLOUR, AXES, TAILS, LEVEL)
"""What may be wrong with the noise, the most specific first."""


@dataclass(frozen=True)
class Choice:
    """A hypothesis that was chosen.

    Attributes
    ----------
    best : Hypothesis
    members : tuple of str, names that mean the same in this campaign
    probability : float, posterior
    """

    best: Hypothesis
    members: tuple[str, ...]
    probability: float


@dataclass(frozen=True)
class Finding:
    """What is said of a problem, with the hypotheses and the fit that it is said by.

    Attributes
    ----------
    verdict : str, "no_effect", "named", "narrowed", "learned", "gross_error", "noise_model" or
        "unknown"
    frame : Frame, of the fit with what was chosen, or of the base fit
    reason : str
    chosen : tuple of Choice; of the unknown, what is certain
    posterior : Posterior or None, where something is missing
    says_the_level : bool, whether the reason says how large the residuals are
    coloured : float, probability of coloured noise that may be an effect of an absent column
    unrecorded : bool, whether the reason says so
    weak : bool, whether there is evidence that something is missing, too weak for a verdict
    left_over : bool, whether the best explanation leaves more than noise
    certain : tuple of Part, what is missing whatever else is open
    open : tuple of Explanation, what may be missing beside that
    place : Place or None, coordinate and target of a learned function, which is the first chosen
    unlearned : Finding or None, what is said without that function
    """

    verdict: str
    frame: Frame
    reason: str = ""
    chosen: tuple[Choice, ...] = ()
    posterior: Posterior | None = None
    says_the_level: bool = False
    coloured: float = 0.0
    unrecorded: bool = False
    weak: bool = False
    left_over: bool = False
    certain: tuple[Part, ...] = ()
    open: tuple[Explanation, ...] = ()
    place: Place | None = None
    unlearned: Finding | None = None

    @property
    def alternatives(self) -> tuple[Explanation, ...]:
        """Explanations any of which would be what was chosen."""
        if self.verdict != "unknown":
            return self.credible_set
        added = {choice.members for choice in self.chosen}
        parts = [part for part in self.certain if part.names[0].members in added]
        return tuple(
            Explanation(
                tuple(n.name for n in one), tuple(n.members for n in one), parts[0].posterior
            )
            for one in product(*(part.names for part in parts))
        )

    @property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Smallest set of explanations that holds what is missing."""
        return () if self.posterior is None else self.posterior.credible_set


@dataclass(frozen=True)
class Named:
    """An effect, noise effect or gross error that was found.

    Attributes
    ----------
    name, spec : str; of a bumped position `spec` is the name
    equivalence_class : tuple of str, names that mean the same in this campaign
    p_value : float, family-wise; None of a gross error that is recognised by its size
    posterior : float; None of what is no rival of the others
    rivals : tuple of (name, cosine)
    imitators : tuple of str, further names that could leave the same, and more
    parameters : tuple of (name, value, sigma, unit), SI
    settings : tuple of the same, of those that were searched for
    position : int, of a bumped position
    """

    name: str
    spec: str
    equivalence_class: tuple[str, ...]
    p_value: float | None
    posterior: float | None
    rivals: tuple[tuple[str, float], ...] = ()
    imitators: tuple[str, ...] = ()
    parameters: tuple[tuple[str, float, float | None, str], ...] = ()
    settings: tuple[tuple[str, float, float | None, str], ...] = ()
    position: int | None = None


def find(problem: Problem, weighing: Weighing) -> Finding:
    """Say what is missing, given that something is."""
    posterior = weighing.posterior
    strongest = next((one for one in posterior.all if len(one.best) == 1), None)
    if strongest is not None and _is_large(problem, strongest):
        posterior = _judged_by_refits(problem, weighing, strongest, 1)
    finding = _judged(problem, weighing, posterior)
    if finding.left_over and strongest is not None:
        # To first order the best explanation was enough; the others were not asked by their refits.
        posterior = _judged_by_refits(problem, weighing, strongest, PAIRS)
        finding = _judged(problem, weighing, posterior)
    return finding


def _judged(problem: Problem, weighing: Weighing, posterior: Posterior) -> Finding:
    """Judge the explanations of a posterior."""
    top = posterior.top
    if not top.best:
        return _without_a_fit(problem, posterior)
    chosen = zip(top.best, top.classes, strict=True)
    fit = best_refit(problem.examined, weighing.singles, chosen)
    if fit is None:
        reason = f"{_explained(top.names)} most of it, but a model with it has no solution"
        return Finding("unknown", problem.frame, reason, posterior=posterior)
    best, solution = fit
    left = misfit(problem, solution)
    if left:
        reason = f"with {comma_list(grouped(top.names))} added, the residuals are still {left}"
        return Finding("unknown", problem.frame, reason, posterior=posterior, left_over=True)
    if beyond := impossible(solution):
        reason = f"with {comma_list(grouped(top.names))} added, no sensor has {beyond}"
        return Finding("unknown", problem.frame, reason, posterior=posterior)
    return _with_a_fit(problem, posterior, best, solution)


def impossible(solution: Solution) -> str:
    """Parameters that are beyond their physical bounds; empty if none is."""
    sigma = np.sqrt(np.diag(solution.cofactors) * max(1.0, solution.omega / solution.redundancy))
    u = solution.model.n_parameters
    effects = solution.model.effects
    return comma_list(impossible_parameters(effects, solution.parameters[:u], sigma[:u]))


def _with_a_fit(
    problem: Problem, posterior: Posterior, best: Sequence[Hypothesis], solution: Solution
) -> Finding:
    """Judge the most probable explanation, which has a fit."""
    top, probability = posterior.top, posterior.explanations[0].posterior
    chosen = tuple(
        sorted(
            (Choice(h, m, probability) for h, m in zip(best, top.classes, strict=True)),
            key=lambda choice: choice.best.effect is not None,
        )
    )
    credible = posterior.credible_set
    if probability >= priors.SURE:
        verdict = "gross_error" if chosen[0].best.effect is None else "named"
    elif len(credible) <= priors.MANY and _of_effects(credible) >= priors.SURE:
        verdict = "narrowed"
    else:
        return _without_a_fit(problem, posterior)
    return Finding(verdict, Frame.of(solution), "", chosen, posterior)


def _of_effects(credible: Sequence[Explanation]) -> float:
    """Probability of the explanations by effects alone."""
    return sum(one.posterior for one in credible if of_effects(one))


def _without_a_fit(problem: Problem, posterior: Posterior) -> Finding:
    """Judge where no effect or set of effects is probable enough."""
    first = posterior.explanations[0]
    if first.names[0] in NOISES and first.posterior >= priors.SURE:
        return Finding(
            "noise_model",
            problem.frame,
            NOISES[first.names[0]],
            posterior=posterior,
            says_the_level=first.names[0] == LEVEL,
        )
    if UNKNOWN in first.names:
        reason = "no effect or pair of effects of the catalogue explains it"
    else:
        second = comma_list(grouped(posterior.explanations[1].names))
        reason = (
            f"{_explained(first.names)} it with a probability of {first.posterior:.2f} only, and "
            f"{second} with {posterior.explanations[1].posterior:.2f}"
        )
    return Finding("unknown", problem.frame, reason, posterior=posterior)


def unless_weak(problem: Problem, detection: Detection, finding: Finding) -> Finding:
    """Take back that something is missing, where the calibration is right to accept its fit.

    The evidence for something is wider than the test of the calibration, and its level less strict.
    What it finds beyond that level counts if something of it has a name, or is certain.
    """
    base = problem.base.solution
    test = None
    if problem.evidence.level.known:
        test = global_test(base.omega, base.redundancy, sigma_dof=base.sigma_dof)
    accepted = test is not None and test.accepted and not test.powerless
    if finding.verdict != "unknown" or detection.p_value < REFUTED or not accepted:
        return finding
    if any(part.is_effect for part in finding.certain):
        return finding
    reason = (
        f"the evidence that something is missing is weak ({p_value(detection.p_value)}), and "
        f"nothing of it is certain; more positions, and repeats of these, would show it"
    )
    return Finding("no_effect", problem.frame, reason, weak=True)


def _explained(names: Sequence[str]) -> str:
    """Names with the verb that belongs to them."""
    return f"{comma_list(grouped(names))} explain{'s' if len(names) == 1 else ''}"


def _is_large(problem: Problem, top: Weighed) -> bool:
    """Whether an effect is so large that its signature to first order is not enough."""
    z, basis = problem.residuals.z, top.best[0].basis
    return top.best[0].effect is not None and float(np.sum((z @ basis) ** 2)) > LARGE


def _judged_by_refits(
    problem: Problem, weighing: Weighing, single: Weighed, count: int
) -> Posterior:
    """Posterior by refits: an effect alone, with more in what its refit leaves, pairs and triples.

    To first order a large effect leaves so much that anything would seem to be beside it.

    Parameters
    ----------
    problem : Problem
    weighing : Weighing
    single : Weighed, the effect
    count : int, pairs that are refitted, the most probable to first order, and half as many triples
    """
    tried = [single]
    for size, some in ((2, count), (3, (count + 1) // 2)):
        together = [one for one in weighing.pairs if len(one.best) == size]
        tried += sorted(together, key=lambda one: -one.log_weight)[:some]
    refitted = [_refitted(problem, weighing, one) for one in tried]
    weighed = [one for one, _ in refitted]
    alone, solution = refitted[0]
    if solution is not None:
        weighed += _beside(problem, len(weighing.classes), alone, solution)
    others = [one for one in weighing.alone if one.names != single.names]
    return Posterior.of([*weighed, *others, *weighing.noises])


def _refitted(
    problem: Problem, weighing: Weighing, one: Weighed
) -> tuple[Weighed, Solution | None]:
    """Weigh an explanation by its refit instead of by first order."""
    chosen = zip(one.best, one.classes, strict=True)
    fit = best_refit(problem.examined, weighing.singles, chosen)
    if fit is None:
        return one, None
    best, solution = fit
    z, basis = problem.residuals.z, np.concatenate([h.basis for h in one.best], axis=1)
    left = z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]
    gain = max(float(left @ left) - solution.omega, 0.0)
    parts = float(z @ z - left @ left) + np.array([0.0, gain])
    first, refit = problem.evidence.of_spaces(parts, [basis.shape[1]] * 2, z @ z)
    weight = one.log_weight + float(refit - first)
    return replace(one, log_weight=weight, best=tuple(best)), solution


def _beside(problem: Problem, count: int, alone: Weighed, solution: Solution) -> list[Weighed]:
    """One effect with another one, or with something unknown, in what its refit leaves.

    Parameters
    ----------
    problem : Problem
    count : int, classes of candidates
    alone : Weighed, the effect
    solution : Solution, its refit
    """
    inner = pose(replace(problem.base, solution=solution))
    z, field = inner.residuals.z, inner.field
    members = equivalents(inner.examined, weigh_singles(inner.examined, field, inner.evidence))
    nothing = float(np.logaddexp.reduce(inner.evidence.of_noise(z @ z)))
    logs = field.densities(inner.evidence, field.seen(z)) - nothing + alone.log_weight
    k, weighed = max(count, 1), []
    for name, log in zip(field.names, logs.tolist(), strict=True):
        if name == UNKNOWN:
            weight = log + float(np.log(priors.TWO * priors.UNKNOWN))
            names, classes = (*alone.names, UNKNOWN), (*alone.classes, (UNKNOWN,))
            weighed.append(Weighed(names, classes, weight))
            continue
        other = inner.examined.candidates[name].strongest(z)
        both = (*alone.classes, members[name])
        within = float(within_bounds((other,), z, inner.evidence)[0])
        weight = log + within + float(np.log(priors.TWO / k))
        weighed.append(Weighed((*alone.names, name), both, weight, (*alone.best, other)))
    return weighed


def misfit(problem: Problem, solution: Solution) -> str:
    """Say how much larger than the noise the residuals still are; empty if they are not.

    The noise is the given sigma. Where none is given, or where repeated positions refute it even
    after the refit, it is the difference of repeated positions.
    """
    stated = problem.evidence.level.known
    if stated and 2 * float(special.chdtrc(solution.redundancy, solution.omega)) >= REFUTED:
        return ""
    ratio = float(np.sqrt(solution.omega / solution.redundancy))
    than_stated = f"{ratio:.2g} times the stated noise" if stated else ""
    left = Residuals.of(solution)
    labels = clusters(problem.frame.forces)
    if len(labels) != len(solution.misclosures) or len(np.unique(labels)) == len(labels):
        return than_stated
    square, freedom = _of_repeats(left, LackOfFit.of(left, labels))
    if not freedom or (stated and special.chdtrc(freedom, square) >= REFUTED / 2):
        return than_stated
    if _of_fit(left, square, freedom) >= REFUTED:
        return ""
    ratio = float(np.sqrt(solution.omega / solution.redundancy / (square / freedom)))
    return than_stated or f"{ratio:.2g} times what repeated positions differ by"


def lack_of_fit(problem: Problem) -> float:
    """p-value of the test whether repeats agree better with each other than with the model."""
    residuals, same = problem.residuals, problem.field.attitude
    if same is None:
        return 1.0
    return _of_fit(residuals, *_of_repeats(residuals, same))


def _of_fit(residuals: Residuals, square: float, freedom: int) -> float:
    """F test of all but the differences of repeats against these differences."""
    rest = residuals.redundancy - freedom
    if not freedom or not rest:
        return 1.0
    ratio = (float(residuals.z @ residuals.z) - square) / rest / (square / freedom)
    return float(special.fdtrc(rest, freedom, ratio))


def _of_repeats(residuals: Residuals, same: Spaces) -> tuple[float, int]:
    """Square of the differences of repeated positions, and its degrees of freedom."""
    square = float(residuals.z @ residuals.z) - float(same.parts(residuals.z)[0])
    return max(square, 0.0), residuals.redundancy - int(same.dims[0])


# --- the noise ----------------------------------------------------------------------------------


def tests_of_noise(
    problem: Problem, frame: Frame, campaign: Campaign, chance: Chance
) -> tuple[NoiseTest, ...]:
    """All tests of the noise that a campaign allows, on the residuals of a fit.

    Parameters
    ----------
    problem : Problem
    frame : Frame, of the base fit or of the final one
    campaign : Campaign
    chance : Chance, residuals without any effect
    """
    residuals, base = frame.residuals, problem.residuals
    sigma, sigma_base = (float(np.mean(one.sigmas[:, :3])) for one in (residuals, base))
    # With a sigma far too large, the attitudes would look like steps.
    least = sigma_base * min(1.0, float(np.sqrt(base.variance)))
    tests = [level_test_of(problem, frame)] if problem.evidence.level.known else []
    tests += [
        axis_test(residuals, chance),
        colour_test(residuals, chance),
        tail_test(residuals, chance),
        resolution_test(campaign.forces, least),
    ]
    if campaign.sd is not None and campaign.n_samples is not None:
        tests.append(within_hold_test(residuals, sigma, campaign.sd, campaign.n_samples))
    return tuple(tests)


def level_test_of(problem: Problem, frame: Frame) -> NoiseTest:
    """Test the level of the noise; the base fit by its own Ω, as the calibration does."""
    if frame is problem.frame:
        base = problem.base.solution
        return level_test(Residuals.of(base), base.sigma_dof)
    return level_test(frame.residuals, frame.solution.sigma_dof)


def sigma_holds(problem: Problem, frame: Frame) -> bool:
    """Whether sigma is given, and the residuals of a fit do not refute it."""
    stated = problem.evidence.level.known
    return stated and level_test_of(problem, frame).p_value >= REFUTED


def unit_variance(problem: Problem, frame: Frame) -> float:
    """Variance of unit weight: of the given sigma where that holds, else a posteriori."""
    residuals = frame.residuals
    if not sigma_holds(problem, frame):
        return residuals.variance
    r = residuals.redundancy
    return pooled_variance(r * residuals.variance, r, frame.solution.sigma_dof)


def worst_of(tests: Sequence[NoiseTest]) -> NoiseTest | None:
    """Return what is wrong with the noise, the most specific finding first."""
    level = next((t for t in tests if t.name == LEVEL), None)
    counted = [
        t
        for t in tests
        # A sigma that the residuals confirm knows of what varies from hold to hold.
        if not (t.by_holds and level is not None and level.p_value >= REFUTED)
    ]
    others = LEVEL_NOISE / max(len(counted) - (level is not None), 1)
    failed = [t for t in counted if t.p_value < (REFUTED if t is level else others)]
    return min(failed, key=lambda t: SPECIFIC.index(t.name), default=None)


def judge_noise(problem: Problem, posterior: Posterior, worst: NoiseTest) -> Finding:
    """Judge a failed test of the noise, when no effect was significant."""
    frame = problem.frame
    if lack_of_fit(problem) < REFUTED and worst.name != STEPS:
        reason = (
            "repeated positions agree better with each other than with the model, so it is not "
            "the noise"
        )
        return Finding("unknown", frame, reason, posterior=posterior)
    noise, of_level = posterior.of_noise, worst.name == LEVEL
    # Larger residuals may be an effect that the test for a pattern could not see.
    if not of_level or worst.estimate[0] < 1 or noise >= priors.MORE_PROBABLE:
        return Finding(
            "noise_model", frame, worst.remark, posterior=posterior, says_the_level=of_level
        )
    name = next(n for e in posterior.explanations for n in e.names if n not in NOISES)
    reason = (
        f"{worst.remark}; it may be the noise (probability {noise:.2f}), but "
        f"{'something' if name == 'unknown' else 'an effect such as ' + name} is not excluded"
    )
    return Finding("unknown", frame, reason, posterior=posterior, says_the_level=True)


# --- what was found -----------------------------------------------------------------------------


def describe(
    problem: Problem,
    detection: Detection,
    finding: Finding,
    tests: Sequence[NoiseTest],
    labels: NDArray[np.int_],
    variance: float,
) -> tuple[Named, ...]:
    """Describe what was found.

    Parameters
    ----------
    problem : Problem
    detection : Detection, of the same
    finding : Finding
    tests : of the noise
    labels : (n,) int array, of the positions
    variance : float, of unit weight
    """
    if finding.verdict == "noise_model":
        worst, posterior = worst_of(tests), finding.posterior
        assert posterior is not None
        top = next(e.names[0] for e in posterior.explanations if e.names[0] in NOISES)
        # Of larger residuals the level says least; what they are, the evidence says.
        if worst is None or (worst.name == LEVEL and posterior.of_noise >= priors.SURE):
            name = top
        else:
            name = worst.name
        p = detection.p_value if worst is None else worst.p_value
        return (Named(name, name, (name,), p, posterior.of_noise),)
    solution = finding.frame.solution
    hypotheses = [choice.best for choice in finding.chosen]
    cofactors = with_settings(problem.examined, solution, hypotheses)
    sigma = np.sqrt(np.diag(cofactors) * variance)
    columns = {name: i for i, name in enumerate(solution.model.parameter_names)}
    of_settings = iter(sigma[len(solution.parameters) :].tolist())
    named = []
    for choice in finding.chosen:
        best, name = choice.best, choice.best.name
        p = detection.p_family[UNKNOWN if name == LEARNED else name]
        if best.place is not None:
            label = int(labels[best.place])
            named.append(Named(OUTLIER, OUTLIER, (OUTLIER,), p, choice.probability, position=label))
            continue
        assert best.effect is not None
        assert best.shown is not None
        places = [(q, columns[q.name]) for q in best.shown.parameters]
        examined, members = problem.examined, choice.members
        searched = [s for s in best.effect.takes if s.name == best.smooth]
        # What is beside a large effect was found in what its refit leaves.
        here = None if name == LEARNED else examined.hypothesis(best.effect)
        near, imitators = (
            ((), ()) if here is None else (examined.nearest(here), examined.imitators(here))
        )
        named.append(
            Named(
                name=best.name,
                spec=best.effect.spec,
                equivalence_class=members,
                p_value=p,
                posterior=choice.probability,
                rivals=tuple(
                    (other, cosine)
                    for other, cosine in near
                    if cosine >= RIVAL and other not in members
                ),
                imitators=tuple(other for other in imitators if other not in members),
                parameters=tuple(
                    (q.name, float(solution.parameters[i]), float(sigma[i]), q.unit)
                    for q, i in places
                ),
                settings=tuple(
                    (s.name, best.value, best.value * of_log, s.unit)
                    for s, of_log in zip(searched, of_settings, strict=False)
                ),
            )
        )
    return tuple(named)


def probabilities(finding: Finding, detection: Detection) -> dict[str, float]:
    """Posterior of each name, alone or with another; a class stands under its first name.

    Where nothing is missing, they only show which name would come first, each by itself.
    """
    if finding.posterior is None:
        logs = detection.densities
        ranked = sorted(logs, key=lambda name: -logs[name])
        shares = special.softmax([logs[name] for name in ranked]).tolist() if ranked else []
        return dict(zip(ranked, shares, strict=True))
    first: dict[tuple[str, ...], str] = {}
    total: dict[str, float] = defaultdict(float)
    for one, p in zip(finding.posterior.all, finding.posterior.probabilities, strict=True):
        # Two bumped positions have one name.
        named = zip(one.classes, one.names, strict=True)
        for name in {first.setdefault(members, name): None for members, name in named}:
            total[name] += p
    return dict(sorted(total.items(), key=lambda item: -item[1]))
