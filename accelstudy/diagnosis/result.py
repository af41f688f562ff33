"""What a diagnosis found: the results that files, figures and pages are made of."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import NoiseJudgement, Solution
from accelstudy.basics.progress import stage
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.gross_errors.recognition import Recognition
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.functions import LearnedShape, shape_of, shares_of_places
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.decision.refits import with_settings
from accelstudy.diagnosis.decision.statement import Finding, Reason
from accelstudy.diagnosis.decision.verdict import p_coloured, reason_of_unrecorded
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise import LEVEL, NoiseTest, worst_of
from accelstudy.diagnosis.file_format import (
    Estimate,
    Fit,
    FoundEffect,
    LikelyPlace,
    NextPosition,
    UpperLimit,
)
from accelstudy.diagnosis.held_out import Confirmation, relative_variance
from accelstudy.diagnosis.next_positions import Separation, next_positions, separated
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import OUTLIER, Hypothesis
from accelstudy.diagnosis.visibility import upper_limits
from accelstudy.effects.learned import LEARNED
from accelstudy.leveling.error import attitudes_in_use, tilt_error
from accelstudy.sensors.plausibility import implausible_parameters
from accelstudy.sensors.sensor import SensorModel

MISSING = ("named", "narrowed", "learned", "unknown")
"""Verdicts by which the model lacks something."""


class TiltErrors(NamedTuple):
    """Rms of roll and pitch that calibrations leave, rad.

    Attributes
    ----------
    promised : float, by the base model, as a simulation with it finds
    before, after : float, by the base model and by the extended one if the extended one is right
    """

    promised: float
    before: float
    after: float


@dataclass(frozen=True)
class CampaignDiagnosis:
    """A diagnosis of a campaign: what was found, and how sure that is; consequences on demand.

    Attributes
    ----------
    problem : Problem, the fit of the base model, all that it may lack, and the evidence
    campaign : Campaign, with a recognised gross error mended
    finding : Finding
    confirmation : Confirmation, what held-out positions confirm of it
    recognised : Recognition or None, a gross error of unit, axes or order
    """

    problem: Problem
    campaign: Campaign
    finding: Finding
    confirmation: Confirmation
    recognised: Recognition | None = None

    @property
    def base(self) -> Solution:
        """Fit of the base model."""
        return self.problem.base.solution

    @property
    def frame(self) -> SessionFit:
        """Session of the base fit."""
        return self.problem.frame

    @property
    def final(self) -> SessionFit:
        """Session of the fit with what was found, or of the base fit."""
        return self.finding.frame

    @property
    def model(self) -> SensorModel:
        """Model that was diagnosed, without what was found."""
        return self.base.model

    @property
    def extended_model(self) -> SensorModel:
        """Model with the effects that were found; the model itself if there are none."""
        return self.final.solution.model

    @cached_property
    def base_fit(self) -> CampaignFit:
        """The calibration with the base model."""
        return CampaignFit(self.campaign, self.base)

    @cached_property
    def final_fit(self) -> CampaignFit:
        """The calibration with what was found, without positions that were found to be outliers."""
        outliers = self.campaign.positions[~self.used_positions].tolist()
        reasons = dict.fromkeys(outliers, "an outlier, as the diagnosis found")
        return CampaignFit(self.campaign.without(reasons), self.final.solution)

    # --- the verdict --------------------------------------------------------------------------

    @cached_property
    def verdict(self) -> str:
        """One of no_effect, named, narrowed, learned, unknown, noise_model and gross_error."""
        return self.finding.verdict if self.recognised is None else "gross_error"

    @cached_property
    def reason(self) -> Reason:
        """Reason of the verdict."""
        if self.recognised is not None:
            return Reason.of("recognised", reason=self.recognised.reason)
        return reason_of_unrecorded(self.problem, self.finding) or self.finding.reason

    @cached_property
    def p_coloured(self) -> float:
        """Probability of coloured noise that may be an effect of an absent column."""
        return p_coloured(self.problem, self.finding)

    @cached_property
    def credible_set(self) -> tuple[Explanation, ...]:
        """Explanations of what is missing, most probable first; empty if nothing is."""
        return self.finding.posterior.credible_set

    @cached_property
    def found(self) -> tuple[FoundEffect, ...]:
        """All that was found; of the unknown, what is certain all the same."""
        gross = () if self.recognised is None else self.recognised.names
        named = [FoundEffect.of_name(name, at=at) for name, at in gross]
        if self.finding.verdict == "noise_model":
            return (*named, self._noise())
        return (*named, *self._chosen_causes())

    @property
    def effects(self) -> tuple[FoundEffect, ...]:
        """What the verdict names; nothing if that is unknown."""
        return () if self.verdict == "unknown" else self.found

    @cached_property
    def used_positions(self) -> NDArray[np.bool_]:
        """Which positions, (n,), the final fit uses: all but outliers that were found."""
        outliers = [named.position for named in self.found if named.position is not None]
        return ~np.isin(self.campaign.positions, outliers)

    def _noise(self) -> FoundEffect:
        """What is wrong with the noise."""
        worst, posterior = worst_of(self.noise_tests), self.finding.posterior
        name = next(one.names[0] for one in posterior.reported if one.is_noise)
        # Of larger residuals the level says least; what they are, the evidence says.
        if worst is not None and not (worst.name == LEVEL and posterior.p_noise >= RULES.sure):
            name = worst.name
        return FoundEffect.of_name(name, posterior.p_noise)

    def _chosen_causes(self) -> Iterator[FoundEffect]:
        """What was chosen, with its estimates."""
        solution, chosen = self.final.solution, self.finding.chosen
        cofactors = with_settings(self.frame, solution, [one.shape for one in chosen])
        sigma = np.sqrt(np.diag(cofactors) * self.noise.variance).tolist()
        each = zip(solution.parameters.tolist(), sigma, strict=False)
        values = dict(zip(solution.model.parameter_names, each, strict=False))
        of_logs = iter(sigma[len(solution.parameters) :])
        for cause in chosen:
            best, members = cause.shape, cause.members
            if best.outlier is not None:
                at = int(self.campaign.positions[best.outlier])
                yield FoundEffect.of_name(OUTLIER, cause.posterior, at)
                continue
            # What is beside a large effect was found in what its refit leaves.
            (here,) = (None,) if best.name == LEARNED else self.frame.hypotheses((best.effect,))
            like = () if here is None else self.frame.imitators(here)
            searched = [s for s in best.effect.takes if s.name == best.smooth]
            yield FoundEffect(
                name=best.name,
                spec=best.effect.spec,
                position=None,
                equivalence_class=members,
                posterior=cause.posterior,
                parameters=[
                    Estimate.of(q, *values[q.name]) for q in best.distinguishable.parameters
                ],
                settings=[Estimate.of(s, best.value, best.value * next(of_logs)) for s in searched],
                imitators=[other for other in like if other not in members],
            )

    @cached_property
    def probabilities(self) -> dict[str, float]:
        """Posterior of each name, alone or with others; a class stands under its first name.

        There is none where nothing is missing.
        """
        posterior, first = self.finding.posterior, dict[tuple[str, ...], str]()
        total: dict[str, float] = defaultdict(float)
        for one in posterior.all:
            # Two outlier positions have one name.
            names = {first.setdefault(cause.members, cause.name): None for cause in one.causes}
            for name in names:
                total[name] += one.posterior
        return dict(sorted(total.items(), key=lambda item: -item[1]))

    # --- the noise ----------------------------------------------------------------------------

    @property
    def sigma_known(self) -> bool:
        """Whether the campaign states its noise."""
        return self.problem.evidence.level.known

    @property
    def noise(self) -> NoiseJudgement:
        """Whether the residuals of the final fit bear sigma, and the variance that is quoted."""
        return self.final.solution.judge_noise(self.sigma_known)

    @cached_property
    def noise_tests(self) -> tuple[NoiseTest, ...]:
        """Tests of the noise on the residuals of the final fit."""
        return self.problem.at(self.final).noise_tests(self.campaign)

    @property
    def variances(self) -> dict[str, float]:
        """Variances of unit weight of the base fit and of the extended one, if effects were added.

        Both are in units of the noise that the base fit takes.
        """
        base, final = self.base, self.final.solution
        variances = {"base": base.variance_posteriori}
        if self.finding.chosen:
            variances["extended"] = final.variance_posteriori * relative_variance(final, base)
        return variances

    @property
    def noise_variance(self) -> float:
        """Variance of the noise by that of the base fit: 1 if stated, else that of the last fit."""
        return 1.0 if self.sigma_known else [*self.variances.values()][-1]

    @property
    def fits(self) -> list[Fit]:
        """The variances of unit weight beside those that simulated sessions have."""
        sizes = []
        for model, variance in self.variances.items():
            fit = self.base if model == "base" else self.final.solution
            dof = min(fit.sigma_dof, 1e9)
            r, measured = fit.redundancy, variance / self.noise_variance
            usual = special.fdtri(r, dof, [0.025, 0.975]).tolist()
            sizes.append(Fit(model=model, redundancy=r, simulated=usual, measured=measured))
        return sizes

    # --- what follows -------------------------------------------------------------------------

    @cached_property
    def shape(self) -> LearnedShape | None:
        """The function that was learned."""
        learned = self.verdict == LEARNED
        return shape_of(self.finding, self.noise.variance) if learned else None

    @cached_property
    def like(self) -> tuple[LikelyPlace, ...]:
        """Possible places of what is missing, most probable first; empty if nothing is missing.

        The places are those of all that is missing or, where the most probable explanation with
        something unknown has effects with names, of what is beside these.
        """
        finding = self.finding
        if finding.verdict not in MISSING:
            return ()
        explanations = self.credible_set if finding.verdict in ("unknown", LEARNED) else ()
        names = next((one.names for one in explanations if UNKNOWN in one.names), (UNKNOWN,))
        like = [
            LikelyPlace(coordinate=coordinate, target=target, posterior=p)
            for (coordinate, target), p in shares_of_places(self.problem, names).items()
        ]
        return tuple(sorted(like, key=lambda one: -one.posterior))

    @cached_property
    def leveling(self) -> TiltErrors | None:
        """Tilt errors without and with what was found.

        None if there is nothing to compare, or if readings of the extended sensor, which clips,
        have no tilt. They are taken over all tilts up to 50 gon and over the temperatures, times
        and changes of position of the campaign. The noise of the leveled reading is not included,
        nor are effects of the rig, which is absent when the sensor is used.
        """
        if not self.finding.chosen:
            return None
        base, extended = self.base, self.final.solution
        f_b, used = attitudes_in_use(self.frame.hold, extended.gravity)

        def rms(right: Solution, fit: Solution) -> float:
            truth, u = right.parameters[: right.model.n_parameters], fit.model.n_parameters
            own, g = fit.parameters[:u], extended.gravity
            error = tilt_error(right.model, truth, fit.model, own, f_b, g, used)
            ratio = self.noise.variance * relative_variance(extended, fit)
            return float(np.sqrt(np.mean(error.rms_of_all(ratio * fit.cofactors[:u, :u]) ** 2)))

        errors = TiltErrors(rms(base, base), rms(extended, base), rms(extended, extended))
        return errors if np.isfinite(errors).all() else None

    @property
    def better_for_leveling(self) -> str | None:
        """Model that leaves the smaller tilt error, "base" or "extended"; None if there is one."""
        if self.leveling is None or self.extended_model is self.model:
            return None
        worse = self.leveling.after > RULES.larger_tilt * self.leveling.before
        return "base" if worse else "extended"

    @cached_property
    def upper_limits(self) -> tuple[UpperLimit, ...]:
        """Limits of the effects that were neither found nor left open."""
        finding = self.finding
        names = [cause.name for cause in finding.chosen]
        if finding.verdict == "narrowed":
            classes = [alike for one in self.credible_set for alike in one.classes]
            names += [name for alike in classes for name in alike]
        return tuple(upper_limits(self.final, self.noise.trusted, names))

    @property
    def _rivals(self) -> tuple[tuple[Hypothesis, ...], ...]:
        """Shapes of the two most probable explanations, where further positions can decide."""
        if self.finding.verdict not in ("named", "narrowed", "unknown"):
            return ()
        rivals = [one.best for one in self.credible_set if one.is_effects]
        return tuple(rivals[:2]) if len(rivals) > 1 else ()

    @cached_property
    def next_positions(self) -> tuple[NextPosition, ...]:
        """Positions that tell the two most probable explanations apart."""
        if not self._rivals:
            return ()
        with stage("next positions"):
            return tuple(next_positions(self.frame, *self._rivals))

    @property
    def separated(self) -> Separation:
        """Names that only the one, and that only the other of these explanations has."""
        return separated(*self._rivals)

    @cached_property
    def suspects(self) -> dict[int, float]:
        """Positions that a calibration with the base model marks, and the p-value of each."""
        return {} if self.problem.exact else self.base_fit.suspects

    @cached_property
    def implausible(self) -> list[str]:
        """Parameters of the final fit that no sensor has."""
        fit = self.final_fit
        return implausible_parameters(fit.model.effects, fit.parameters, fit.sigma)
