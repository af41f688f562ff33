"""What a diagnosis has to explain: the fit of the base model, and all that may be missing from it.

Each piece of the evidence is computed on demand, and cached.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.campaign.calibration.fit import fit_campaign, least_sigma
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.posterior import NOT_LISTED, Explanation, Posterior
from accelstudy.diagnosis.decision.refits import Refit, best_refit
from accelstudy.diagnosis.evidence import noise
from accelstudy.diagnosis.evidence.candidates import Cause, Field, Singles, weigh_singles
from accelstudy.diagnosis.evidence.detection import Chance, detect
from accelstudy.diagnosis.evidence.noise import AXES, COLOUR, LEVEL, TAILS, NoiseTest
from accelstudy.diagnosis.evidence.sets import set_prior, weigh_sets
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import (
    Spaces,
    clusters,
    joint_basis,
    repeats_of,
    space_of_attitudes,
)
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import LearnedShapes
from accelstudy.sensors.sensor import SensorModel

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


def fit_base(campaign: Campaign, model: SensorModel, approach: Approach) -> BaseFit:
    """Fit a model to a campaign, and say what is known of its noise.

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
    fit = fit_campaign(campaign, model, approach)
    solution = fit.solution
    if solution.redundancy <= 0:
        raise InputError(
            f"{campaign.name}: {campaign.n_positions} positions leave no redundancy beside "
            f"the {model.n_parameters} parameters of {model.name!r}: nothing can "
            "be tested; more positions are needed"
        )
    sd, n, within = campaign.sd, campaign.n_samples, None
    if sd is not None and n is not None and np.all(sd > 0):
        within = np.asarray(np.mean(sd**2 / n[:, None], axis=0))
    if campaign.sigma_force is not None:
        return BaseFit(solution, Level.of_stated_sigma(solution.sigma_dof), within)
    if within is None or np.mean(within) <= least_sigma(campaign, approach) ** 2:
        return BaseFit(solution, Level.of_nothing_stated(), within)
    most, ratio = RULES.beyond_white, fit.sigma_position_posteriori**2 / np.mean(within)
    if not 1 / most < ratio < most:
        return BaseFit(solution, Level.of_nothing_stated(), within)
    observed = replace(solution.observed, sigma_force=float(np.sqrt(np.mean(within))))
    return BaseFit(solve(fit.model, fit.approach, observed), Level.of_holds(), within)


# --- all that may be missing --------------------------------------------------------------------


class Misfit(NamedTuple):
    """Ratio of the residuals of a fit to the noise."""

    ratio: float
    of_repeats: bool
    """Whether the noise is what repeated positions differ by, and not what is stated."""


@dataclass(frozen=True)
class Problem:
    """A fit, all that its model may lack or that may be wrong with its noise, and the evidence.

    Attributes
    ----------
    base : BaseFit
    frame : SessionFit, of the base fit; after `at`, of another fit to the same campaign
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
    def single_explanations(self) -> list[Explanation]:
        """Explanations by one effect, one outlying position, or something unknown."""
        classes, densities = self.singles.classes, self.singles.densities
        each = -np.log(max(len(classes), 1))
        explanations = [Explanation((one,), densities[one.name] + each) for one in classes]
        if self.unknown is not None:
            density = self.unknown.log_density(self.evidence, self.residuals.z)
            weight = float(density + np.log(self.prior_unknown))
            explanations.append(Explanation((NOT_LISTED,), weight))
        return explanations

    @cached_property
    def sets(self) -> list[Explanation]:
        """Explanations by two or three effects or outlying positions."""
        classes, members = self.singles.classes, self.singles.members
        if len(classes) < 2:
            return []
        sets, weighed = weigh_sets(self.singles.shapes, self.residuals, self.evidence), []
        logs = [log + set_prior(len(shapes), len(classes)) for shapes, log in sets]
        least = max(logs, default=0.0) - RULES.negligible
        called = {name: one.name for one in classes for name in one.members}
        strength = self.singles.densities
        for (shapes, _), log in zip(sets, logs, strict=True):
            best = sorted(shapes, key=lambda h: -strength[h.name]) if log >= least else []
            effects = [members[h.name] for h in best if h.outlier is None]
            if best and len(set(effects)) == len(effects):
                named = (Cause(called.get(h.name, h.name), members[h.name], h) for h in best)
                weighed.append(Explanation(tuple(named), log))
        return weighed

    @cached_property
    def with_unknown(self) -> list[Explanation]:
        """Explanations by something unknown beside the strongest effects and pairs of effects."""
        weighed = list[Explanation]()
        if len(self.singles.classes) < 2 or self.unknown is None:
            return weighed
        singles = [one for one in self.single_explanations if one.best]
        weights = [one.log_weight for one in (*self.single_explanations, *self.sets)]
        least = max(weights) - RULES.sets_within
        pairs = [one for one in self.sets if len(one.best) == 2 and one.log_weight > least]
        pairs.sort(key=lambda one: -one.log_weight)
        prior = float(np.log(RULES.prior_two * self.prior_unknown))
        for one in (*singles[: RULES.unknown_beside], *pairs[: RULES.unknown_beside]):
            basis = joint_basis(one.best, len(self.residuals.z))
            unknown, left = self.unknown.orthogonal_to(basis), self.residuals.orthogonal_to(basis)
            if unknown.places:
                evidence = Evidence(self.base.level, left.redundancy)
                nothing = np.logaddexp.reduce(evidence.noise_density(left.z @ left.z))
                log = float(unknown.log_density(evidence, left.z) - nothing)
                weighed.append(Explanation((*one.causes, NOT_LISTED), one.log_weight + log + prior))
        return weighed

    def refit(self, chosen: Sequence[Cause]) -> Refit | None:
        """Fit with those that mean the same as causes and fit best; None without a solution."""
        return best_refit(self.singles, chosen)

    # --- noise ------------------------------------------------------------------------------

    @cached_property
    def chance(self) -> Chance:
        """Residuals without any effect."""
        return Chance(self.seed, len(self.base.solution.design))

    @cached_property
    def noises(self) -> list[Explanation]:
        """Explanations by wrong noise alone, one of each kind."""
        by_level = self.noise_density
        nothing = float(np.logaddexp.reduce(by_level))
        axes, colour = self.noise_evidence
        tails = noise.most_evidence(noise.tail_test(self.residuals, self.chance).p_value)
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
    def noise_density(self) -> Array:
        """Log density of the residuals in noise alone, by the components of the level, (c,)."""
        return self.evidence.noise_density(self.residuals.z @ self.residuals.z)

    @cached_property
    def noise_evidence(self) -> tuple[float, float]:
        """Log evidence that the axes differ in noise, and that the noise is coloured."""
        residuals, evidence = self.residuals, self.evidence
        nothing = float(np.logaddexp.reduce(self.noise_density))
        axes = noise.unequal_axes_density(residuals, evidence, self.base.within)
        return axes - nothing, noise.coloured_density(residuals, evidence) - nothing

    def at(self, frame: SessionFit) -> Problem:
        """The problem that the residuals of another fit pose."""
        return self if frame is self.frame else replace(self, frame=frame)

    def noise_tests(self, campaign: Campaign) -> tuple[NoiseTest, ...]:
        """All tests of the noise that a campaign allows."""
        if self.exact:
            return ()
        residuals, fit, test = self.residuals, self.base.solution, self.frame.solution.global_test
        tests = [noise.level_test(test)] if self.base.level.known and test is not None else []
        axes, colour = self.noise_evidence
        tests += [
            noise.axis_test(residuals, axes),
            noise.colour_test(residuals, colour),
            noise.tail_test(residuals, self.chance),
            # With a sigma far too large, the attitudes would look like steps.
            noise.resolution_test(campaign.forces, min(fit.sigma_force, fit.sigma_posteriori)),
        ]
        if campaign.sd is not None and campaign.n_samples is not None:
            sigma = float(np.mean(residuals.sigmas[:, :3]))
            tests.append(noise.within_hold_test(residuals, sigma, campaign.sd, campaign.n_samples))
        return tuple(tests)

    def exceeds_stated(self, fit: Solution) -> bool:
        """Whether sigma is given, and the residuals of a fit are larger than it allows."""
        noise = fit.judge_noise(self.base.level.known)
        return self.base.level.known and not noise.trusted and noise.variance > 1

    @property
    def lack_of_fit(self) -> float:
        """p-value of the test whether repeats agree better with each other than with the model."""
        if self.attitude is None:
            return 1.0
        repeats = noise.square_of_repeats(self.residuals, self.attitude.vectors)
        return noise.lack_of_fit(self.residuals, *repeats)

    def misfit(self, solution: Solution) -> Misfit | None:
        """Return by how much the residuals of a fit exceed the noise; None if they do not.

        The noise is the given sigma. Where none is given, or where repeated positions refute it
        even after the refit, it is the difference of repeated positions.
        """
        stated, r, omega = self.base.level.known, solution.redundancy, solution.omega
        if stated and 2 * float(special.chdtrc(r, omega)) >= REFUTATION_LEVEL:
            return None
        ratio = float(np.sqrt(omega / r))
        than_stated = Misfit(ratio, of_repeats=False) if stated else None
        left, labels = Residuals.of(solution), clusters(self.frame.forces)
        if len(labels) != len(solution.misclosures) or len(np.unique(labels)) == len(labels):
            return than_stated
        square, freedom = noise.square_of_repeats(left, space_of_attitudes(left, labels))
        if not freedom or (stated and special.chdtrc(freedom, square) >= REFUTATION_LEVEL / 2):
            return than_stated
        if noise.lack_of_fit(left, square, freedom) >= REFUTATION_LEVEL:
            return None
        return than_stated or Misfit(ratio / float(np.sqrt(square / freedom)), of_repeats=True)

    # --- whether, and what ------------------------------------------------------------------

    @cached_property
    def p_value(self) -> float:
        """Probability of as much evidence that anything is missing by noise alone."""
        return detect(self.field, self.evidence, self.residuals, self.chance)

    @cached_property
    def posterior(self) -> Posterior:
        """Probabilities of everything that may be missing or wrong."""
        by_effects = [*self.single_explanations, *self.sets, *self.with_unknown]
        return Posterior.of([*by_effects, *self.noises])


SEED = np.random.SeedSequence(1)


def pose(base: BaseFit, seed: np.random.SeedSequence = SEED) -> Problem:
    """Return the problem that a fit poses: its residuals, and all that its model may lack."""
    return Problem(base, SessionFit.of(base.solution), seed)
