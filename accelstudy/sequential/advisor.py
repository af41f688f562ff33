"""Advice in a running session: what is determined so far, where to go next, when to stop."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics import suggestions
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import IMPLAUSIBLE, REJECTED
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.fit import (
    angle_errors,
    campaign_estimability,
    campaign_noise,
    campaign_observations,
    check_campaign,
    fit_campaign,
    initial_values,
    sigma_to_show_above,
    usual_approach,
)
from accelstudy.campaign.sensor_type import with_type
from accelstudy.campaign.session import Campaign
from accelstudy.design.estimability import is_blind
from accelstudy.design.information import Information, position_rows
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.error import error_in_use
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.advice import Advice
from accelstudy.sequential.choice import (
    DEFAULTS,
    Chooser,
    Knowledge,
    candidate_positions,
    typical_sizes,
)
from accelstudy.sequential.promise import LEAST_REDUNDANCY, Promise, bound

KNOWN_RATIO = 0.5
"""Ratio of sigma to the typical size of a parameter, up to which it counts as known at all."""
CONDITIONS = {"time", "temperature", "vibration"}
"""Columns of the holds that change by themselves from position to position."""


def advise_session(
    session: Campaign,
    place: Path | None,
    *,
    tilt_accuracy: float,
    tilt_range: float,
    model: str,
    approach: str | None,
    prior: Path | None,
    attitudes: str | None,
    **limits: float | None,
) -> Advice:
    """Advise by the keywords of `accelstudy.advise`, checked; `place` is the folder, if any."""
    by = get_approach(approach) if approach else usual_approach(session)
    known, promise = get_model(model), Promise(tilt_accuracy, tilt_range)
    directions = candidate_positions(attitudes or DEFAULTS.get(by.name, "grid"), **limits)
    advice = advise(with_type(session, prior, known), known, by, promise, directions)
    command = suggestions.calibrate(place or "CAMPAIGN", model, by.name, prior)
    return replace(advice, command=command) if advice.enough else advice


def _check(campaign: Campaign, model: SensorModel, approach: Approach) -> None:
    """Raise `InputError` where no number of positions would be enough."""
    if campaign.n_positions:
        check_campaign(campaign, model, approach)
    elif approach.uses_angles and campaign.angles is None:
        raise InputError(
            f"{campaign.name}: approach {approach.name!r} needs the block `robot` in the header"
        )
    noise, g = campaign_noise(campaign), campaign.gravity
    if campaign.sensor_type is None and is_blind(model, approach, noise, g):
        or_robot = "" if approach.uses_angles else ", or a robot"
        raise InputError(
            f"the {approach.name} approach cannot determine the model {model.name!r} in any "
            f"positions; take a simpler model{or_robot}"
        )


def advise(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach,
    promise: Promise,
    directions: Array,
) -> Advice:
    """Advise in a session that is being measured.

    The session so far is calibrated and assessed as any campaign, and advice follows that: what is
    determined, which positions are odd, how large a tilt error is left, and whether anything is
    wrong.

    Parameters
    ----------
    campaign : Campaign, the session so far; it may have no positions yet
    model : SensorModel
    approach : Approach
    promise : Promise
    directions : (k, 3) array, attitudes to choose from

    Raises
    ------
    InputError
        If no number of positions would be enough.
    """
    _check(campaign, model, approach)
    fit, n = _fit(campaign, model, approach), campaign.n_positions
    known, at = _knowledge(campaign, model, approach, fit)

    stated = campaign.sigma_force is not None
    trusted = stated if fit is None else fit.noise.trusted
    wrong = fit is not None and fit.state in (REJECTED, IMPLAUSIBLE)
    sigma_dof = (campaign.header if fit is None else fit.solution).sigma_dof if trusted else 0.0
    upper_bound = partial(bound, sigma_dof=sigma_dof)
    noise = campaign_noise(campaign)
    if fit is not None:
        noise = replace(noise, sigma_force=fit.solution.sigma_force)
    holds = next_holds(campaign, directions)
    chooser = Chooser(
        directions,
        position_rows(
            model, approach, noise, directions, campaign.gravity, holds, angle_errors(campaign)
        ),
        error_in_use(
            model, at, promise.tilt_range, campaign.gravity, campaign.hold if n else holds
        ),
        promise,
        upper_bound,
        typical_sizes(model, known.information.rows.shape[1]),
    )
    rms = chooser.rms(known)
    refuted = stated and not trusted
    if fit is not None and (refuted or np.isfinite(rms).all()):
        dof, variance = fit.dof, fit.noise.variance
        upper = float(bound(variance * dof, dof)) if np.isfinite(dof) else 1.0
        judged = fit.noise if refuted else fit.noise._replace(variance=upper)
        rms = np.full(2, np.inf)
        if np.isfinite(judged.variance):
            rms = replace(fit, judgement=judged).tilt_budget(promise.tilt_range).total
    enough = bool(promise.is_kept(rms)) and not wrong

    last = -campaign.forces[-1] / np.linalg.norm(campaign.forces[-1]) if n else None
    # The conditions of later positions are unknown.
    to_go, varying = None, bool(CONDITIONS & {*model.hold_columns})
    foreseeable = (trusted or known.redundancy >= LEAST_REDUNDANCY) and not varying
    if foreseeable and not enough and not wrong:
        variance = 1.0 if fit is None else fit.noise.variance
        to_go = chooser.positions_to_go(known, variance, rms, last)
    omega, r, unit = known.omega, known.redundancy, noise.sigma_force
    seen = unit * float(np.sqrt(omega / r)) if known.determined and r > 0 else None
    largest = unit * float(np.sqrt(upper_bound(omega, r)))
    advice = Advice(
        session=campaign,
        model=model,
        approach=approach,
        promise=promise,
        p_last=np.nan if fit is None else float(fit.p_adjusted[-1]),
        in_conflict=() if fit is None else tuple(sorted(fit.suspects)),
        calibration_state="" if fit is None else fit.state,
        undetermined=() if known.determined else _undetermined(campaign, model, approach, known),
        sigma_seen=seen,
        sigma_taken=seen if refuted else largest if np.isfinite(largest) else None,
        redundancy=r,
        rms=rms if np.isfinite(rms).all() else None,
        next=directions[chooser.choose(known, rms, last)],
        to_go=to_go,
        foreseeable=foreseeable,
        enough=enough,
    )
    return advice if last is None or advice.repeats is None else replace(advice, next=last)


def _fit(campaign: Campaign, model: SensorModel, approach: Approach) -> CampaignFit | None:
    """Calibrate the session so far; None if that is not possible yet."""
    if not campaign.n_positions:
        return None
    try:
        return fit_campaign(campaign, model, approach)
    except InputError:  # it is not determined yet, or does not converge
        return None


def _knowledge(
    campaign: Campaign, model: SensorModel, approach: Approach, fit: CampaignFit | None
) -> tuple[Knowledge, Array]:
    """What is known so far, and parameters near it: those of the calibration if there is one."""
    if fit is not None:
        information = Information.of_covariance(fit.solution.cofactors)
        known = Knowledge(information, fit.solution.omega, fit.solution.redundancy)
        return known, fit.parameters
    # The raw readings at the first values of the parameters, and what is known beforehand.
    problem = CalibrationProblem.of(model, approach, campaign_observations(campaign))
    x, n = problem.direct.copy(), campaign.n_positions
    if n:
        x[0, : model.n_parameters] = initial_values(model, campaign.forces, campaign.gravity)
    before = np.diag(np.sqrt(problem.weights))[problem.weights > 0]
    information = Information.of(before, *(problem.rows(x) if n else ()))
    determined = n == 0 and information.determined
    redundancy = information.conditions - x.shape[1]
    known = Knowledge(information, 0.0 if determined else np.nan, redundancy)
    return known, x[0, : model.n_parameters]


def _undetermined(
    campaign: Campaign, model: SensorModel, approach: Approach, known: Knowledge
) -> tuple[str, ...]:
    """Parameters that the positions do not determine better than their typical size."""
    rows, u = known.information.rows, model.n_parameters
    sizes = typical_sizes(model, rows.shape[1])
    sigma = np.sqrt(np.diag(Information.of(rows, np.diag(1 / sizes)).covariance))
    hardly = np.array(model.parameter_names)[(sigma > KNOWN_RATIO * sizes)[:u]]
    if len(hardly) or not campaign.n_positions:
        return tuple(hardly.tolist())
    theory = campaign_estimability(campaign, model, approach, sigma_to_show_above(campaign))
    return tuple(name for name in theory.not_estimable if name in model.parameter_names)


def next_holds(campaign: Campaign, directions: Array) -> HoldConditions:
    """Conditions of each of k attitudes as the next position: but for the step, those of the last.

    Before the first position they are usual ones.
    """
    n, f_b = campaign.n_positions, -campaign.gravity * directions
    zero, step = np.zeros(len(f_b)), f_b - campaign.forces[-1] if n else np.zeros_like(f_b)
    last = HoldConditions(
        temperature=zero + REFERENCE_TEMPERATURE,
        time=zero,
        vibration=zero,
        yaw=zero,
        order=zero + 1,
        full_range=campaign.header.range_mps2,
    )
    if n:
        last = campaign.hold.take(np.full(len(f_b), n - 1))
    return replace(last, step_x=step[:, 0], step_y=step[:, 1], step_z=step[:, 2])
