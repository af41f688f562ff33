"""The diagnosis of a campaign, stage after stage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from accelstudy.adjustment.quality import GlobalTest, Solution, global_test, solve
from accelstudy.approaches import Approach, get_approach
from accelstudy.campaign.fit import fit_campaign
from accelstudy.campaign.format import Campaign
from accelstudy.diagnosis import gap as gaps
from accelstudy.diagnosis import noise as noises
from accelstudy.diagnosis.gross import Recognised, recognise
from accelstudy.diagnosis.hypotheses import (
    OUTLIER,
    Hypothesis,
    Setting,
    cosines,
    same_space,
    setting_of,
)
from accelstudy.diagnosis.limits import UpperLimit, upper_limits
from accelstudy.diagnosis.location import groups, locate
from accelstudy.diagnosis.naming import (
    COLOUR,
    LEVEL,
    UNKNOWN,
    colour_evidence,
    known_level_evidence,
    log_evidence,
    mean_evidence,
    posterior,
    shapes_evidence,
    widths,
)
from accelstudy.diagnosis.next_positions import NextPosition, next_positions
from accelstudy.diagnosis.noise import NoiseTest
from accelstudy.diagnosis.pairs import best_pairs
from accelstudy.diagnosis.residuals import Residuals
from accelstudy.diagnosis.screening import SIMULATIONS, Screening, screen, share
from accelstudy.diagnosis.tilt import leveling_rms
from accelstudy.errors import InputError
from accelstudy.models import compose
from accelstudy.sensor import SensorModel

Array = NDArray[np.float64]

LEVEL_EFFECTS = 0.025
"""Family-wise level of the tests of effects, bumped positions and groups of regressors."""
LEVEL_NOISE = 0.015
"""Family-wise level of the tests of the noise; together they stay below 5 %."""
LEVEL_ADEQUATE = 0.004
"""Family-wise level at which something is still missing beside a named effect."""
SURE = 0.7
"""Posterior probability from which on a name is given."""
PRIOR = {COLOUR: 3.0}
"""Prior weights beside 1 for each class: all real noise has some colour."""
RIVAL = 0.5
"""Canonical cosine from which on an effect is listed as a rival."""
AXES_DIFFER = 0.01


@dataclass(frozen=True)
class Named:
    """An effect, noise effect or gross error that was found.

    Attributes
    ----------
    name, spec : str; of a bumped position `spec` is the name
    equivalence_class : tuple of str, names that mean the same in this campaign
    p_value : float, family-wise
    posterior : float
    rivals : tuple of (name, cosine)
    parameters : tuple of (name, value, sigma, unit), SI
    position : int, of a bumped position
    """

    name: str
    spec: str
    equivalence_class: tuple[str, ...]
    p_value: float
    posterior: float
    rivals: tuple[tuple[str, float], ...] = ()
    parameters: tuple[tuple[str, float, float | None, str], ...] = ()
    position: int | None = None


@dataclass(frozen=True)
class Gap:
    """How far the disagreement shrinks; None where it does not apply."""

    before: float
    after: float | None = None
    held_out: gaps.HeldOutGap | None = None
    leveling: tuple[float, float] | None = None
    confirmed: bool = False
    reason: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """What the diagnosis of one campaign found.

    Attributes
    ----------
    campaign : Campaign, with a recognised gross error mended
    approach : Approach
    model, extended : SensorModel, without and with the effects that were found
    verdict : str, "no_effect", "named", "unknown", "noise_model" or "gross_error"
    found : tuple of Named
    base : Solution, of the base model with equal axes
    setting : Setting, of the base fit, with unequal axes weighted
    final : Setting, of the extended fit, or the same
    sigma_known : bool
    sigma_source : str
    unit_variance : float, variance of unit weight that is taken for the noise
    noise_tests : tuple of NoiseTest
    screening : Screening, of all candidates
    probabilities : dict of name to posterior probability, given that something is missing
    location : dict of group to share of the excess χ²
    gap : Gap
    upper_limits : tuple of UpperLimit, of the effects that were not found
    next_positions : tuple of NextPosition, that would separate what is left best
    simulations : int, of residuals without any effect
    recognised : Recognised or None, a gross error of unit, axes or order
    reason : str, why the verdict is what it is
    """

    campaign: Campaign
    approach: Approach
    model: SensorModel
    extended: SensorModel
    verdict: str
    found: tuple[Named, ...]
    base: Solution
    setting: Setting
    final: Setting
    sigma_known: bool
    sigma_source: str
    unit_variance: float
    noise_tests: tuple[NoiseTest, ...]
    screening: Screening
    probabilities: Mapping[str, float]
    location: Mapping[str, float]
    gap: Gap
    upper_limits: tuple[UpperLimit, ...]
    next_positions: tuple[NextPosition, ...]
    simulations: int
    recognised: Recognised | None
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

    def rng(self, stage: int) -> np.random.Generator:
        """Random numbers of a stage, which no other stage changes."""
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(stage,)))

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
                campaign = replace(campaign, sigma_force=max(fit.sigma_position, 1e-9))
        return solve(fit.model, fit.approach, fit.observed, fit.adjustment)

    @cached_property
    def null(self) -> Array:
        """Residuals without any effect, (B, r)."""
        return self.rng(0).standard_normal((SIMULATIONS, self.first.redundancy))

    @cached_property
    def axes(self) -> NoiseTest:
        """Whether the axes differ in noise, by the base fit."""
        return noises.axis_test(Residuals.of(self.first), self.null)

    @cached_property
    def solution(self) -> Solution:
        """The base fit, with the axes weighted by their noise if it clearly differs."""
        return self.weighted(self.first, self.axes)

    def weighted(self, solution: Solution, axes: NoiseTest) -> Solution:
        """Fit again with unequal axes, if they are."""
        if axes.p_value >= AXES_DIFFER:
            return solution
        factors = np.maximum(axes.estimate, 0.05)
        factors = factors / np.mean(factors)
        sigma = np.sqrt(factors) * np.mean(np.sqrt(solution.variances[:, :3]))
        n = len(solution.variances)
        observed = replace(solution.observed, sigma_force=np.broadcast_to(sigma, (n, 3)))
        return solve(solution.model, self.approach, observed)

    @cached_property
    def setting(self) -> Setting:
        return setting_of(self.solution)

    @cached_property
    def z(self) -> Array:
        return self.setting.frame.residuals.z

    # --- screening ------------------------------------------------------------------------------

    @cached_property
    def groups(self) -> dict[str, Array]:
        return groups(self.setting)

    @cached_property
    def screening(self) -> Screening:
        bases: dict[str, Sequence[Array]] = {
            name: [h.basis for h in shapes] for name, shapes in self.setting.candidates.items()
        }
        for name, basis in self.groups.items():
            bases[f"group:{name}"] = [basis]
        return screen(bases, self.z, self.null)

    # --- naming ---------------------------------------------------------------------------------

    @cached_property
    def evidence(self) -> dict[str, float]:
        """Log evidence of all single hypotheses."""
        evidence = {
            name: mean_evidence(shapes_evidence([h.basis for h in shapes], self.z), widths(shapes))
            for name, shapes in self.shapes.items()
        }
        evidence[COLOUR] = colour_evidence(self.setting.frame.residuals)
        evidence[UNKNOWN] = self.unknown_evidence
        return evidence

    @cached_property
    def unknown_evidence(self) -> float:
        r = len(self.z)
        logs = [float(log_evidence(share(q, self.z), q.shape[1], r)) for q in self.groups.values()]
        return mean_evidence(np.array(logs)) if logs else 0.0

    @cached_property
    def classes(self) -> list[tuple[Hypothesis, tuple[str, ...]]]:
        """Candidates with those that mean the same, strongest evidence first."""
        left = sorted(self.setting.candidates, key=lambda name: -self.evidence[name])
        classes = []
        while left:
            name = left.pop(0)
            best = self.best_shape(name)
            alike = [
                other
                for other in left
                if other != OUTLIER
                and name != OUTLIER
                and any(same_space(best, h) for h in self.setting.candidates[other])
            ]
            left = [other for other in left if other not in alike]
            classes.append((best, tuple(sorted((name, *alike)))))
        return classes

    def best_shape(self, name: str) -> Hypothesis:
        """Shape of a candidate that explains most."""
        return max(self.shapes[name], key=lambda h: float(share(h.basis, self.z)))

    @cached_property
    def shapes(self) -> dict[str, Sequence[Hypothesis]]:
        """Shapes of each candidate, close together about the best one of a smooth effect."""
        return {name: self.refined(shapes) for name, shapes in self.setting.candidates.items()}

    def refined(self, shapes: Sequence[Hypothesis]) -> Sequence[Hypothesis]:
        """Add shapes between the neighbours of the best one, and again between those."""
        if shapes[0].smooth is None or len(shapes) < 2:
            return shapes
        fine = list(shapes)
        for _ in range(3):
            best = int(np.argmax([float(share(h.basis, self.z)) for h in fine]))
            low, high = (fine[k].value for k in (max(best - 1, 0), min(best + 1, len(fine) - 1)))
            tried = (self.shaped(fine[best], value) for value in np.geomspace(low, high, 7)[1:-1])
            fine += [h for h in tried if h is not None]
            fine.sort(key=lambda h: h.value)
        return fine

    def shaped(self, hypothesis: Hypothesis, value: float) -> Hypothesis | None:
        """Return a smooth effect with another value of its setting; None if it shows less."""
        assert hypothesis.effect is not None
        assert hypothesis.smooth is not None
        effect = type(hypothesis.effect)(**{hypothesis.smooth: float(f"{value:.6g}")})
        shaped = self.setting.hypothesis(effect)
        return shaped if shaped is not None and shaped.dim == hypothesis.dim else None

    @cached_property
    def probabilities(self) -> dict[str, float]:
        """Posterior probabilities given that something is missing; a class under its first name."""
        evidence = {best.name: self.evidence[best.name] for best, _ in self.classes}
        evidence |= {name: self.evidence[name] for name in (COLOUR, UNKNOWN)}
        return posterior(evidence, PRIOR)

    def rivals(self, best: Hypothesis, members: Sequence[str]) -> tuple[tuple[str, float], ...]:
        """Other effects with similar signatures, nearest first."""
        if best.effect is None:
            return ()
        near = {
            name: max(float(cosines(best.ideal, h.ideal)[0]) for h in shapes)
            for name, shapes in self.setting.candidates.items()
            if name != OUTLIER and name not in members
        }
        ranked = sorted(near.items(), key=lambda item: -item[1])
        return tuple((name, cosine) for name, cosine in ranked if cosine >= RIVAL)

    # --- extending the model --------------------------------------------------------------------

    def extended_model(self, chosen: Sequence[Hypothesis]) -> SensorModel:
        """The base model with the effects of hypotheses added."""
        specs = [h.spec for h in chosen if h.effect is not None]
        if not specs:
            return self.model
        base = tuple(effect.spec for effect in self.model.effects)
        name = "-".join([self.model.name, *(h.name for h in chosen if h.effect is not None)])
        return compose(name, (*base, *specs))

    def refit(self, chosen: Sequence[Hypothesis]) -> Solution | None:
        """Fit rigorously with effects added and bumped positions left out."""
        model = self.extended_model(chosen)
        # From an ideal sensor the iterations may not reach a large effect.
        start = dict(zip(self.model.parameter_names, self.first.parameters, strict=False))
        observed = replace(self.first.observed, initial=model.vector(start))
        bumped = [position_of(h) for h in chosen if h.effect is None]
        if bumped:
            observed = observed.take(np.setdiff1d(np.arange(self.campaign.n_positions), bumped))
        try:
            solution = solve(model, self.approach, observed)
        except (InputError, np.linalg.LinAlgError):
            return None
        return solution if solution.redundancy > 0 else None

    def sharpened(self, chosen: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Search the settings of smooth effects by refits: a large effect is not of first order."""
        sharp = list(chosen)
        for k, start in enumerate(chosen):
            if start.smooth is None:
                continue
            values = [h.value for h in self.setting.candidates[start.name]]
            low = max((v for v in values if v < start.value), default=start.value)
            high = min((v for v in values if v > start.value), default=start.value)

            def omega(log: float, k: int = k, start: Hypothesis = start) -> float:
                shaped = self.shaped(start, np.exp(log))
                if shaped is None:
                    return self.first.omega
                trial = self.refit([*sharp[:k], shaped, *sharp[k + 1 :]])
                return self.first.omega if trial is None else trial.omega

            found = minimize_scalar(
                omega, bounds=np.log([low, high]), method="bounded", options={"xatol": 1e-4}
            )
            shaped = self.shaped(start, np.exp(found.x))
            if shaped is not None and found.fun < omega(np.log(start.value)):
                sharp[k] = shaped
        return sharp

    def extend(self, chosen: Sequence[Hypothesis]) -> Solution | None:
        """Refit; axes that seemed unequal because of the effect are equal now."""
        solution = self.refit(chosen)
        if solution is None:
            return None
        residuals = Residuals.of(solution)
        null = self.null[:, : residuals.redundancy]
        try:
            return self.weighted(solution, noises.axis_test(residuals, null))
        except (InputError, np.linalg.LinAlgError):
            return solution

    def extend_best(
        self, chosen: Sequence[tuple[Hypothesis, tuple[str, ...]]]
    ) -> tuple[list[Hypothesis], Solution] | None:
        """Refit with the members of the classes that fit best.

        To first order the members of a class are the same. Large effects are not of first order.
        """
        alternatives = [
            [best if name == best.name else self.best_shape(name) for name in members]
            if best.effect is not None
            else [best]
            for best, members in chosen
        ]
        sharp = [self.sharpened(one) for one in product(*alternatives)]
        refits = [(one, self.extend(one)) for one in sharp]
        solved = [(one, solution) for one, solution in refits if solution is not None]
        return min(solved, key=lambda item: item[1].omega, default=None)

    def adequate(self, solution: Solution) -> tuple[bool, Setting]:
        """Whether nothing more is missing after a refit."""
        setting = setting_of(solution)
        z = setting.frame.residuals.z
        null = self.null[:, : len(z)]
        bases: dict[str, Sequence[Array]] = {
            name: [h.basis for h in shapes] for name, shapes in setting.candidates.items()
        }
        for name, basis in groups(setting).items():
            bases[f"group:{name}"] = [basis]
        return screen(bases, z, null).smallest >= LEVEL_ADEQUATE, setting

    # --- the decision ---------------------------------------------------------------------------

    def diagnosis(self) -> Diagnosis:
        """Decide, stage by stage."""
        chosen: list[tuple[Hypothesis, tuple[str, ...], float]] = []
        final, reason = self.setting, ""
        tests = self.noise_tests(self.setting)
        verdict = "no_effect"
        if self.screening.smallest < LEVEL_EFFECTS:
            verdict, chosen, final, reason = self.name_effects()
            tests = self.noise_tests(final)
        else:
            worst = self.worst_noise(tests)
            if worst is not None:
                verdict, reason = self.judge_noise(worst)
        found = self.described(verdict, chosen, final, tests)
        if self.recognised is not None:
            verdict, reason = "gross_error", self.recognised.reason
            found = (
                Named(
                    self.recognised.name, self.recognised.name, (self.recognised.name,), 0.0, 1.0
                ),
                *found,
            )
        variance = self.unit_variance(final)
        return Diagnosis(
            campaign=self.campaign,
            approach=self.approach,
            model=self.model,
            extended=final.frame.solution.model,
            verdict=verdict,
            found=found,
            base=self.first,
            setting=self.setting,
            final=final,
            sigma_known=self.sigma_known,
            sigma_source=self.sigma_source(final),
            unit_variance=variance,
            noise_tests=tests,
            screening=self.screening,
            probabilities=self.probabilities,
            location=self.location(variance),
            gap=self.gap(verdict, chosen, final, variance),
            upper_limits=tuple(upper_limits(final, variance, [h.name for h, _, _ in chosen])),
            next_positions=self.next_positions(verdict, chosen),
            simulations=SIMULATIONS,
            recognised=self.recognised,
            reason=reason,
        )

    def name_effects(
        self,
    ) -> tuple[str, list[tuple[Hypothesis, tuple[str, ...], float]], Setting, str]:
        """Name what is missing, given that something is."""
        top = next(iter(self.probabilities))
        sure = self.probabilities[top]
        if top == COLOUR and sure >= SURE:
            return "noise_model", [], self.setting, "successive holds are alike"
        if top not in (COLOUR, UNKNOWN):
            best, members = next(item for item in self.classes if item[0].name == top)
            refit = self.extend_best([(best, members)])
            if refit is not None:
                (best,), solution = refit
                adequate, setting = self.adequate(solution)
                if adequate and sure >= SURE:
                    verdict = "gross_error" if best.effect is None else "named"
                    return verdict, [(best, members, sure)], setting, ""
                if adequate:
                    second = list(self.probabilities)[1]
                    reason = (
                        f"{top} explains it with a probability of {sure:.2f} only, and {second} "
                        f"with {self.probabilities[second]:.2f}"
                    )
                    return "unknown", [], self.setting, reason
        return self.name_pair()

    def name_pair(
        self,
    ) -> tuple[str, list[tuple[Hypothesis, tuple[str, ...], float]], Setting, str]:
        """Search all pairs, once no single effect is enough."""
        pairs = best_pairs(self.setting.all, self.z)
        if not pairs:
            return "unknown", [], self.setting, "no effect of the catalogue explains it"
        evidence = {str(i): pair.log_evidence for i, pair in enumerate(pairs)}
        evidence |= {name: self.evidence[name] for name in (COLOUR, UNKNOWN)}
        probabilities = posterior(evidence, PRIOR)
        top = next(iter(probabilities))
        if top in (COLOUR, UNKNOWN):
            if top == COLOUR and probabilities[top] >= SURE:
                return "noise_model", [], self.setting, "successive holds are alike"
            return "unknown", [], self.setting, "no effect or pair of effects explains it"
        pair = pairs[int(top)]
        # Pairs whose members mean the same are one.
        seen = {h.spec: h for other in pairs for h in other.best}
        alike = {spec: self.members(h) for spec, h in seen.items()}
        members = [alike[h.spec] for h in pair.best]
        sure = sum(
            probabilities[str(i)]
            for i, other in enumerate(pairs)
            if {alike[h.spec] for h in other.best} == set(members)
        )
        if sure < SURE:
            return (
                "unknown",
                [],
                self.setting,
                (
                    f"the most probable pair, {' and '.join(pair.names)}, has a probability of "
                    f"{sure:.2f} only"
                ),
            )
        refit = self.extend_best(list(zip(pair.best, members, strict=True)))
        if refit is None:
            return "unknown", [], self.setting, "the refit with two effects has no solution"
        best, solution = refit
        adequate, setting = self.adequate(solution)
        if not adequate:
            return "unknown", [], self.setting, "two effects of the catalogue are not enough"
        found = [(h, m, sure) for h, m in zip(best, members, strict=True)]
        found.sort(key=lambda item: item[0].effect is not None)
        verdict = "gross_error" if found[0][0].effect is None else "named"
        return verdict, found, setting, ""

    def members(self, hypothesis: Hypothesis) -> tuple[str, ...]:
        """Names that mean the same as a hypothesis in this campaign."""
        if hypothesis.effect is None:
            return (hypothesis.spec,)
        names = {
            name
            for name, shapes in self.setting.candidates.items()
            if name != OUTLIER and any(same_space(hypothesis, h) for h in shapes)
        }
        return tuple(sorted(names | {hypothesis.name}))

    # --- noise ----------------------------------------------------------------------------------

    def noise_tests(self, setting: Setting) -> tuple[NoiseTest, ...]:
        """All tests of the noise that the campaign allows, on the residuals of a fit."""
        residuals, campaign = setting.frame.residuals, self.campaign
        z = residuals.z
        null = self.null[:, : len(z)]
        sigma = float(np.mean(residuals.sigmas[:, :3]))
        tests = []
        if self.sigma_known:
            tests.append(noises.level_test(z))
        axes = self.axes if setting is self.setting else noises.axis_test(residuals, null)
        tests += [
            axes,
            noises.colour_test(residuals, null),
            noises.tail_test(residuals, null),
            self.resolution,
        ]
        if campaign.sd is not None and campaign.n_samples is not None:
            tests.append(noises.within_hold_test(z, sigma, campaign.sd, campaign.n_samples))
        return tuple(tests)

    @cached_property
    def resolution(self) -> NoiseTest:
        """Whether the readings are coarse, beside the noise of the base fit."""
        sigma = float(np.mean(self.setting.frame.residuals.sigmas[:, :3]))
        return noises.resolution_test(self.campaign.forces, sigma)

    def worst_noise(self, tests: Sequence[NoiseTest]) -> NoiseTest | None:
        """Return what is wrong with the noise, the most specific finding first."""
        level = next((t for t in tests if t.name == LEVEL), None)
        counted = [
            t
            for t in tests
            # A sigma that the residuals confirm knows of what varies from hold to hold.
            if not (t.remark.startswith("white noise within") and self.sigma_known
                    and level is not None and level.p_value > LEVEL_NOISE)
        ]  # fmt: skip
        limit = LEVEL_NOISE / max(len(counted), 1)
        found = [t for t in counted if t.p_value < limit]
        order = ["quantisation", COLOUR, "axis_noise", "heavy_tails", LEVEL]
        return min(found, key=lambda t: order.index(t.name), default=None)

    def judge_noise(self, worst: NoiseTest) -> tuple[str, str]:
        """Verdict for a finding about the noise, when no effect was significant."""
        if worst.name != LEVEL or worst.estimate[0] < 1:
            return "noise_model", worst.remark
        # Larger residuals may be an effect that the sigma-free tests could not see.
        level, best, name = known_level_evidence(
            {name: [h.basis for h in shapes] for name, shapes in self.setting.candidates.items()},
            self.z,
        )
        probability = 1 / (1 + np.exp(best - level))
        if probability >= SURE:
            return "noise_model", worst.remark
        return "unknown", (
            f"{worst.remark}; it may be the noise (probability {probability:.2f}), but an effect "
            f"such as {name} is not excluded"
        )

    def unit_variance(self, final: Setting) -> float:
        """Variance of unit weight: 1 if sigma is known and not refuted, else a posteriori."""
        z = final.frame.residuals.z
        posteriori = float(z @ z) / len(z)
        if self.sigma_known and noises.level_test(z).p_value >= LEVEL_NOISE:
            return 1.0
        return posteriori

    def sigma_source(self, final: Setting) -> str:
        """Where the noise level comes from."""
        return "a-priori" if self.sigma_known and self.unit_variance(final) == 1 else "residuals"

    # --- what else is said ----------------------------------------------------------------------

    def location(self, variance: float) -> dict[str, float]:
        """Shares of the excess χ² above the given noise or, without it, the least that is left."""
        if self.sigma_known:
            variance = 1.0
        else:
            total, r = float(self.z @ self.z), len(self.z)
            left = [(1 - float(share(q, self.z))) / (r - q.shape[1]) for q in self.groups.values()]
            variance = min([variance, *(total * part for part in left)])
        outliers = list(self.setting.candidates.get(OUTLIER, ()))
        return locate(self.groups, outliers, self.z, self.null, variance)

    def described(
        self,
        verdict: str,
        chosen: Sequence[tuple[Hypothesis, tuple[str, ...], float]],
        final: Setting,
        tests: Sequence[NoiseTest],
    ) -> tuple[Named, ...]:
        """Describe what was found."""
        if verdict == "noise_model":
            worst = self.worst_noise(tests)
            name = COLOUR if worst is None else worst.name
            p = self.screening.smallest if worst is None else worst.p_value
            return (Named(name, name, (name,), p, self.probabilities.get(name, 1.0)),)
        solution = final.frame.solution
        sigma = np.sqrt(np.diag(solution.cofactors) * self.unit_variance(final))
        columns = {name: i for i, name in enumerate(solution.model.parameter_names)}
        found = []
        for hypothesis, members, sure in chosen:
            p = self.screening.p_family[hypothesis.name]
            if hypothesis.effect is None:
                label = int(self.campaign.positions[position_of(hypothesis)])
                found.append(Named(OUTLIER, OUTLIER, (OUTLIER,), p, sure, position=label))
                continue
            parameters = tuple(
                (
                    q.name,
                    float(solution.parameters[columns[q.name]]),
                    float(sigma[columns[q.name]]),
                    q.unit,
                )
                for q in hypothesis.effect.parameters
            )
            found.append(
                Named(
                    name=hypothesis.name,
                    spec=hypothesis.spec,
                    equivalence_class=members,
                    p_value=p,
                    posterior=sure,
                    rivals=self.rivals(hypothesis, members),
                    parameters=parameters,
                )
            )
        return tuple(found)

    def gap(
        self,
        verdict: str,
        chosen: Sequence[tuple[Hypothesis, tuple[str, ...], float]],
        final: Setting,
        variance: float,
    ) -> Gap:
        """Compare the models on positions that were used neither for choosing nor for fitting."""
        before = self.first.omega / self.first.redundancy
        if verdict != "named":
            return Gap(before)
        after = final.frame.solution.omega / final.frame.solution.redundancy
        leveling = leveling_rms(self.first, final.frame.solution, self.setting.frame.hold, variance)
        held_out, reason = self.held_out(chosen, variance if self.sigma_known else None)
        confirmed = held_out is not None and held_out.significant and not reason
        return Gap(before, after, held_out, leveling, confirmed, reason)

    def next_positions(
        self, verdict: str, chosen: Sequence[tuple[Hypothesis, tuple[str, ...], float]]
    ) -> tuple[NextPosition, ...]:
        """Positions that tell the two most probable explanations apart, if both are near."""
        if verdict not in ("named", "unknown") or len(chosen) > 1:
            return ()
        effects = [best for best, _ in self.classes if best.effect is not None]
        first = chosen[0][0] if chosen else next(iter(effects), None)
        if first is None:
            return ()
        near = {name for name, _ in self.rivals(first, ())}
        # Rivals in the order of their evidence; what means the same cannot be told apart.
        second = next(
            (h for h in effects if h.name in near and h.name not in self.members(first)), None
        )
        return () if second is None else tuple(next_positions(self.setting.frame, (first, second)))

    def held_out(
        self, chosen: Sequence[tuple[Hypothesis, tuple[str, ...], float]], variance: float | None
    ) -> tuple[gaps.HeldOutGap | None, str]:
        """Choose and fit on a part of the positions, and predict the rest."""
        n, c = self.campaign.n_positions, self.approach.n_conditions
        u = self.solution.design.shape[1]
        k = sum(h.dim for h, _, _ in chosen)
        count = round(n * gaps.HELD_OUT)
        needed = int(np.ceil((u + k + 3) / c))
        if n - count < needed:
            count = n - needed
        if count < 3:
            return None, (
                f"no held-out positions: choosing and fitting needs {needed} positions and at "
                f"least 3 are to be predicted, {needed + 3} in all; there are {n}"
            )
        rng = self.rng(1)
        fitted, held = gaps.split_positions(
            self.setting.frame.forces, self.setting.frame.hold, count, rng
        )
        observed = self.first.observed
        try:
            part = setting_of(solve(self.model, self.approach, observed.take(fitted)))
        except (InputError, np.linalg.LinAlgError):
            return None, "the fitted positions do not determine the model"
        run = _Part(part)
        specs, names = [], []
        for hypothesis, members, _ in chosen:
            best = run.best(members if hypothesis.effect is not None else (OUTLIER,))
            if best is None:
                return None, f"the fitted positions alone cannot show {hypothesis.name}"
            specs.append(best.spec)
            names.append(members)
        base = tuple(effect.spec for effect in self.model.effects)
        result = gaps.held_out_gap(
            self.model,
            compose("held-out", (*base, *specs)),
            self.approach,
            observed,
            fitted,
            held,
            variance,
            self.rng(2),
        )
        if result is None:
            return None, "the fit to the fitted positions alone has no solution"
        if not run.chooses(names):
            return result, "the fitted positions alone would have chosen another effect"
        return result, ""


@dataclass(frozen=True)
class _Part:
    """What a part of the positions would choose."""

    setting: Setting

    def best(self, names: Sequence[str]) -> Hypothesis | None:
        """Best shape of an effect of a class."""
        z = self.setting.frame.residuals.z
        shapes = [h for name in names for h in self.setting.candidates.get(name, ())]
        return max(shapes, key=lambda h: float(share(h.basis, z)), default=None)

    def chooses(self, names: Sequence[Sequence[str]]) -> bool:
        """Whether the same effects have the strongest evidence in this part."""
        z = self.setting.frame.residuals.z
        wanted = {name for members in names for name in members}
        if len(names) == 1:
            evidence = {
                name: mean_evidence(shapes_evidence([h.basis for h in shapes], z))
                for name, shapes in self.setting.candidates.items()
            }
            return max(evidence, key=lambda name: evidence[name]) in wanted
        pairs = best_pairs(self.setting.all, z)
        return bool(pairs) and set(pairs[0].names) <= wanted


def position_of(hypothesis: Hypothesis) -> int:
    """Index of the position that a hypothesis of a bumped position is about."""
    return int(hypothesis.spec[len(OUTLIER) + 1 : -1])
