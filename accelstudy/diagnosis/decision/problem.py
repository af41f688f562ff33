"""What a diagnosis has to explain: the fit of the base model, and all that it may lack."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, least_sigma
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.evidence.candidates import UNKNOWN, Field
from accelstudy.diagnosis.evidence.noise_models import UnequalAxes
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.examined import ExaminedFit, examine
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.diagnosis.space.hypotheses import LackOfFit, lack_of_fit
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.diagnosis.space.shapes import LearnedShapes
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

ROUNDING = 1e-10
"""Residuals below this share of gravity are rounding errors, and no measurement."""


@dataclass(frozen=True)
class BaseFit:
    """The fit of a model to a campaign, with equal axes, and what is known of its noise.

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
        return float(np.mean(np.asarray(self.solution.observed.sigma_force)))

    @property
    def sigma_posteriori(self) -> float:
        """Sigma of the forces by the residuals, m/s²."""
        return self.sigma * float(np.sqrt(self.solution.omega / self.solution.redundancy))


def fit_base(campaign: Campaign, model: SensorModel, approach: Approach) -> BaseFit:
    """Fit a model to a campaign; where no sigma is given, weights take that of the residuals.

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy to test anything.
    """
    stated, measured = campaign.sigma_force is not None, campaign
    # Without a sigma the weights of forces and angles need one: that of the residuals.
    for _ in range(1 if stated else 3):
        fit = fit_campaign(measured, model, approach, diagnosing=True)
        if fit.adjustment.redundancy <= 0:
            raise InputError(
                f"{campaign.name}: {campaign.n_positions} positions leave no redundancy beside "
                f"the {model.n_parameters} parameters of {model.name!r}: nothing can "
                "be tested; more positions are needed"
            )
        if not stated:
            least = max(1e-9, least_sigma(campaign, approach))
            sigma = max(fit.sigma_position, least)
            measured = replace(measured, sigma_force=sigma)
    solution = solve(fit.model, fit.approach, fit.observed, fit.adjustment)
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
    observed = replace(fit.observed, sigma_force=float(np.sqrt(np.mean(within))))
    return BaseFit(solve(fit.model, fit.approach, observed), Level.of_holds(), within)


@dataclass(frozen=True)
class Problem:
    """A fit and all that its model may lack.

    Attributes
    ----------
    base : BaseFit, with equal axes
    examined : ExaminedFit, the same with unequal axes weighted, and the hypotheses about it
    """

    base: BaseFit
    examined: ExaminedFit

    @property
    def frame(self) -> SessionFit:
        """Session of the fit."""
        return self.examined.frame

    @property
    def residuals(self) -> Residuals:
        """Residuals of the fit."""
        return self.examined.frame.residuals

    @cached_property
    def evidence(self) -> Evidence:
        """Evidence by which all that may be missing is weighed."""
        return Evidence(self.base.level, self.residuals.redundancy)

    @cached_property
    def attitude(self) -> LackOfFit | None:
        """All that repeated positions have in common; None if the noise does not show by itself."""
        return lack_of_fit(self.residuals, self.frame.forces)

    @cached_property
    def unknown(self) -> LearnedShapes | None:
        """Something without a name; None where nothing but the candidates shows."""
        shapes = LearnedShapes.of(self.frame, self.attitude) if self.examined.candidates else None
        return shapes if shapes is not None and shapes.places else None

    @property
    def prior_unknown(self) -> float:
        """Prior weight of something without a name."""
        slow = self.frame.absent and self.unknown is not None and self.unknown.is_slow.any()
        return RULES.prior_unknown + (RULES.prior_unrecorded if slow else 0.0)

    @cached_property
    def named_field(self) -> Field:
        """All candidates that have names."""
        return Field(self.examined.candidates)

    @cached_property
    def field(self) -> Field:
        """All candidates."""
        unknown = {} if self.unknown is None else {UNKNOWN: self.unknown}
        return Field({**self.examined.candidates, **unknown})

    @cached_property
    def axes(self) -> UnequalAxes:
        """Unequal axes of the base fit, and the evidence for them."""
        residuals = Residuals.of(self.base.solution)
        evidence = Evidence(self.base.level, residuals.redundancy)
        return UnequalAxes.of(residuals, evidence, self.base.within)

    @property
    def unequal_axes(self) -> float:
        """Log odds that nothing is wrong but the noise of the axes, against nothing."""
        return float(np.log(RULES.prior_axes) + self.axes.log_evidence)

    def best_odds(self, field: Field) -> float:
        """Log odds of the most probable single thing that is missing against nothing, or 0."""
        if not field.names:
            return 0.0
        prior = np.full(len(field.names), 1 / len(field.named_shapes))
        if UNKNOWN in field.names:
            prior[-1] = self.prior_unknown
        odds = field.odds(self.evidence, field.project(self.residuals.z)) + np.log(prior)
        return max(0.0, float(np.max(odds)))


def pose(base: BaseFit) -> Problem:
    """Return the problem that a fit poses: its residuals, and all that its model may lack.

    The axes are weighted by their noise where unequal axes explain the residuals better than equal
    ones do, with nothing missing, with any single effect, or with something unknown.
    """
    first = base.solution
    problem = Problem(base, examine(first))
    if is_exact(first):
        return problem
    noisier = problem.unequal_axes
    beats_named = noisier > problem.best_odds(problem.named_field)
    # Something unknown is asked last, as it takes longest.
    if beats_named and noisier > problem.best_odds(problem.field):
        sigma = np.sqrt(problem.axes.ratios)
        mean = np.mean(np.sqrt(first.variances[:, :3]))
        shaped = np.broadcast_to(mean * sigma / np.mean(sigma), (len(first.variances), 3))
        observed = replace(first.observed, sigma_force=shaped)
        # With other weights a sensor that clips may have no solution.
        with suppress(InputError):
            return Problem(base, examine(solve(first.model, first.approach, observed)))
    return problem


def is_exact(fit: Solution) -> bool:
    """Whether a campaign is its own model, so that only rounding errors are left."""
    return float(np.sqrt(np.mean(fit.misclosures**2))) < ROUNDING * fit.gravity
