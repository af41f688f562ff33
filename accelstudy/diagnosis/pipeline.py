"""The diagnosis of a campaign, stage after stage."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.approaches import Approach
from accelstudy.basics.progress import stage
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.gross_errors.recognition import Recognised, recognise
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.base_fit import BaseFit
from accelstudy.diagnosis.beside import Beside
from accelstudy.diagnosis.decision.noise import NoiseJudge
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.decision.verdict import Finding, find
from accelstudy.diagnosis.evidence.chance import SIMULATIONS
from accelstudy.diagnosis.evidence.noise import kinds
from accelstudy.diagnosis.evidence.noise.kinds import NoiseTest
from accelstudy.diagnosis.held_out.confirmation import held_out
from accelstudy.diagnosis.result import Diagnosis, Gap, Named, level_of_effects
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


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
    recognised = recognise(campaign, approach)
    if recognised is not None:
        campaign = recognised.mended
    return _Run(campaign, model, approach, seed, recognised).diagnosis()


@dataclass(frozen=True)
class _Run:
    """One diagnosis in progress; every stage is computed once, at first use."""

    campaign: Campaign
    model: SensorModel
    approach: Approach
    seed: int
    recognised: Recognised | None

    def stage(self, number: int) -> np.random.SeedSequence:
        """Seed of a stage; no other stage changes it."""
        return np.random.SeedSequence(self.seed, spawn_key=(number,))

    @cached_property
    def fit(self) -> BaseFit:
        """The base fit, with equal axes."""
        return BaseFit(self.campaign, self.model, self.approach)

    @property
    def first(self) -> Solution:
        """The base fit at its solution."""
        return self.fit.solution

    @cached_property
    def search(self) -> Search:
        """The search for what the base fit lacks."""
        return Search(self.first, self.stage(0), self.fit.level, self.fit.white)

    @cached_property
    def noise(self) -> NoiseJudge:
        """What is said of the noise."""
        return NoiseJudge(self.search, self.campaign)

    # --- the decision ---------------------------------------------------------------------------

    def diagnosis(self) -> Diagnosis:
        """Decide, stage by stage."""
        search = self.search
        finding, tests = self.finding()
        found = self.described(finding, tests)
        verdict, reason = finding.verdict, finding.reason
        if self.recognised is not None:
            verdict, reason = "gross_error", self.recognised.reason
            gross = (
                Named(name, name, (name,), None, None, position=position)
                for name, position in self.recognised.named
            )
            found = (*gross, *found)
        final, variance = finding.examined, self.noise.unit_variance(finding.examined)
        known = self.fit.sigma_known
        trusted, holds = (self.noise.sigma_holds(fit) for fit in (search.examined, final))
        with stage("held-out positions"):
            gap = self.gap(finding, variance)
        return Diagnosis(
            campaign=self.campaign,
            approach=self.approach,
            model=self.model,
            extended=final.frame.solution.model,
            verdict=verdict,
            credible_set=finding.credible_set,
            found=found,
            base=self.first,
            examined=search.examined,
            final=final,
            sigma_known=known,
            sigma_holds=holds,
            unit_variance=variance,
            noise_tests=tests,
            screening=search.detection,
            probabilities=self.probabilities(finding),
            gap=gap,
            beside=Beside(search, finding, variance, known, trusted, holds),
            simulations=SIMULATIONS,
            recognised=self.recognised,
            reason=reason,
        )

    def probabilities(self, finding: Finding) -> dict[str, float]:
        """Posterior of each name, alone or with another; a class stands under its first name.

        Where nothing is missing, they only show which name would come first, each by itself.
        """
        if finding.posterior is None:
            return self.search.probabilities
        first: dict[tuple[str, ...], str] = {}
        found: dict[str, float] = defaultdict(float)
        for one, p in zip(finding.posterior.all, finding.posterior.probabilities, strict=True):
            # Two bumped positions have one name.
            named = zip(one.classes, one.names, strict=True)
            for name in {first.setdefault(members, name): None for members, name in named}:
                found[name] += p
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def finding(self) -> tuple[Finding, tuple[NoiseTest, ...]]:
        """Find what is missing: effects first, then the noise, by the tests of it."""
        search = self.search
        if search.exact:
            reason = "the campaign is its own model: what is left are rounding errors"
            return Finding("no_effect", search.examined, reason), ()
        if search.detection.p_value < level_of_effects(self.fit.sigma_known):
            finding = find(search)
            return finding, self.noise.tests(finding.examined)
        tests = self.noise.tests(search.examined)
        worst = self.noise.worst(tests)
        if worst is None:
            return Finding("no_effect", search.examined), tests
        return self.noise.judged(worst), tests

    # --- what else is said ----------------------------------------------------------------------

    def described(self, finding: Finding, tests: Sequence[NoiseTest]) -> tuple[Named, ...]:
        """Describe what was found."""
        search = self.search
        if finding.verdict == "noise_model":
            worst = self.noise.worst(tests)
            posterior = finding.posterior or search.posterior
            top = next(e.names[0] for e in posterior.explanations if e.names[0] in kinds.NOISES)
            name = top if worst is None else worst.name
            p = search.detection.p_value if worst is None else worst.p_value
            return (Named(name, name, (name,), p, posterior.of_noise),)
        solution = finding.examined.frame.solution
        sigma = np.sqrt(np.diag(solution.cofactors) * self.noise.unit_variance(finding.examined))
        columns = {name: i for i, name in enumerate(solution.model.parameter_names)}
        found = []
        for choice in finding.chosen:
            best, p = choice.best, search.detection.p_family[choice.best.name]
            if best.place is not None:
                label = int(self.campaign.positions[best.place])
                found.append(
                    Named(OUTLIER, OUTLIER, (OUTLIER,), p, choice.probability, position=label)
                )
                continue
            assert best.effect is not None
            assert best.shown is not None
            parameters = tuple(
                (
                    q.name,
                    float(solution.parameters[columns[q.name]]),
                    float(sigma[columns[q.name]]),
                    q.unit,
                )
                for q in best.shown.parameters
            )
            found.append(
                Named(
                    name=best.name,
                    spec=best.effect.spec,
                    equivalence_class=choice.members,
                    p_value=p,
                    posterior=choice.probability,
                    rivals=search.rivals(best, choice.members),
                    imitators=search.imitators(best, choice.members),
                    parameters=parameters,
                )
            )
        return tuple(found)

    def gap(self, finding: Finding, variance: float) -> Gap:
        """Compare the models on positions that were used neither for choosing nor for fitting."""
        before = self.first.omega / self.first.redundancy
        if not finding.chosen:
            return Gap(before)
        final = finding.examined.frame.solution
        after = final.omega / final.redundancy
        if finding.verdict not in ("named", "narrowed"):
            return Gap(before, after)
        known = variance if self.fit.sigma_known else None
        level = level_of_effects(self.fit.sigma_known)
        seeds = [self.stage(number) for number in (1, 2, 3, 4)]
        held = held_out(self.search, finding, known, level, seeds)
        return Gap(before, after, held.gap, held.confirmed, held.reason, held.names)
