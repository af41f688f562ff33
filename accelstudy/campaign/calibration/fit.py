"""The calibration of a measured campaign, by the same adjustment as that of simulated sessions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Adjustment, Observations, calibrate
from accelstudy.adjustment.observations import AngleErrors
from accelstudy.adjustment.quality import (
    GlobalTest,
    Solution,
    global_test,
    pooled_variance,
    solve,
)
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.units import MGON
from accelstudy.basics.wording import words
from accelstudy.campaign.columns import COLUMNS
from accelstudy.campaign.gross_errors.recognition import recognise
from accelstudy.campaign.importing.noise import fit_sphere
from accelstudy.campaign.session import Campaign
from accelstudy.design.estimability import Estimability, estimability
from accelstudy.schemes import Scheme
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel, not_affine
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

LEAST_RATIO = 1e-6
"""Smallest ratio of the noise of a direction to that of the robot's angles that double precision
can weigh."""

MAX_CONDITION = 10.0
"""Condition of the design beyond which too few different attitudes explain why an adjustment does
not converge."""

UNIT_SIGMA = 1e-3
"""m/s², in place of an unknown sigma; only sigmas a posteriori have a meaning then."""
CHEAP_SIGMA = 1e-2
"""m/s², of the means of a cheap sensor: what positions must determine a model by where neither the
campaign nor residuals tell the noise."""


@dataclass(frozen=True)
class JudgedNoise:
    """A judgement of the noise of a campaign.

    Attributes
    ----------
    trusted : bool, whether the campaign states its noise and nothing refutes it
    variance : float, variance of unit weight to quote; 1 where the stated noise is trusted
    """

    trusted: bool
    variance: float


@dataclass(frozen=True, eq=False)
class CampaignFit:
    """A calibrated campaign.

    Attributes
    ----------
    campaign, model, approach : what was fitted, with what
    observed : Observations, R = 1
    adjustment : Adjustment, R = 1
    estimability : Estimability, of the campaign's own positions
    judged : JudgedNoise, from a diagnosis; by default the global test of this fit judges the noise
    """

    campaign: Campaign
    model: SensorModel
    approach: Approach
    observed: Observations
    adjustment: Adjustment
    estimability: Estimability
    judged: JudgedNoise | None = None

    @property
    def sigma_known(self) -> bool:
        """Whether the campaign gives the noise of its position means."""
        return self.campaign.sigma_force is not None

    @property
    def parameters(self) -> Array:
        """Estimates of the model's parameters, (u,), SI."""
        return self.adjustment.parameters[0, : self.model.n_parameters]

    @property
    def global_test(self) -> GlobalTest | None:
        """Test of the whole model; None where sigma is unknown or there is no redundancy."""
        if not self.sigma_known:
            return None
        return global_test(self._omega, self.adjustment.redundancy, sigma_dof=self.sigma_dof)

    @property
    def _omega(self) -> float:
        return float(self.adjustment.omega[0])

    @cached_property
    def solution(self) -> Solution:
        """The adjustment, linearised at the estimates."""
        return solve(self.model, self.approach, self.observed, self.adjustment)

    @property
    def sigma_dof(self) -> float:
        """Degrees of freedom of the stated noise in Ω; infinite where it is known."""
        stated = self.observed.sigma_dof
        return self.solution.sigma_dof if np.isfinite(stated) else stated

    @cached_property
    def noise(self) -> JudgedNoise:
        """The noise that is quoted, as a diagnosis or the global test judged it.

        A stated noise is trusted unless the residuals refute it. If it is itself an estimate it is
        pooled with the residuals; if it is not trusted the noise is that of the residuals.
        """
        if self.judged is not None:
            return self.judged
        test, r = self.global_test, self.adjustment.redundancy
        if self.sigma_known and (test is None or test.accepted):
            return JudgedNoise(True, pooled_variance(self._omega, r, self.sigma_dof))
        return JudgedNoise(False, float(self.adjustment.variance_posteriori[0]))

    @property
    def trusts_sigma(self) -> bool:
        """Whether the a-priori noise is quoted."""
        return self.noise.trusted

    @property
    def variance_factor(self) -> float:
        """Variance of unit weight to quote."""
        return self.noise.variance

    @property
    def dof(self) -> float:
        """Degrees of freedom of the noise that is quoted; infinite where it is known."""
        r = self.adjustment.redundancy
        return self.sigma_dof + r if self.trusts_sigma else r

    @property
    def is_noise_known(self) -> bool:
        """Whether the quoted noise is known, and no estimate."""
        return bool(np.isinf(self.dof))

    @property
    def sigma_position(self) -> float:
        """Noise of a position mean to quote, m/s²: as stated if trusted, else a posteriori."""
        return self._sigma_taken * float(np.sqrt(self.variance_factor))

    @property
    def sigma_position_posteriori(self) -> float:
        """Noise of a position mean from the residuals, m/s²; NaN without redundancy."""
        factor = float(self.adjustment.variance_posteriori[0])
        return self._sigma_taken * float(np.sqrt(factor))

    @property
    def _sigma_taken(self) -> float:
        """Noise of a position mean of unit weight, m/s²."""
        return float(np.mean(np.asarray(self.observed.sigma_force)))

    @property
    def covariance(self) -> Array:
        """Covariance matrix of the model's parameters to quote, (u, u), SI."""
        u = self.model.n_parameters
        return self.variance_factor * self.adjustment.cofactors[0, :u, :u]

    @property
    def by_reference(self) -> Array | None:
        """Part of `covariance` that the calibration of a reference causes, (u, u), SI.

        It is what would be gone if that calibration had no errors: Q_xc Q_cc⁻¹ Q_cx, with the
        errors c that all holds share. None where no reference was used.
        """
        if self.observed.common is None or not self.approach.uses_angles:
            return None
        q, u = self.adjustment.cofactors[0], self.model.n_parameters
        shared = slice(u, u + self.observed.common.shape[-1])
        part = q[:u, shared] @ np.linalg.solve(q[shared, shared], q[shared, :u])
        return self.variance_factor * part

    @property
    def sigma(self) -> Array:
        """Standard deviations of the parameters to quote, (u,), SI."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def sigmas_95(self) -> float:
        """Number of quoted sigmas on either side that hold 95 %; by Student's t of an estimate."""
        return sigmas_95(self.dof)

    @property
    def gravity(self) -> float:
        """Gravity, m/s²: the adjusted value if it was observed."""
        if self.campaign.header.gravity.sigma_mps2 > 0:
            return float(self.adjustment.parameters[0, -1])
        return self.campaign.gravity

    @property
    def corrected(self) -> Array:
        """Calibrated specific forces of the holds, (n, 3), m/s²."""
        campaign = self.campaign
        return self.model.correct(campaign.forces, self.parameters, self.gravity, campaign.hold)

    @property
    def norm_residuals(self) -> Array:
        """|f_b| − g of the holds, (n,), m/s²."""
        return np.linalg.norm(self.corrected, axis=1) - self.gravity

    @property
    def rms_norm_residual(self) -> float:
        """Rms of |f_b| − g over the holds, m/s²."""
        return float(np.sqrt(np.mean(self.norm_residuals**2)))


def usual_approach(campaign: Campaign) -> Approach:
    """Return the approach that uses all that a campaign has: robot-aided if it has the angles."""
    return get_approach("gravity" if campaign.angles is None else "robot")


def campaign_noise(campaign: Campaign) -> Noise:
    """Stochastic model of a campaign; an unknown sigma is `UNIT_SIGMA`."""
    return Noise(
        sigma_force=UNIT_SIGMA if campaign.sigma_force is None else campaign.sigma_force,
        sigma_angle=campaign.header.sigma_angle or 0.0,
        sigma_gravity=campaign.header.gravity.sigma_mps2,
    )


def least_sigma(campaign: Campaign, approach: Approach) -> float:
    """Smallest noise of a force, m/s², that can be weighed against that of the angles."""
    sigma_angle = campaign.header.sigma_angle or 0.0
    return LEAST_RATIO * campaign.gravity * sigma_angle * approach.uses_angles


def campaign_observations(campaign: Campaign) -> Observations:
    """Observations of a campaign for the adjustment, R = 1."""
    noise, errors = campaign_noise(campaign), angle_errors(campaign)
    sigma_angle: tuple[float | Array, Array | None] = noise.sigma_angle, None
    if errors is not None and campaign.angles is not None:
        sigma_angle = errors(campaign.angles)
    return Observations(
        forces=campaign.forces[None],
        sigma_force=noise.sigma_force,
        angles=None if campaign.angles is None else campaign.angles[None],
        sigma_angle=sigma_angle[0],
        common=sigma_angle[1],
        angle_errors=errors,
        gravity=campaign.gravity,
        sigma_gravity=noise.sigma_gravity,
        hold=campaign.hold,
        known={} if campaign.sensor_type is None else campaign.sensor_type.known,
        sigma_dof=campaign.header.sigma_dof,
    )


def angle_errors(campaign: Campaign) -> AngleErrors | None:
    """Errors of a reference in any attitude, as of `Observations`; None without a reference."""
    reference = campaign.header.reference
    return None if reference is None else partial(reference.errors, gravity=campaign.gravity)


def check_campaign(campaign: Campaign, model: SensorModel, approach: Approach) -> None:
    """Raise `InputError` if a campaign lacks what the approach or the model needs."""
    if approach.uses_angles and campaign.angles is None:
        raise InputError(
            f"{campaign.name}: approach {approach.name!r} needs the columns roll_robot_gon and "
            "pitch_robot_gon"
        )
    for effect, column in model.needs:
        if getattr(campaign.hold, column) is None:
            attribute = "angles" if column in ("roll", "pitch") else column
            names = " and ".join(COLUMNS[attribute].keys)
            raise InputError(
                f"{campaign.name}: the effect {effect!r} of the model needs the {column} "
                f"of each position; the campaign has no {names}"
            )
    noise, least = campaign_noise(campaign), least_sigma(campaign, approach)
    if noise.sigma_force < least:
        raise InputError(
            f"{campaign.name}: sensor_noise.sigma_mps2: {noise.sigma_force:g} is too small beside "
            f"robot.angle_sigma_mgon: {noise.sigma_angle / MGON:g}; expected {least:.2g} or more"
        )


def fit_campaign(
    campaign: Campaign, model: SensorModel, approach: Approach | None = None
) -> CampaignFit:
    """Calibrate a campaign, by default robot-aided if it has the robot's angles.

    Raises
    ------
    InputError
        If the campaign lacks what the approach or the model needs, if its positions do not
        determine the model (says which parameters), or if the adjustment does not converge.
    """
    approach = approach or usual_approach(campaign)
    check_campaign(campaign, model, approach)
    start_of = partial(initial_values, forces=campaign.forces, gravity=campaign.gravity)
    theory = _determined(campaign, model, approach)
    observed = replace(campaign_observations(campaign), initial=start_of(model))
    adjustment = calibrate(model, approach, observed)
    if not adjustment.converged[0] and (unfit := not_affine(model)):
        # If nonlinear effects are large, the affine part of the model gives a better start.
        rest = [effect.spec for effect in model.effects if effect.name not in unfit]
        part = compose("affine part", tuple(rest))
        first = calibrate(part, approach, replace(observed, initial=start_of(part)))
        values = dict(zip(part.parameter_names, first.parameters[0].tolist(), strict=False))
        observed = replace(observed, initial=model.vector(values))
        adjustment = calibrate(model, approach, observed)
    if not adjustment.converged[0]:
        _determined(campaign, model, approach, sigma_to_show_above(campaign))
        raise InputError(f"{campaign.name}: {_cause(campaign, model, theory)}")
    fit = CampaignFit(campaign, model, approach, observed, adjustment, theory)
    prior = model.prior_weights.any() or observed.common is not None or bool(observed.known)
    if campaign.sigma_force is None and prior and adjustment.redundancy > 0:
        # What is known a priori needs a sigma beside it: that of the residuals.
        for _ in range(3):
            sigma = max(fit.sigma_position_posteriori, 1e-9, least_sigma(campaign, approach))
            observed = replace(observed, sigma_force=sigma)
            adjustment = calibrate(model, approach, observed)
            if adjustment.converged[0]:
                fit = replace(fit, observed=observed, adjustment=adjustment)
    blur = sigma_to_show_above(campaign)
    if adjustment.redundancy > 0:
        # A stated noise may be too large; where residuals are larger, an effect may be missing.
        seen = fit.sigma_position
        blur = max(seen, UNIT_SIGMA) if campaign.sigma_force is None else min(seen, blur)
    _determined(campaign, model, approach, blur)
    return fit


def sigma_to_show_above(campaign: Campaign) -> float:
    """Noise of a mean by which positions must determine a model, without residuals, m/s²."""
    return CHEAP_SIGMA if campaign.sigma_force is None else campaign.sigma_force


def _determined(
    campaign: Campaign, model: SensorModel, approach: Approach, blur: float = 0.0
) -> Estimability:
    """Say what the positions determine, or raise `InputError` if that is not the model."""
    theory = campaign_estimability(campaign, model, approach, blur)
    if not theory.estimable:
        raise InputError(
            f"{campaign.name}: {campaign.n_positions} positions do not determine the model "
            f"{model.name!r}: {theory.reason}"
        )
    return theory


def campaign_estimability(
    campaign: Campaign, model: SensorModel, approach: Approach, blur: float = 0.0
) -> Estimability:
    """Say what the positions of a campaign determine, above a noise of its means in m/s²."""
    start = initial_values(model, campaign.forces, campaign.gravity)
    rough = model.correct(campaign.forces, start, campaign.gravity, campaign.hold)
    return estimability(
        Scheme(campaign.name, campaign.name, -rough, "exact", f"campaign {campaign.name}"),
        model,
        approach,
        campaign_noise(campaign),
        gravity=campaign.gravity,
        hold=campaign.hold,
        known={} if campaign.sensor_type is None else campaign.sensor_type.known,
        forces=rough if blur else None,
        blur=blur,
    )


def _cause(campaign: Campaign, model: SensorModel, theory: Estimability) -> str:
    """Name the probable reason why an adjustment does not converge."""
    if (gross := recognise(campaign)) is not None:
        what = f"{gross.reason}, and no calibration fits that; `accelstudy diagnose` mends it"
        return f"this looks like a gross error ({words(gross.name)}): {what}"
    why = "a gross error in the data or a wrong unit is the usual cause"
    if theory.condition > MAX_CONDITION:
        why = (
            f"the {campaign.n_positions} positions hardly determine it (condition "
            f"{theory.condition:.0f}, up to {MAX_CONDITION:.0f} is usual); add attitudes"
        )
    return f"the adjustment of the model {model.name!r} does not converge; {why}"


def initial_values(model: SensorModel, forces: Array, gravity: float) -> Array:
    """Biases and a common scale from the sphere that fits best, (u,), SI; the rest is zero.

    If the positions do not determine a sphere, or the model lacks these parameters, all are zero.
    """
    sphere = fit_sphere(forces)
    if sphere is None:
        return np.zeros(model.n_parameters)
    center, radius = sphere
    scale = radius / gravity - 1
    names = ("x", "y", "z")
    values = {f"b_{i}": b for i, b in zip(names, center, strict=True)}
    return model.vector({**values, **{f"s_{i}": scale for i in names}})
