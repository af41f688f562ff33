"""The calibration of a measured campaign, by the same adjustment as that of simulated sessions."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from accelstudy.adjustment import Observations, calibrate
from accelstudy.adjustment.observations import AngleErrors
from accelstudy.adjustment.quality import solve
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.basics.wording import plural, words
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.columns import COLUMNS
from accelstudy.campaign.gross_errors.recognition import recognise
from accelstudy.campaign.importing.noise import fit_sphere
from accelstudy.campaign.session import Campaign
from accelstudy.design.estimability import Estimability, estimability
from accelstudy.schemes import Scheme
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel, not_affine
from accelstudy.simulation.sessions import Noise

MIN_SIGMA_RATIO = 1e-6
"""Smallest ratio of the noise of a direction to that of the robot's angles that double precision
can weigh."""

MAX_CONDITION = 10.0
"""Condition of the design beyond which too few different attitudes explain why an adjustment does
not converge."""

UNIT_SIGMA = 1e-3
"""m/s², in place of an unknown sigma; only sigmas a posteriori have a meaning then."""
MAX_FITS, SIGMA_TOLERANCE = 30, 1e-4
"""Fits at most, and the relative change of a sigma, with which its search by repeated fits ends."""
MIN_SINGULAR = 0.01
"""Smallest singular value, over the largest, of what positions tell of an ellipsoid."""
MIN_SCATTER = 1e-18
"""m/s²; smaller residuals are no rounding, but all zero."""
CHEAP_SIGMA = 1e-2
"""m/s², of the means of a cheap sensor: what positions must determine a model by where neither the
campaign nor residuals tell the noise."""


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
    return MIN_SIGMA_RATIO * campaign.gravity * sigma_angle * approach.uses_angles


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

    Where no noise is stated, weights take that of the residuals.

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
    fit = CampaignFit(campaign, solve(model, approach, observed, adjustment))
    # Angles, and what is known a priori, need a sigma of the forces beside theirs.
    unstated = campaign.sigma_force is None and fit.solution.redundancy > 0
    for _ in range(MAX_FITS if unstated else 0):
        before, sigma = fit.solution.sigma_force, fit.sigma_position_posteriori
        sigma = max(sigma, 1e-9, least_sigma(campaign, approach))
        if np.isnan(sigma) or abs(sigma - before) <= SIGMA_TOLERANCE * before:
            break
        observed = replace(observed, sigma_force=sigma)
        adjustment = calibrate(model, approach, observed)
        if not adjustment.converged[0]:
            break
        fit = replace(fit, solution=solve(model, approach, observed, adjustment))
    if unstated and np.isnan(fit.sigma_position_posteriori):
        raise InputError(
            f"{campaign.name}: nothing tells the noise of the {campaign.n_positions} positions, by "
            "which they are weighed against what is known of the sensor; state it "
            "(sensor_noise.sigma_mps2), or add positions"
        )
    blur = sigma_to_show_above(campaign)
    if campaign.sigma_force is None and 0 <= fit.sigma_position_posteriori < MIN_SCATTER:
        raise InputError(
            f"{campaign.name}: the positions fit the model {model.name!r} to the last digit, as of "
            "readings in steps that are too coarse, so nothing tells their noise; state it "
            "(sensor_noise.sigma_mps2)"
        )
    if np.isfinite(fit.sigma_position):
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
        n = campaign.n_positions
        raise InputError(
            f"{campaign.name}: {plural(n, 'position')} {'does' if n == 1 else 'do'} not determine "
            f"the model {model.name!r}: {theory.reason}"
        )
    return theory


def campaign_estimability(
    campaign: Campaign, model: SensorModel, approach: Approach, blur: float = 0.0
) -> Estimability:
    """Say what the positions of a campaign determine, above a noise of its means in m/s²."""
    start, names = initial_values(model, campaign.forces, campaign.gravity), model.parameter_names
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
        gain=1 + float(start[names.index("s_x")]) if "s_x" in names else 1.0,
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
    """Biases and scales from the ellipsoid along the axes that fits best, (u,), SI; the rest is 0.

    It is as near to the sphere that fits best as the positions allow. If these do not determine a
    sphere, or the model lacks these parameters, all are zero.
    """
    sphere = fit_sphere(forces)
    if sphere is None:
        return np.zeros(model.n_parameters)
    center, radius = sphere
    # From the sphere Σ u² = 1 to the ellipsoid Σ (1 + a) u² + 2 b u = 1, linear in a and b.
    u = (forces - center) / radius
    design = np.hstack([u**2, 2 * u])
    change = np.linalg.lstsq(design, 1 - np.sum(u**2, axis=1), rcond=MIN_SINGULAR)[0]
    squares, b = 1 + change[:3], change[3:]
    if np.min(squares) <= 0:  # a hyperboloid
        squares, b = np.ones(3), np.zeros(3)
    scales = radius * np.sqrt((1 + np.sum(b**2 / squares)) / squares) / gravity - 1
    values = [*(center - radius * b / squares), *scales]
    return model.vector(dict(zip(("b_x", "b_y", "b_z", "s_x", "s_y", "s_z"), values, strict=True)))
