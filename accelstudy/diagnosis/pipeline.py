"""The diagnosis of a campaign, stage after stage."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import GlobalTest, Solution, global_test, solve, suspects
from accelstudy.adjustment.quality.whole_model import REFUTED
from accelstudy.approaches import Approach, get_approach
from accelstudy.campaign.assessment import SUSPECT
from accelstudy.campaign.fit import fit_campaign, least_sigma
from accelstudy.campaign.format import Campaign
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.explanations import Explanation
from accelstudy.diagnosis.decision.posterior import of_effects
from accelstudy.diagnosis.decision.search import Search
from accelstudy.diagnosis.decision.verdict import Finding, find, lack_of_fit
from accelstudy.diagnosis.evidence import noise as noises
from accelstudy.diagnosis.evidence.chance import SIMULATIONS
from accelstudy.diagnosis.evidence.detection import Detection
from accelstudy.diagnosis.evidence.noise import NoiseTest
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Setting
from accelstudy.diagnosis.space.location import LACK_OF_FIT, locate
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.worth.changes import Change, parameter_changes
from accelstudy.diagnosis.worth.gap import HeldOutGap
from accelstudy.diagnosis.worth.held_out import held_out
from accelstudy.diagnosis.worth.limits import UpperLimit, upper_limits
from accelstudy.diagnosis.worth.next_positions import NextPosition, next_positions
from accelstudy.diagnosis.worth.tilt import leveling_rms
from accelstudy.errors import InputError
from accelstudy.gross_errors.recognition import Recognised, recognise
from accelstudy.progress import stage
from accelstudy.sensor import SensorModel

Array = NDArray[np.float64]

BEYOND_WHITE = 5.0
"""Ratio of variances up to which white noise within the holds may explain the scatter of means."""
LEVEL_EFFECTS = 0.035
"""Level of the test for anything that is missing."""
LEVEL_NOISE = 0.01
"""Family-wise level of the tests of the noise beside that of its level, which has `REFUTED`; all
together they alarm in 5 % of the campaigns in which nothing is missing."""


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
    parameters : tuple of (name, value, sigma, unit), SI
    position : int, of a bumped position
    """

    name: str
    spec: str
    equivalence_class: tuple[str, ...]
    p_value: float | None
    posterior: float | None
    rivals: tuple[tuple[str, float], ...] = ()
    parameters: tuple[tuple[str, float, float | None, str], ...] = ()
    position: int | None = None


@dataclass(frozen=True)
class Gap:
    """How far the disagreement shrinks; None where it does not apply.

    `statement` says what is confirmed: "effect", that one of the credible set is missing, or
    "name", that it is the most probable one; None if nothing is.
    """

    before: float
    after: float | None = None
    held_out: HeldOutGap | None = None
    leveling: tuple[float, float] | None = None
    confirmed: bool = False
    reason: str = ""
    statement: str | None = None


@dataclass(frozen=True)
class Diagnosis:
    """What the diagnosis of one campaign found.

    Attributes
    ----------
    campaign : Campaign, with a recognised gross error mended
    approach : Approach
    model, extended : SensorModel, without and with the effects that were found
    verdict : str, "no_effect", "named", "narrowed", "unknown", "noise_model" or "gross_error"
    credible_set : tuple of Explanation, most probable first; empty if nothing is missing
    found : tuple of Named
    base : Solution, of the base model with equal axes
    setting : Setting, of the base fit, with unequal axes weighted
    final : Setting, of the extended fit, or the same
    sigma_known : bool
    sigma_source : str
    unit_variance : float, variance of unit weight that is taken for the noise
    noise_tests : tuple of NoiseTest
    screening : Detection, of all candidates
    probabilities : dict of name to posterior probability, given that something is missing
    location : dict of group to share of the excess χ²
    gap : Gap
    changes : tuple of Change, of the parameters of the base model by effects that were added
    upper_limits : tuple of UpperLimit, of the effects that were not found
    next_positions : tuple of NextPosition, that would separate what is left best
    simulations : int, of residuals without any effect
    recognised : Recognised or None, a gross error of unit, axes or order
    suspects : tuple of (label, p-value), positions that the calibration marks, on their own
    reason : str, why the verdict is what it is
    """

    campaign: Campaign
    approach: Approach
    model: SensorModel
    extended: SensorModel
    verdict: str
    credible_set: tuple[Explanation, ...]
    found: tuple[Named, ...]
    base: Solution
    setting: Setting
    final: Setting
    sigma_known: bool
    sigma_source: str
    unit_variance: float
    noise_tests: tuple[NoiseTest, ...]
    screening: Detection
    probabilities: Mapping[str, float]
    location: Mapping[str, float]
    gap: Gap
    changes: tuple[Change, ...]
    upper_limits: tuple[UpperLimit, ...]
    next_positions: tuple[NextPosition, ...]
    simulations: int
    recognised: Recognised | None
    suspects: tuple[tuple[int, float], ...]
    reason: str

    @property
    def global_test(self) -> GlobalTest | None:
        """Test of the base model against the a-priori sigma."""
        if not self.sigma_known:
            return None
        return global_test(self.base.omega, self.base.redundancy)

    @property
    def sigma_position(self) -> float:
        """Noise of a position mean, m/s², as it is taken."""
        return float(
            np.sqrt(self.unit_variance) * np.mean(self.final.frame.residuals.sigmas[:, :3])
        )


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
    if approach is None:
        approach = get_approach("gravity" if campaign.angles is None else "robot")
    recognised = recognise(campaign, approach)
    if recognised is not None:
        campaign = recognised.mended
    return _Run(campaign, model, approach, seed, recognised).diagnosis()


@dataclass(frozen=True)
class _Run:
    """One diagnosis on its way; every stage is computed once, when it is needed."""

    campaign: Campaign
    model: SensorModel
    approach: Approach
    seed: int
    recognised: Recognised | None

    def stage(self, number: int) -> np.random.SeedSequence:
        """Seed of a stage, which no other stage changes."""
        return np.random.SeedSequence(self.seed, spawn_key=(number,))

    @property
    def sigma_known(self) -> bool:
        return self.campaign.sigma_force is not None

    # --- base fit -------------------------------------------------------------------------------

    @cached_property
    def first(self) -> Solution:
        """The base fit, with equal axes."""
        campaign = self.campaign
        # Without a sigma the weights of forces and angles need one: that of the residuals.
        for _ in range(1 if self.sigma_known else 3):
            fit = fit_campaign(campaign, self.model, self.approach)
            if fit.adjustment.redundancy <= 0:
                raise InputError(
                    f"{campaign.name}: {campaign.n_positions} positions leave no redundancy beside "
                    f"the {self.model.n_parameters} parameters of {self.model.name!r}: nothing can "
                    "be tested; more positions are needed"
                )
            if not self.sigma_known:
                least = max(1e-9, least_sigma(campaign, self.approach))
                sigma = max(fit.sigma_position, least)
                campaign = replace(campaign, sigma_force=sigma, slope=None, sd_slope=None)
        fitted = solve(fit.model, fit.approach, fit.observed, fit.adjustment)
        if self.sigma_known or not self.is_white(fit.sigma_position_posteriori):
            return fitted
        assert self.white is not None
        observed = replace(fit.observed, sigma_force=float(np.sqrt(np.mean(self.white))))
        return solve(fit.model, fit.approach, observed)

    @property
    def noise_level(self) -> Level:
        """What is known of the noise of a position mean."""
        if self.sigma_known:
            return Level.given()
        sigma = self.first.variances[:, :3].mean()
        supposed = self.white is not None and np.isclose(sigma, np.mean(self.white))
        return Level.within_holds() if supposed else Level.unknown()

    def is_white(self, sigma: float) -> bool:
        """Whether white noise within the holds may explain a scatter of the means."""
        least = least_sigma(self.campaign, self.approach)
        if self.white is None or np.mean(self.white) <= least**2:
            return False
        return bool(1 / BEYOND_WHITE < sigma**2 / np.mean(self.white) < BEYOND_WHITE)

    @cached_property
    def search(self) -> Search:
        return Search(self.first, self.stage(0), self.noise_level, self.white)

    @cached_property
    def white(self) -> Array | None:
        """Variances of position means, (3,), if white noise within the holds is all there is."""
        sd, n = self.campaign.sd, self.campaign.n_samples
        if sd is None or n is None or not np.all(sd > 0):
            return None
        return np.asarray(np.mean(sd**2 / n[:, None], axis=0))

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
        final, variance = finding.setting, self.unit_variance(finding.setting)
        names = [choice.best.name for choice in finding.chosen]
        with stage("held-out positions"):
            gap = self.gap(finding, variance)
        with stage("next positions"):
            following = self.next_positions(finding)
        return Diagnosis(
            campaign=self.campaign,
            approach=self.approach,
            model=self.model,
            extended=final.frame.solution.model,
            verdict=verdict,
            credible_set=finding.credible_set,
            found=found,
            base=self.first,
            setting=search.setting,
            final=final,
            sigma_known=self.sigma_known,
            sigma_source=self.sigma_source(final),
            unit_variance=variance,
            noise_tests=tests,
            screening=search.detection,
            probabilities=self.probabilities(finding),
            location=self.location(finding, variance),
            gap=gap,
            changes=self.changes(finding, variance),
            upper_limits=tuple(upper_limits(final, variance, [*names, *self.open(finding)])),
            next_positions=following,
            simulations=SIMULATIONS,
            recognised=self.recognised,
            suspects=self.suspects,
            reason=reason,
        )

    def open(self, finding: Finding) -> set[str]:
        """Names that a narrowed finding leaves open, to which no limit applies."""
        if finding.verdict != "narrowed":
            return set()
        classes = [alike for one in finding.credible_set for alike in one.classes]
        return {name for alike in classes for name in alike}

    def probabilities(self, finding: Finding) -> dict[str, float]:
        """Posterior of each name, alone or with another; a class stands under its first name.

        Where nothing is missing they only say what would come first, each name by itself.
        """
        if finding.posterior is None:
            return self.search.probabilities
        first: dict[tuple[str, ...], str] = {}
        found: dict[str, float] = defaultdict(float)
        for one in finding.posterior.explanations:
            # Two bumped positions have one name.
            named = zip(one.classes, one.names, strict=True)
            for name in {first.setdefault(members, name): None for members, name in named}:
                found[name] += one.posterior
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    def finding(self) -> tuple[Finding, tuple[NoiseTest, ...]]:
        """Find what is missing: effects first, then the noise, by the tests of it."""
        search = self.search
        if search.exact:
            reason = "the campaign is its own model: what is left are rounding errors"
            return Finding("no_effect", search.setting, reason), ()
        if search.detection.p_value < LEVEL_EFFECTS:
            finding = find(search)
            return finding, self.noise_tests(finding.setting)
        tests = self.noise_tests(search.setting)
        worst = self.worst_noise(tests)
        if worst is None:
            return Finding("no_effect", search.setting), tests
        return self.judge_noise(worst), tests

    # --- noise ----------------------------------------------------------------------------------

    def noise_tests(self, setting: Setting) -> tuple[NoiseTest, ...]:
        """All tests of the noise that the campaign allows, on the residuals of a fit."""
        residuals, campaign = setting.frame.residuals.positions, self.campaign
        chance = self.search.chance
        sigma = float(np.mean(residuals.sigmas[:, :3]))
        tests = []
        if self.sigma_known:
            tests.append(self.level(setting))
        tests += [
            noises.axis_test(residuals, chance),
            noises.colour_test(residuals, chance),
            noises.tail_test(residuals, chance),
            self.resolution,
        ]
        if campaign.sd is not None and campaign.n_samples is not None:
            tests.append(noises.within_hold_test(residuals, sigma, campaign.sd, campaign.n_samples))
        return tuple(tests)

    def level(self, setting: Setting) -> NoiseTest:
        """Test the level of the noise; of the base fit as the calibration does, by its own Ω."""
        if setting is self.search.setting:
            return noises.level_test(Residuals.of(self.first))
        return noises.level_test(setting.frame.residuals.positions)

    @cached_property
    def resolution(self) -> NoiseTest:
        """Whether the readings are coarse, beside the noise of the base fit."""
        residuals = self.search.residuals.positions
        sigma = float(np.mean(residuals.sigmas[:, :3]))
        # A sigma far too large would take the attitudes for steps.
        noise = sigma * min(1.0, float(np.sqrt(residuals.variance)))
        return noises.resolution_test(self.campaign.forces, noise)

    def worst_noise(self, tests: Sequence[NoiseTest]) -> NoiseTest | None:
        """Return what is wrong with the noise, the most specific finding first."""
        level = next((t for t in tests if t.name == noises.LEVEL), None)
        counted = [
            t
            for t in tests
            # A sigma that the residuals confirm knows of what varies from hold to hold.
            if not (t.remark.startswith("white noise within") and self.sigma_known
                    and level is not None and level.p_value >= REFUTED)
        ]  # fmt: skip
        others = LEVEL_NOISE / max(len(counted) - (level is not None), 1)
        found = [t for t in counted if t.p_value < (REFUTED if t is level else others)]
        order = [noises.STEPS, noises.COLOUR, noises.AXES, noises.TAILS, noises.LEVEL]
        return min(found, key=lambda t: order.index(t.name), default=None)

    def judge_noise(self, worst: NoiseTest) -> Finding:
        """Judge a finding about the noise, when no effect was significant."""
        setting, posterior = self.search.setting, self.search.posterior
        if lack_of_fit(self.search) < REFUTED and worst.name != noises.STEPS:
            reason = (
                "repeated positions agree better with each other than with the model, so it is not "
                "the noise"
            )
            return Finding("unknown", setting, reason, posterior=posterior)
        if worst.name != noises.LEVEL or worst.estimate[0] < 1:
            return Finding("noise_model", setting, worst.remark, posterior=posterior)
        # Larger residuals may be an effect that the test for a pattern could not see.
        noise = sum(e.posterior for e in posterior.explanations if e.names[0] in noises.NOISES)
        if noise >= priors.MORE_PROBABLE:
            return Finding("noise_model", setting, worst.remark, posterior=posterior)
        name = next(n for e in posterior.explanations for n in e.names if n not in noises.NOISES)
        reason = (
            f"{worst.remark}; it may be the noise (probability {noise:.2f}), but "
            f"{'something' if name == 'unknown' else 'an effect such as ' + name} is not excluded"
        )
        return Finding("unknown", setting, reason, posterior=posterior)

    def unit_variance(self, final: Setting) -> float:
        """Variance of unit weight: 1 if sigma is known and not refuted, else a posteriori."""
        if self.sigma_known and self.level(final).p_value >= REFUTED:
            return 1.0
        return final.frame.residuals.positions.variance

    def sigma_source(self, final: Setting) -> str:
        """Where the noise level comes from."""
        return "a-priori" if self.sigma_known and self.unit_variance(final) == 1 else "residuals"

    @property
    def suspects(self) -> tuple[tuple[int, float], ...]:
        """Positions that a calibration by the base model marks, and their p-values."""
        if self.search.exact:
            return ()
        trusted = self.sigma_known and self.level(self.search.setting).p_value >= REFUTED
        first = self.first
        found = suspects(first.model, first.approach, first.observed, SUSPECT, trusted)
        return tuple((int(self.campaign.positions[s.position]), s.p_value) for s in found)

    # --- what else is said ----------------------------------------------------------------------

    def location(self, finding: Finding, variance: float) -> dict[str, float]:
        """Shares of the excess χ² above the given noise or, without it, above what is left.

        That is the noise after what was found or, if something unknown is missing, the least that
        any group of regressors leaves.
        """
        residuals, groups = self.search.residuals, self.search.groups
        if self.sigma_known:
            variance = 1.0
        elif finding.verdict == "unknown":
            z, r = residuals.z, residuals.redundancy
            spaces = [space for name, space in groups.items() if name != LACK_OF_FIT]
            left = [float((z @ z - q.parts(z)[0]) / (r - q.dims[0])) for q in spaces]
            variance = min([variance, *left])
        bumped = self.search.setting.candidates.get(OUTLIER)
        return locate(groups, bumped, residuals, self.search.chance, variance)

    def described(self, finding: Finding, tests: Sequence[NoiseTest]) -> tuple[Named, ...]:
        """Describe what was found."""
        search = self.search
        if finding.verdict == "noise_model":
            worst = self.worst_noise(tests)
            posterior = finding.posterior or search.posterior
            top = next(e.names[0] for e in posterior.explanations if e.names[0] in noises.NOISES)
            name = top if worst is None else worst.name
            p = search.detection.p_value if worst is None else worst.p_value
            return (Named(name, name, (name,), p, posterior.of_single(name)),)
        solution = finding.setting.frame.solution
        sigma = np.sqrt(np.diag(solution.cofactors) * self.unit_variance(finding.setting))
        columns = {name: i for i, name in enumerate(solution.model.parameter_names)}
        found = []
        for choice in finding.chosen:
            best, p = choice.best, search.detection.p_family[choice.best.name]
            if best.shown is None:
                label = int(self.campaign.positions[best.place])
                found.append(
                    Named(OUTLIER, OUTLIER, (OUTLIER,), p, choice.probability, position=label)
                )
                continue
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
                    spec=best.spec,
                    equivalence_class=choice.members,
                    p_value=p,
                    posterior=choice.probability,
                    rivals=search.rivals(best, choice.members),
                    parameters=parameters,
                )
            )
        return tuple(found)

    def gap(self, finding: Finding, variance: float) -> Gap:
        """Compare the models on positions that were used neither for choosing nor for fitting."""
        before = self.first.omega / self.first.redundancy
        if not finding.chosen:
            return Gap(before)
        final, hold = finding.setting.frame.solution, self.search.setting.frame.hold
        after = final.omega / final.redundancy
        leveling = leveling_rms(self.first, final, hold, variance)
        if finding.verdict not in ("named", "narrowed"):
            return Gap(before, after, leveling=leveling)
        known = variance if self.sigma_known else None
        seeds = [self.stage(number) for number in (1, 2, 3, 4)]
        held = held_out(self.search, finding, known, LEVEL_EFFECTS, seeds)
        confirmed = held.statement is not None
        return Gap(before, after, held.gap, leveling, confirmed, held.reason, held.statement)

    def changes(self, finding: Finding, variance: float) -> tuple[Change, ...]:
        """Compare what added effects should change of the other parameters with what they do."""
        effects = [choice.best.shown for choice in finding.chosen]
        added = [effect for effect in effects if effect is not None]
        if not added or len(added) < len(effects):
            return ()
        final, frame = finding.setting.frame.solution, self.search.setting.frame
        return parameter_changes(self.first, final, frame, added, variance)

    def next_positions(self, finding: Finding) -> tuple[NextPosition, ...]:
        """Positions that tell the two most probable of the credible set apart."""
        if finding.posterior is None or finding.verdict not in ("named", "narrowed", "unknown"):
            return ()
        weighed = zip(finding.credible_set, finding.posterior.all, strict=False)
        rivals = [one.best for explanation, one in weighed if of_effects(explanation)]
        if len(rivals) < 2:
            return ()
        return tuple(next_positions(self.search.setting.frame, *rivals[:2]))
