"""What a diagnosis has to explain: the fit of the base model, and all that it may lack."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, least_sigma
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.evidence.field import Field
from accelstudy.diagnosis.evidence.noise_models import UnequalAxes
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.examined import ExaminedFit, Frame, examine
from accelstudy.diagnosis.space.repeats import lack_of_fit
from accelstudy.diagnosis.space.residuals import Residuals
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
        return BaseFit(solution, Level.given(solution.sigma_dof), within)
    if within is None or np.mean(within) <= least_sigma(campaign, approach) ** 2:
        return BaseFit(solution, Level.unknown(), within)
    most, ratio = RULES.beyond_white, fit.sigma_position_posteriori**2 / np.mean(within)
    if not 1 / most < ratio < most:
        return BaseFit(solution, Level.unknown(), within)
    observed = replace(fit.observed, sigma_force=float(np.sqrt(np.mean(within))))
    return BaseFit(solve(fit.model, fit.approach, observed), Level.within_holds(), within)


@dataclass(frozen=True)
class Problem:
    """A fit and all that its model may lack, side by side.

    Attributes
    ----------
    base : BaseFit, with equal axes
    examined : ExaminedFit, the same with unequal axes weighted, and the hypotheses about it
    axes : UnequalAxes, how probable these are; None of an exact fit
    field : Field, all candidates
    evidence : Evidence, by which they are weighed
    """

    base: BaseFit
    examined: ExaminedFit
    axes: UnequalAxes | None
    field: Field
    evidence: Evidence

    @property
    def frame(self) -> Frame:
        """Session of the fit."""
        return self.examined.frame

    @property
    def residuals(self) -> Residuals:
        """Those of the fit."""
        return self.examined.frame.residuals

    @property
    def repeated(self) -> bool:
        """Whether attitudes were measured repeatedly, so that the noise shows by itself."""
        return self.field.attitude is not None


def pose(base: BaseFit) -> Problem:
    """Return the problem that a fit poses: its residuals, and all that its model may lack.

    The axes are weighted by their noise where unequal axes explain the residuals better than equal
    ones do, with nothing missing, with any single effect, or with something unknown.
    """
    first, examined, axes = base.solution, examine(base.solution), None
    field = _field(examined)
    if not is_exact(first):
        residuals = examined.frame.residuals
        evidence = Evidence(base.level, residuals.redundancy)
        axes = UnequalAxes.of(residuals, evidence, base.within)
        noisier = float(np.log(RULES.prior_axes) + axes.log_evidence)
        # Something unknown is asked last, as it takes longest.
        if noisier > _best_odds(field.named, evidence, residuals.z) and (
            noisier > _best_odds(field, evidence, residuals.z)
        ):
            sigma = np.sqrt(axes.ratios)
            mean = np.mean(np.sqrt(first.variances[:, :3]))
            shaped = np.broadcast_to(mean * sigma / np.mean(sigma), (len(first.variances), 3))
            observed = replace(first.observed, sigma_force=shaped)
            # With other weights a sensor that clips may have no solution.
            with suppress(InputError):
                examined = examine(solve(first.model, first.approach, observed))
                field = _field(examined)
    evidence = Evidence(base.level, examined.frame.residuals.redundancy)
    return Problem(base, examined, axes, field, evidence)


def _field(examined: ExaminedFit) -> Field:
    """All candidates of a fit."""
    frame = examined.frame
    return Field(examined.candidates, frame, lack_of_fit(frame.residuals, frame.forces))


def is_exact(fit: Solution) -> bool:
    """Whether a campaign is its own model, so that only rounding errors are left."""
    return float(np.sqrt(np.mean(fit.misclosures**2))) < ROUNDING * fit.gravity


def _best_odds(field: Field, evidence: Evidence, z: NDArray[np.float64]) -> float:
    """Log odds of the most probable single thing that is missing against nothing, at least 0."""
    if not field.names:
        return 0.0
    unknown = [] if field.unknown is None else [field.unknown.weight]
    prior = [*np.full(len(field.candidates), 1 / len(field.candidates)), *unknown]
    nothing = np.logaddexp.reduce(evidence.of_noise(z @ z))
    return max(
        0.0, float(np.max(field.densities(evidence, field.seen(z)) + np.log(prior)) - nothing)
    )
