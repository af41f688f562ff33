"""What a diagnosis has to explain: the fit of the base model, and all that may be missing from it.

Each piece of the evidence is weighed when it is asked for, and then kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, column_basis, solve
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, least_sigma
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.posterior import NOT_LISTED, Explanation, Posterior
from accelstudy.diagnosis.decision.refits import best_refit
from accelstudy.diagnosis.evidence.candidates import (
    Cause,
    Field,
    Singles,
    classes_of,
    equivalents,
    unknown_beside,
    weigh_singles,
)
from accelstudy.diagnosis.evidence.detection import Chance, Detection, detect
from accelstudy.diagnosis.evidence.noise_models import coloured_density, unequal_axes_density
from accelstudy.diagnosis.evidence.noise_tests import (
    AXES,
    COLOUR,
    LEVEL,
    TAILS,
    most_evidence,
    tail_test,
)
from accelstudy.diagnosis.evidence.sets import set_prior, weigh_sets
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import Spaces, cosines, repeats_of
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import LearnedShapes
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

ROUNDING = 1e-10
"""Residuals below this share of gravity are rounding errors, and no measurement."""
MAX_POSITIONS = 1000
"""Positions of a campaign, whose residuals are compared pair by pair."""


# --- the fit ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class BaseFit:
    """The fit of a model to a campaign, and what is known of its noise.

    Attributes
    ----------
    solution : Solution
    level : Level, what is known of sigma
    within : (3,) array, variances of position means if white noise within the holds is all there
        is; None if unknown
    """

    solution: Solution
    level: Level
    within: Array | None

    @property
    def sigma(self) -> float:
        """Sigma of the forces that the fit took, m/s²."""
        return self.solution.sigma_force

    @property
    def sigma_posteriori(self) -> float:
        """Sigma of the forces by the residuals, m/s²."""
        return self.sigma * float(np.sqrt(self.solution.variance_posteriori))


def fit_base(campaign: Campaign, model: SensorModel, approach: Approach) -> BaseFit:
    """Fit a model to a campaign; where no sigma is given, weights take that of the residuals.

    Raises
    ------
    InputError
        If the positions do not determine the model, leave no redundancy to test anything, or are
        too many.
    """
    if campaign.n_positions > MAX_POSITIONS:
        raise InputError(
            f"{campaign.name}: a diagnosis compares at most {MAX_POSITIONS} positions, and there "
            f"are {campaign.n_positions}; give a part of them, or the means of repeated ones"
        )
    stated, measured = campaign.sigma_force is not None, campaign
    # Without a sigma the weights of forces and angles need one: that of the residuals.
    for _ in range(1 if stated else 3):
        fit = fit_campaign(measured, model, approach)
        if fit.solution.redundancy <= 0:
            raise InputError(
                f"{campaign.name}: {campaign.n_positions} positions leave no redundancy beside "
                f"the {model.n_parameters} parameters of {model.name!r}: nothing can "
                "be tested; more positions are needed"
            )
        if not stated:
            least = max(1e-9, least_sigma(campaign, approach))
            sigma = max(fit.sigma_position, least)
            measured = measured.with_sigma(sigma)
    solution = fit.solution
    sd, n, within = campaign.sd, campaign.n_samples, None
    if sd is not None and n is not None and np.all(sd > 0):
        within = np.asarray(np.mean(sd**2 / n[:, None], axis=0))
    if stated:
        return BaseFit(solution, Level.of_stated_sigma(solution.sigma_dof), within)
    if within is None or np.mean(within) <= least_sigma(campaign, approach) ** 2:
        return BaseFit(solution, Level.of_nothing_stated(), within)
    most, ratio = RULES.beyond_white, fit.sigma_position_posteriori**2 / np.mean(within)
    if not 1 / most < ratio < most:
        return BaseFit(solution, Level.of_nothing_stated(), within)
    observed = replace(solution.observed, sigma_force=float(np.sqrt(np.mean(within))))
    return BaseFit(solve(fit.model, fit.approach, observed), Level.of_holds(), within)


# --- all that may be missing --------------------------------------------------------------------


@dataclass(frozen=True)
class Problem:
    """A fit, all that its model may lack or that may be wrong with its noise, and the evidence.

    Attributes
    ----------
    base : BaseFit
    frame : SessionFit, of the same
    seed : SeedSequence, of the simulated noise
    """

    base: BaseFit
    frame: SessionFit
    seed: np.random.SeedSequence

    @property
    def residuals(self) -> Residuals:
        """Residuals of the fit."""
        return self.frame.residuals

    @property
    def exact(self) -> bool:
        """Whether the campaign is its own model, so that only rounding errors are left."""
        fit = self.base.solution
        return float(np.sqrt(np.mean(fit.misclosures**2))) < ROUNDING * fit.gravity

    @cached_property
    def evidence(self) -> Evidence:
        """Evidence by which all that may be missing is weighed."""
        return Evidence(self.base.level, self.residuals.redundancy)

    @cached_property
    def attitude(self) -> Spaces | None:
        """All that repeated positions have in common; None if the noise does not show by itself."""
        return repeats_of(self.residuals, self.frame.forces)

    @cached_property
    def unknown(self) -> LearnedShapes | None:
        """Something without a name; None where nothing but the candidates shows."""
        shapes = LearnedShapes.of(self.frame, self.attitude) if self.frame.candidates else None
        return shapes if shapes is not None and shapes.places else None

    @property
    def prior_unknown(self) -> float:
        """Prior weight of something without a name."""
        slow = self.frame.absent and self.unknown is not None and self.unknown.is_slow.any()
        return RULES.prior_unknown + (RULES.prior_unrecorded if slow else 0.0)

    @cached_property
    def field(self) -> Field:
        """All candidates."""
        return Field(self.frame.candidates, self.unknown)

    # --- effects ----------------------------------------------------------------------------

    @cached_property
    def singles(self) -> Singles:
        """Evidence for each candidate by itself."""
        return weigh_singles(self.frame, self.evidence)

    @cached_property
    def members(self) -> Mapping[str, tuple[str, ...]]:
        """Names that mean the same as each candidate."""
        return equivalents(self.frame, self.singles)

    @cached_property
    def classes(self) -> list[Cause]:
        """Candidates with those that mean the same, strongest evidence first."""
        return classes_of(self.singles, self.members)

    @cached_property
    def alone(self) -> list[Explanation]:
        """Explanations by one effect, one outlying position, or something unknown."""
        each, unknown = -np.log(max(len(self.classes), 1)), self.unknown
        densities = self.singles.densities
        alone = [Explanation((one,), densities[one.name] + each) for one in self.classes]
        if unknown is not None:
            z = self.residuals.z
            density = unknown.log_density(self.evidence, unknown.parts(z), z @ z)
            alone.append(Explanation((NOT_LISTED,), float(density + np.log(self.prior_unknown))))
        return alone

    @cached_property
    def sets(self) -> list[Explanation]:
        """Explanations by two or three effects or outlying positions."""
        k, weighed = len(self.classes), list[Explanation]()
        if k < 2:
            return weighed
        sets = weigh_sets(self.singles.shapes, self.residuals, self.evidence)
        logs = [one.log_density + set_prior(len(one.best), k) for one in sets]
        least = max(logs, default=0.0) - RULES.negligible
        called = {name: one.name for one in self.classes for name in one.members}
        strength = self.singles.densities
        for one, log in zip(sets, logs, strict=True):
            if log < least:
                continue
            best = sorted(one.best, key=lambda h: -strength[h.name])
            effects = [self.members[h.name] for h in best if h.place is None]
            if len(set(effects)) == len(effects):
                named = (Cause(called.get(h.name, h.name), self.members[h.name], h) for h in best)
                weighed.append(Explanation(tuple(named), log))
        return weighed

    @cached_property
    def with_unknown(self) -> list[Explanation]:
        """Explanations by something unknown beside the strongest effects and pairs of effects."""
        weighed = list[Explanation]()
        if len(self.classes) < 2 or self.unknown is None:
            return weighed
        singles = [one for one in self.alone if one.best]
        least = max(one.log_weight for one in (*self.alone, *self.sets)) - RULES.sets_within
        pairs = [one for one in self.sets if len(one.best) == 2 and one.log_weight > least]
        pairs.sort(key=lambda one: -one.log_weight)
        prior = float(np.log(RULES.prior_two * self.prior_unknown))
        for one in (*singles[: RULES.unknown_beside], *pairs[: RULES.unknown_beside]):
            basis = column_basis(np.concatenate([h.basis for h in one.best], axis=1))
            log = unknown_beside(basis, self.unknown, self.residuals, self.evidence)
            if log is not None:
                weighed.append(Explanation((*one.causes, NOT_LISTED), one.log_weight + log + prior))
        return weighed

    def refit(self, chosen: Sequence[Cause]) -> tuple[tuple[Cause, ...], Solution] | None:
        """Fit with those that mean the same as causes and fit best; None without a solution."""
        return best_refit(self.frame, self.singles, chosen)

    def cosine(self, name: str, other: str) -> float:
        """Canonical cosine of the best shapes of two candidates; 0 of what is no candidate."""
        one, two = (self.singles.best.get(each) for each in (name, other))
        return 0.0 if one is None or two is None else float(cosines(one.ideal, two.ideal)[0])

    # --- noise ------------------------------------------------------------------------------

    @cached_property
    def chance(self) -> Chance:
        """Residuals without any effect."""
        return Chance(self.seed, len(self.base.solution.design))

    @cached_property
    def noises(self) -> list[Explanation]:
        """Explanations by wrong noise alone, one of each kind."""
        by_level = self.detection.noise
        nothing = float(np.logaddexp.reduce(by_level))
        axes, colour = self.noise_evidence
        tails = most_evidence(tail_test(self.residuals, self.chance).p_value)
        logs = {
            COLOUR: nothing + np.log(RULES.prior_coloured) + colour,
            AXES: nothing + np.log(RULES.prior_axes) + axes,
            TAILS: nothing + np.log(RULES.prior_tails) + tails,
        }
        if len(by_level) > 1:
            # More noise than within the holds is an offset from hold to hold.
            name = LEVEL if self.evidence.level.known else COLOUR
            logs[name] = np.logaddexp(logs.get(name, -np.inf), by_level[1])
        return [Explanation((Cause(name, (name,)),), float(log)) for name, log in logs.items()]

    @cached_property
    def noise_evidence(self) -> tuple[float, float]:
        """Log evidence that the axes differ in noise, and that the noise is coloured."""
        residuals, evidence = self.residuals, self.evidence
        nothing = float(np.logaddexp.reduce(evidence.noise_density(residuals.z @ residuals.z)))
        axes = unequal_axes_density(residuals, evidence, self.base.within)
        return axes - nothing, coloured_density(residuals, evidence) - nothing

    def at(self, frame: SessionFit) -> Problem:
        """The problem that the residuals of another fit pose."""
        return self if frame is self.frame else replace(self, frame=frame)

    # --- whether, and what ------------------------------------------------------------------

    @cached_property
    def detection(self) -> Detection:
        """Whether anything is missing, all candidates together."""
        return detect(self.field, self.evidence, self.residuals, self.chance)

    @cached_property
    def posterior(self) -> Posterior:
        """Probabilities of everything that may be missing or wrong."""
        return Posterior.of([*self.alone, *self.sets, *self.with_unknown, *self.noises])


SEED = np.random.SeedSequence(1)


def pose(base: BaseFit, seed: np.random.SeedSequence = SEED) -> Problem:
    """Return the problem that a fit poses: its residuals, and all that its model may lack."""
    return Problem(base, SessionFit.of(base.solution), seed)
