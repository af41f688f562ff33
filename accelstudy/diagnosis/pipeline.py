"""The diagnosis of a campaign, stage after stage: each takes what those before it found.

1. Gross errors are recognised by their size, and mended (`recognise`).
2. The base model is fitted, and all that it may lack set beside it (`fit_base`, `pose`).
3. The total evidence that anything is missing is compared with noise alone (`detect`).
4. If anything is, every hypothesis and every pair is weighed, which gives the verdict (`weigh`,
   `find`). If not, the tests of the noise decide (`tests_of_noise`, `judge_noise`).
5. What is certain is added, even if the whole has no name (`with_what_is_certain`); and what has
   none, but a plain place, is learned (`with_a_learned_shape`).
6. Positions that were not used confirm an effect, or do not (`predicted_gap`), or refute it.

That is all that `judge` does. `diagnose` adds what follows from the verdict: where the disagreement
lives, what it changed and is worth, what is excluded, and where to measure next.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from accelstudy.approaches import Approach
from accelstudy.basics.progress import stage
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.gross_errors.recognition import recognise
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.consequences import (
    leveling_rms,
    like_shapes,
    limits_of_others,
    marked_positions,
    parameter_changes,
    separating_positions,
)
from accelstudy.diagnosis.decision.certain import with_what_is_certain, without_the_refuted
from accelstudy.diagnosis.decision.learned import with_a_learned_shape
from accelstudy.diagnosis.decision.posterior import weigh
from accelstudy.diagnosis.decision.problem import Problem, fit_base, is_exact, pose
from accelstudy.diagnosis.decision.statement import with_purity
from accelstudy.diagnosis.decision.unrecorded import with_unrecorded
from accelstudy.diagnosis.decision.verdict import (
    Finding,
    Named,
    describe,
    find,
    judge_noise,
    probabilities,
    sigma_holds,
    tests_of_noise,
    unit_variance,
    unless_weak,
    worst_of,
)
from accelstudy.diagnosis.evidence.detection import SIMULATIONS, Chance, detect
from accelstudy.diagnosis.held_out import measured_gap, predicted_gap
from accelstudy.diagnosis.result import Diagnosis, Verdict, level_of_effects
from accelstudy.diagnosis.shape import shape_of
from accelstudy.sensors.plausibility import implausible_parameters
from accelstudy.sensors.sensor import SensorModel


def diagnose(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
) -> Diagnosis:
    """Find whether, where and why a campaign disagrees with a sensor model, and what follows.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel, of the simulation that is to be checked
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    seed : int, of the null simulation, the split and the resampling

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy to test anything.
    """
    judged = _judged(campaign, model, approach, seed)
    verdict, problem, finding = judged.verdict, judged.problem, judged.finding
    base, final, variance = verdict.base, finding.frame.solution, verdict.unit_variance
    leveling = None
    if finding.chosen:
        leveling = leveling_rms(base, final, problem.frame.hold, variance)
    marked = marked_positions(problem, sigma_holds(problem, problem.frame))
    u = verdict.extended.n_parameters
    sigma = np.sqrt(np.diag(final.cofactors)[:u] * variance)
    effects = verdict.extended.effects
    return Diagnosis(
        **vars(verdict),
        certain=with_purity(finding.certain, problem.examined),
        open=finding.open,
        repeated=problem.repeated,
        shape=shape_of(problem, finding, variance) if verdict.verdict == "learned" else None,
        like=like_shapes(problem, finding),
        leveling=leveling,
        changes=parameter_changes(problem, finding, variance),
        upper_limits=limits_of_others(problem, finding, verdict.sigma_holds),
        next_positions=separating_positions(problem.frame, finding),
        suspects=tuple((int(verdict.campaign.positions[i]), p) for i, p in marked),
        implausible=tuple(implausible_parameters(effects, final.parameters[:u], sigma)),
    )


def judge(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
) -> Verdict:
    """Find what `diagnose` does, without what follows from it, which takes as long again."""
    return _judged(campaign, model, approach, seed).verdict


@dataclass(frozen=True)
class _Judged:
    """A verdict, and what it was found by."""

    verdict: Verdict
    problem: Problem
    finding: Finding


def _judged(
    campaign: Campaign, model: SensorModel, approach: Approach | None, seed: int
) -> _Judged:
    approach = approach or usual_approach(campaign)
    recognised = recognise(campaign, approach)
    if recognised is not None:
        campaign = recognised.mended
    # No stage changes what another one draws.
    seeds = [np.random.SeedSequence(seed, spawn_key=(number,)) for number in range(5)]

    base = fit_base(campaign, model, approach)
    problem = pose(base)
    chance = Chance(seeds[0], len(base.solution.design))
    detection = detect(problem.field, problem.evidence, problem.residuals, chance)

    stated, frame = base.level.known, problem.frame
    level = level_of_effects(stated)
    finding, weighing = Finding("no_effect", frame), None
    if is_exact(base.solution):
        reason = "the campaign is its own model: what is left are rounding errors"
        finding = Finding("no_effect", frame, reason)
    else:
        if detection.p_value < level:
            weighing = weigh(problem, detection, chance)
            found = find(problem, weighing)
            finding = with_what_is_certain(problem, weighing, found)
            finding = unless_weak(problem, detection, finding)
            finding = with_a_learned_shape(problem, weighing, found.posterior, finding)
        if finding.verdict == "no_effect":
            worst = worst_of(tests_of_noise(problem, frame, campaign, chance))
            if worst is not None:
                weighing = weighing or weigh(problem, detection, chance)
                finding = judge_noise(problem, weighing.posterior, worst)
                finding = with_what_is_certain(problem, weighing, finding)

    gap = measured_gap(finding, base.solution)
    if weighing is not None and finding.verdict != "gross_error":
        beyond = detection.by_chance.beyond(level)
        while finding.chosen:
            with stage("held-out positions"):
                given = unit_variance(problem, finding.frame) if stated else None
                gap = predicted_gap(
                    gap, problem, weighing, finding, beyond, given, [seeds[k] for k in (1, 2, 4)]
                )
            if gap.held_out is None or not gap.held_out.refutes:
                break
            # Without a learned function, what is certain is left.
            finding = finding.unlearned or without_the_refuted(finding, frame, gap.held_out)
            gap = measured_gap(finding, base.solution)
    if weighing is not None:
        finding = with_unrecorded(problem, weighing, finding)
    variance = unit_variance(problem, finding.frame)
    tests = (
        () if is_exact(base.solution) else tests_of_noise(problem, finding.frame, campaign, chance)
    )
    named = describe(problem, detection, finding, tests, campaign.positions, variance)
    reason, verdict = finding.reason, finding.verdict
    if recognised is not None:
        verdict, reason = "gross_error", recognised.reason
        gross = (
            Named(name, name, (name,), None, None, position=position)
            for name, position in recognised.named
        )
        named = (*gross, *named)
    return _Judged(
        Verdict(
            campaign=campaign,
            approach=approach,
            model=model,
            extended=finding.frame.solution.model,
            verdict=verdict,
            reason=reason,
            says_the_level=finding.says_the_level,
            coloured=finding.coloured,
            unrecorded=finding.unrecorded and recognised is None,
            weak=finding.weak and recognised is None,
            credible_set=finding.credible_set,
            found=named,
            place=finding.place if recognised is None else None,
            base=base.solution,
            frame=frame,
            final=finding.frame,
            invisible=problem.examined.invisible,
            untestable=problem.examined.untestable,
            sigma_known=stated,
            sigma_holds=sigma_holds(problem, finding.frame),
            unit_variance=variance,
            noise_tests=tests,
            screening=detection,
            simulations=SIMULATIONS,
            probabilities=probabilities(finding, detection),
            gap=gap,
            recognised=recognised,
        ),
        problem,
        finding,
    )
