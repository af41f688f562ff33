"""The diagnosis of a campaign, stage after stage: each takes what those before it found.

1. Gross errors are recognised by their size, and mended (`recognise`).
2. The base model is fitted, and all that it may lack set beside it (`fit_base`, `pose`).
3. The evidence is judged by a table of rules (`decide`): the total evidence that anything is
   missing is compared with noise alone (`detect`); if anything is, every hypothesis is weighed, and
   sets of up to three (`Weighing`, `find`), what is certain is added even if the whole has no name,
   and what has none, but a plain place, is learned; if not, the tests of the noise decide.
4. Positions that were not used confirm an effect, or do not, or refute it (`confirm`).

What follows from that, such as where the disagreement lives, what it is worth, and where to measure
next, a `Diagnosis` finds when it is asked.
"""

from __future__ import annotations

import numpy as np

from accelstudy.approaches import Approach
from accelstudy.basics.progress import stage
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.gross_errors.recognition import recognise
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.certain import with_what_is_certain, without_the_refuted
from accelstudy.diagnosis.decision.learned import learned
from accelstudy.diagnosis.decision.noise import tests_of_noise, unit_variance, worst_of
from accelstudy.diagnosis.decision.posterior import Case
from accelstudy.diagnosis.decision.problem import fit_base, is_exact, pose
from accelstudy.diagnosis.decision.verdict import Finding, because, find, judge_noise, weak
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.held_out import Gap, measured_gap, predicted_gap
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.diagnosis.rules import RULES
from accelstudy.sensors.sensor import SensorModel


def diagnose(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
) -> Diagnosis:
    """Find whether, where and why a campaign disagrees with a sensor model.

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
    approach = approach or usual_approach(campaign)
    recognised = recognise(campaign, approach.uses_angles)
    if recognised is not None:
        campaign = recognised.mended
    # No stage changes what another one draws.
    seeds = [np.random.SeedSequence(seed, spawn_key=(number,)) for number in range(5)]
    base = fit_base(campaign, model, approach)
    case = Case(campaign, pose(base), Chance(seeds[0], len(base.solution.design)))
    finding, gap = confirm(case, decide(case), [seeds[k] for k in (1, 2, 4)])
    return Diagnosis(case, finding, gap, recognised)


def decide(case: Case) -> Finding:
    """Judge the evidence: the first of these rules that matches."""
    problem = case.problem
    if is_exact(problem.base.solution):
        return Finding("no_effect", problem.frame, because("exact"))
    finding = Finding("no_effect", problem.frame)
    if case.detection.p_value < RULES.level(problem.evidence.level.known):
        found = find(case)
        finding = with_what_is_certain(case, found)
        if found.verdict == "unknown" and found.posterior is not None:
            finding = weak(case, finding) or learned(case, found.posterior, finding) or finding
    if finding.verdict == "no_effect":
        worst = worst_of(tests_of_noise(case, problem.frame))
        if worst is not None:
            finding = with_what_is_certain(case, judge_noise(case, worst))
    return finding


def confirm(
    case: Case, finding: Finding, seeds: list[np.random.SeedSequence]
) -> tuple[Finding, Gap]:
    """Ask held-out positions about what was added; what they refute is not said."""
    problem = case.problem
    stated, first = problem.evidence.level.known, problem.base.solution
    gap = measured_gap(finding, first)
    while finding.chosen and finding.verdict != "gross_error":
        with stage("held-out positions"):
            beyond = case.detection.by_chance.beyond(RULES.level(stated))
            given = unit_variance(problem, finding.frame) if stated else None
            gap = predicted_gap(gap, problem, case.weighing, finding, beyond, given, seeds)
        if gap.held_out is None or not gap.held_out.refutes:
            break
        # Without a learned function, what is certain is left.
        finding = finding.unlearned or without_the_refuted(case, finding, gap.held_out)
        gap = measured_gap(finding, first)
    return finding, gap
