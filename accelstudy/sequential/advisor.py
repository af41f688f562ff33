"""Advice in a running session: what is determined so far, where to go next, when to stop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics import suggestions
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import IMPLAUSIBLE, REJECTED
from accelstudy.campaign.calibration.assessment import Assessment, tilt_left
from accelstudy.campaign.calibration.fit import (
    CampaignFit,
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
from accelstudy.campaign.calibration.sensor_calibration import sensor_of
from accelstudy.campaign.sensor_type import SensorType, read_type
from accelstudy.campaign.session import Campaign
from accelstudy.design.estimability import is_blind
from accelstudy.design.information import Information, position_rows
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.advice import Advice, NoiseTaken
from accelstudy.sequential.choice import (
    DEFAULTS,
    Chooser,
    Knowledge,
    candidate_positions,
    typical_sizes,
)
from accelstudy.sequential.promise import LEAST_REDUNDANCY, Promise, bound, known_variance
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

KNOWN_RATIO = 0.5
"""Ratio of sigma to the typical size of a parameter, up to which it counts as known at all."""
CONDITIONS = {"time", "temperature", "vibration"}
"""Columns of the holds that change by themselves from position to position."""
TYPES = (".yaml", ".yml")
"""Endings of a file that describes a type of sensors."""
INTERVAL = 60.0
"""s between two holds, until the session has two."""


@dataclass(frozen=True)
class Prior:
    """Parameters that are known beforehand, with their accuracy.

    Attributes
    ----------
    mean : (u,) array, SI
    information : Information, of all u parameters
    """

    mean: Array
    information: Information

    @classmethod
    def of_covariance(cls, mean: ArrayLike, covariance: ArrayLike) -> Prior:
        """Return the prior of an earlier calibration: values (u,) and covariance matrix (u, u).

        Raises
        ------
        InputError
            If the matrix is not positive definite.
        """
        return cls(np.asarray(mean, dtype=float), Information.of_covariance(covariance))

    def augment(self, problem: CalibrationProblem) -> CalibrationProblem:
        """The problem of sessions together with what is known; they may have no positions yet."""
        of_model = slice(len(self.mean))
        # Observed gravity, and 0 ± 1 of errors that angles share, are known beforehand, too.
        weights, direct = np.diag(problem.weights), problem.direct.copy()
        weights[of_model, of_model] = self.information.normal
        direct[:, of_model] = self.mean
        return replace(problem, initial=direct, direct=direct, weights=weights)


def read_prior(given: Path | None, wanted: SensorModel) -> Prior | SensorType | None:
    """Prior knowledge by an earlier calibration or a type of sensors; None without either."""
    if given is None:
        return None
    if given.suffix in TYPES:
        return read_type(given, wanted)
    earlier = sensor_of(given)
    if earlier.model.parameter_names != wanted.parameter_names:
        raise InputError(
            f"{given}: calibrates {', '.join(earlier.model.parameter_names)}, but the model "
            f"{wanted.name!r} has {', '.join(wanted.parameter_names)}"
        )
    if not np.isfinite(earlier.covariance).all():
        raise InputError(f"{given}: does not say how well its parameters are known")
    return Prior.of_covariance(earlier.parameters, earlier.covariance)


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
    advice = advise(session, known, by, promise, directions, read_prior(prior, known))
    of_type = prior if prior is not None and prior.suffix in TYPES else None
    command = suggestions.calibrate(place or "CAMPAIGN", model, by.name, of_type)
    return replace(advice, command=command) if advice.enough else advice


def _check(campaign: Campaign, model: SensorModel, approach: Approach, known: bool) -> None:
    """Raise `InputError` where no number of positions would be enough."""
    if campaign.n_positions:
        check_campaign(campaign, model, approach)
    elif approach.uses_angles and campaign.angles is None:
        raise InputError(
            f"{campaign.name}: approach {approach.name!r} needs the block `robot` in the header"
        )
    if not known and is_blind(model, approach, campaign_noise(campaign), campaign.gravity):
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
    prior: Prior | SensorType | None = None,
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
    prior : Prior or SensorType, optional, from an earlier calibration, or the type of the sensor

    Raises
    ------
    InputError
        If no number of positions would be enough.
    """
    _check(campaign, model, approach, prior is not None)
    earlier = prior if isinstance(prior, Prior) else None
    campaign = replace(campaign, sensor_type=prior if isinstance(prior, SensorType) else None)
    assessed = _assessed(campaign, model, approach)
    fit = None if assessed is None or earlier is not None else assessed.fit
    known, at = _knowledge(campaign, model, approach, fit, earlier)

    stated = campaign.sigma_force is not None
    trusted = stated if assessed is None else assessed.fit.trusts_sigma
    wrong = assessed is not None and assessed.state in (REJECTED, IMPLAUSIBLE)
    noise = campaign_noise(campaign)
    if fit is not None:
        noise = replace(noise, sigma_force=float(np.mean(np.asarray(fit.observed.sigma_force))))
    hold = campaign.hold if campaign.n_positions else next_holds(campaign, np.eye(3)[2:])
    chooser = Chooser(
        directions,
        next_rows(campaign, model, approach, noise, directions),
        promise.tilt_error(model, at, campaign.gravity, hold),
        promise,
        known_variance if trusted else bound,
        typical_sizes(model, known.information.rows.shape[1]),
    )
    rms = chooser.rms(known)
    if fit is not None and stated:
        rms = tilt_left(fit, promise.tilt_range).total
    enough = bool(promise.is_kept(rms)) and not wrong

    last = None
    if campaign.n_positions:
        last = -campaign.forces[-1] / np.linalg.norm(campaign.forces[-1])
    # The conditions of later positions are unknown.
    to_go, varying = None, bool(CONDITIONS & {*model.hold_columns})
    foreseeable = (trusted or known.redundancy >= LEAST_REDUNDANCY) and not varying
    if foreseeable and not enough and not wrong:
        variance = 1.0 if trusted else known.omega / known.redundancy
        to_go = chooser.positions_to_go(known, variance, rms, last)
    suspects = () if assessed is None else assessed.suspects
    advice = Advice(
        name=campaign.name,
        session=campaign,
        model=model,
        approach=approach,
        promise=promise,
        positions=campaign.positions,
        p_last=np.nan if assessed is None else float(assessed.p_adjusted[-1]),
        suspects=tuple(sorted(int(campaign.positions[s.position]) for s in suspects)),
        calibration_state="" if assessed is None else assessed.state,
        undetermined=() if known.determined else _undetermined(campaign, model, approach, known),
        noise=_noise_taken(known, campaign, trusted, noise.sigma_force),
        rms=rms if np.isfinite(rms).all() else None,
        next=directions[chooser.choose(known, rms, last)],
        to_go=to_go,
        foreseeable=foreseeable,
        enough=enough,
    )
    return advice if last is None or advice.repeats is None else replace(advice, next=last)


def _assessed(campaign: Campaign, model: SensorModel, approach: Approach) -> Assessment | None:
    """Assess the calibration of the session so far; None if there is none."""
    if not campaign.n_positions:
        return None
    try:
        return Assessment(fit_campaign(campaign, model, approach))
    except InputError:  # it is not determined yet, or does not converge
        return None


def _knowledge(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach,
    fit: CampaignFit | None,
    prior: Prior | None,
) -> tuple[Knowledge, Array]:
    """What is known so far, and parameters near it: those of the calibration if there is one."""
    problem = CalibrationProblem.of(model, approach, campaign_observations(campaign))
    adjustment, x = None if fit is None else fit.adjustment, problem.direct.copy()
    if prior is not None:
        problem = prior.augment(problem)
        adjustment, x = problem.adjust(), problem.direct
    elif campaign.n_positions:
        x[0, : model.n_parameters] = initial_values(model, campaign.forces, campaign.gravity)
    if adjustment is not None and adjustment.converged[0]:
        information = Information.of_covariance(adjustment.cofactors[0])
        known = Knowledge(information, float(adjustment.omega[0]), adjustment.redundancy)
        return known, adjustment.parameters[0, : model.n_parameters]
    # The raw readings at the first values of the parameters, and what is known beforehand.
    weights = problem.weights
    before = np.diag(np.sqrt(weights)) if prior is None else np.linalg.cholesky(weights).T
    rows = problem.rows(x) if campaign.n_positions else ()
    information = Information.of(np.asarray(before)[before.any(axis=1)], *rows)
    determined = campaign.n_positions == 0 and information.determined
    redundancy = information.conditions - len(before)
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


def _noise_taken(known: Knowledge, campaign: Campaign, trusted: bool, unit: float) -> NoiseTaken:
    """Noise of a position by which the accuracy is judged."""
    stated, r = campaign.sigma_force, known.redundancy
    seen, taken = None, stated
    if known.determined and r > 0:
        seen = unit * float(np.sqrt(known.omega / r))
    refuted = stated is not None and not trusted
    if refuted:
        taken = seen
    elif stated is None:
        largest = float(np.sqrt(bound(known.omega, r)))
        taken = unit * largest if np.isfinite(largest) else None
    return NoiseTaken(stated, seen, taken, refuted, r)


def next_rows(
    campaign: Campaign, model: SensorModel, approach: Approach, noise: Noise, directions: Array
) -> Array:
    """Rows of the design matrix of each of k attitudes as the next position, (k, c, u')."""
    hold, errors = next_holds(campaign, directions), angle_errors(campaign)
    return position_rows(model, approach, noise, directions, campaign.gravity, hold, errors)


def next_holds(campaign: Campaign, directions: Array) -> HoldConditions:
    """Conditions of each of k attitudes as the next position: those of the last, one hold later."""
    k, n = len(directions), campaign.n_positions
    last = campaign.hold.take(np.array([n - 1])) if n else HoldConditions()

    def goes_on(value: Array | None, usual: float) -> Array:
        return np.full(k, usual if value is None else float(value[0]))

    time = goes_on(last.time, 0.0)
    if campaign.time is not None and n > 1:
        time += np.median(np.diff(campaign.time))
    elif n:
        time += INTERVAL
    f_b = -campaign.gravity * directions
    step = f_b - campaign.forces[-1] if n else np.zeros_like(f_b)
    return HoldConditions(
        temperature=goes_on(last.temperature, REFERENCE_TEMPERATURE),
        time=time,
        vibration=goes_on(last.vibration, 0.0),
        yaw=goes_on(last.yaw, 0.0),
        step_x=step[:, 0],
        step_y=step[:, 1],
        step_z=step[:, 2],
        order=time if campaign.time is not None else np.full(k, n + 1.0),
        course=campaign.hold.take(np.arange(n)).course if n else None,
        full_range=campaign.full_range,
    )
