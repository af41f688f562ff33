"""Advice in a running session: what is determined so far, where to go next, when to stop."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment import Observations, whitened_jacobian
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import IMPLAUSIBLE, REJECTED
from accelstudy.campaign.calibration.assessment import Assessment, assess, tilt_left
from accelstudy.campaign.calibration.fit import (
    angle_errors,
    campaign_estimability,
    campaign_noise,
    campaign_observations,
    check_campaign,
    fit_campaign,
    initial_values,
    sigma_to_show_above,
)
from accelstudy.campaign.of_type import SensorType
from accelstudy.campaign.session import Campaign
from accelstudy.design.estimability import is_blind
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import angles_of, roll_pitch
from accelstudy.leveling.error import TiltError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.choice import Chooser, typical_sizes
from accelstudy.sequential.information import NOTHING_KNOWN, Prior
from accelstudy.sequential.promise import LEAST_REDUNDANCY, Promise, get_rule
from accelstudy.sequential.recursion import Recursion
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

KNOWN = 0.5
"""Ratio of sigma to the typical size of a parameter, up to which it counts as known at all."""
CONDITIONS = {"time", "temperature", "vibration"}
"""Columns of the holds that change by themselves from position to position."""
INTERVAL = 60.0
"""s between two holds, until the session has two."""


@dataclass(frozen=True)
class NoiseTaken:
    """Noise of a position by which the accuracy is judged, m/s².

    Attributes
    ----------
    stated : float or None, by the campaign
    seen : float or None, from the residuals; None without redundancy
    taken : float or None, the one that is used; None as long as it is unknown
    refuted : bool, whether the residuals contradict the stated noise
    redundancy : int
    """

    stated: float | None
    seen: float | None
    taken: float | None
    refuted: bool
    redundancy: int


@dataclass(frozen=True)
class LastPosition:
    """The last position, tested by all others as in the report of a calibration.

    Attributes
    ----------
    index : int, in the session
    p_value : float, adjusted for the number of positions; NaN where the others cannot test it
    conflict : bool, whether it contradicts the others
    """

    index: int
    p_value: float
    conflict: bool


@dataclass(frozen=True)
class NextPosition:
    """The position to take next.

    Attributes
    ----------
    direction : (3,) array, of gravity in the body frame
    repeats : int or None, number of the position that it repeats
    """

    direction: Array
    repeats: int | None


@dataclass(frozen=True)
class Advice:
    """The whole advice.

    Attributes
    ----------
    positions : (n,) int array, numbers of the positions, without those that the campaign leaves out
    last : LastPosition or None
    suspects : tuple of int, numbers of positions that contradict the others; they are used
    state : str, of a calibration with these positions; empty if there is none yet
    undetermined : tuple of str, parameters that the positions do not determine yet
    vague : tuple of str, parameters known less well than the typical size in a cheap sensor
    noise : NoiseTaken
    rms : (2,) array, rad, of roll and of pitch; None as long as it is not known
    next : NextPosition
    to_go : int or None, positions still needed; None if unknown or too many
    foreseeable : bool, whether `to_go` can be known
    enough : bool, whether the promise is kept, by a calibration that is not rejected
    """

    positions: NDArray[np.int_]
    last: LastPosition | None
    suspects: tuple[int, ...]
    state: str
    undetermined: tuple[str, ...]
    vague: tuple[str, ...]
    noise: NoiseTaken
    rms: Array | None
    next: NextPosition
    to_go: int | None
    foreseeable: bool
    enough: bool


@dataclass
class Advisor:
    """Advice for a session that is being measured.

    The session so far is calibrated and assessed as any campaign, and advice follows that: which
    positions are odd, how large a tilt error is left, and whether anything is wrong.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    promise : Promise
    directions : (k, 3) array, attitudes to choose from
    prior : Prior, optional, from an earlier calibration or from the type of the sensor
    of_type : SensorType, optional, the type, if the prior is from it
    """

    model: SensorModel
    approach: Approach
    promise: Promise
    directions: Array
    prior: Prior = NOTHING_KNOWN
    of_type: SensorType | None = None
    _recursion: Recursion | None = field(default=None, init=False)

    def restart(self) -> None:
        """Forget all positions, because they have changed."""
        self._recursion = None

    def check(self, campaign: Campaign) -> None:
        """Raise `InputError` where no number of positions would be enough."""
        if campaign.n_positions:
            check_campaign(campaign, self.model, self.approach)
        elif self.approach.uses_angles and campaign.angles is None:
            raise InputError(
                f"{campaign.name}: approach {self.approach.name!r} needs the block `robot` in the "
                "header"
            )
        noise, no_prior = campaign_noise(campaign), self.prior is NOTHING_KNOWN
        if no_prior and is_blind(self.model, self.approach, noise, campaign.gravity):
            or_robot = "" if self.approach.uses_angles else ", or a robot"
            raise InputError(
                f"the {self.approach.name} approach cannot determine the model "
                f"{self.model.name!r} in any positions; take a simpler model{or_robot}"
            )

    def advise(self, campaign: Campaign) -> Advice:
        """Take the new positions of a session, and give advice.

        Parameters
        ----------
        campaign : Campaign
            The session so far; positions that were taken before are unchanged.
        """
        observed = campaign_observations(campaign)
        if self._recursion is None or not self._recursion.solved[0]:
            initial = None
            if self.prior is NOTHING_KNOWN and campaign.n_positions:
                initial = initial_values(self.model, campaign.forces, campaign.gravity)
            self._recursion = Recursion(self.model, self.approach, observed, self.prior, initial)
        else:
            self._recursion.add(observed)
        return self._advice(campaign, self._recursion, self._assessed(campaign))

    def _assessed(self, campaign: Campaign) -> Assessment | None:
        """Assess the calibration of the session so far; None if there is none."""
        if not campaign.n_positions:
            return None
        try:
            known = replace(campaign, of_type=self.of_type)
            return assess(fit_campaign(known, self.model, self.approach))
        except InputError:  # it is not determined yet, or does not converge
            return None

    def _advice(
        self, campaign: Campaign, recursion: Recursion, assessed: Assessment | None
    ) -> Advice:
        noise, no_prior = campaign_noise(campaign), self.prior is NOTHING_KNOWN
        solved = bool(recursion.solved[0]) and not (no_prior and assessed is None)
        trusted = campaign.sigma_force is not None
        if assessed is not None:
            trusted = assessed.fit.trusts_sigma
        wrong = assessed is not None and assessed.state in (REJECTED, IMPLAUSIBLE)
        root = recursion.root_information
        chooser = Chooser(
            self.directions,
            next_rows(campaign, self.model, self.approach, noise, self.directions),
            self._tilt_error(campaign, recursion.parameters[0] if solved else None),
            self.promise,
            "known" if trusted else "bound",
            typical_sizes(self.model, root.shape[-1]),
        )
        rms = np.full((1, 2), np.inf)
        if solved and assessed is not None and no_prior and campaign.sigma_force is not None:
            rms = tilt_left(assessed.fit, self.promise.tilt_range)[None]
        elif solved:
            rms = chooser.rms(root, recursion.omega, recursion.redundancy)
        enough = bool(self.promise.reached(rms)[0]) and not wrong

        last, repeats = None, None
        if campaign.n_positions:
            last = -campaign.forces[-1] / np.linalg.norm(campaign.forces[-1])
        latest = _last_position(campaign, assessed)
        if latest is not None and latest.conflict:
            repeats = int(campaign.positions[latest.index])
        # The conditions of later positions are unknown.
        to_go, varying = None, bool(CONDITIONS & {*self.model.hold_columns})
        foreseeable = (trusted or recursion.redundancy >= LEAST_REDUNDANCY) and not varying
        if foreseeable and not enough and not wrong:
            r = recursion.redundancy
            variance = 1.0 if trusted else float(recursion.omega[0]) / r
            to_go = chooser.positions_to_go(root[0], variance, r, rms[0], last)
        if repeats is None or last is None:
            before = None if last is None else last[None]
            choice = chooser.choose(root, np.array([solved]), rms, before)[0]
            best = chooser.directions[choice]
        else:
            best = last
        suspects = () if assessed is None else assessed.suspects
        return Advice(
            positions=campaign.positions,
            last=latest,
            suspects=tuple(sorted(int(campaign.positions[s.position]) for s in suspects)),
            state="" if assessed is None else assessed.state,
            undetermined=self._undetermined(campaign, root[0], solved),
            vague=self._vague(recursion) if solved else (),
            noise=_noise_taken(recursion, campaign, trusted, noise.sigma_force),
            rms=rms[0] if np.isfinite(rms).all() else None,
            next=NextPosition(best, repeats),
            to_go=to_go,
            foreseeable=foreseeable,
            enough=enough,
        )

    def _tilt_error(self, campaign: Campaign, parameters: Array | None) -> TiltError:
        hold = campaign.hold if campaign.n_positions else next_holds(campaign, np.eye(3)[2:])
        if parameters is not None:
            parameters = parameters[: self.model.n_parameters]  # without gravity
        return self.promise.tilt_error(self.model, parameters, campaign.gravity, hold)

    def _undetermined(self, campaign: Campaign, root: Array, solved: bool) -> tuple[str, ...]:
        """Parameters that the positions do not determine better than their typical size."""
        if solved:
            return ()
        names, sizes = self.model.parameter_names, typical_sizes(self.model, len(root))
        covariance = np.linalg.inv(root.T @ root + np.diag(sizes**-2))
        sigma = np.sqrt(np.diag(covariance))[: len(names)]
        vague = [n for n, s, size in zip(names, sigma, sizes, strict=False) if s > KNOWN * size]
        if vague or not campaign.n_positions:
            return tuple(vague)
        noise = sigma_to_show_above(campaign)
        theory = campaign_estimability(campaign, self.model, self.approach, noise)
        return tuple(name for name in theory.not_estimable if name in names)

    def _vague(self, recursion: Recursion) -> tuple[str, ...]:
        """Parameters that are known less well than they are of any cheap sensor."""
        names = self.model.parameter_names
        sigma = np.sqrt(np.diag(recursion.cofactors[0]))[: len(names)]
        sizes = typical_sizes(self.model, len(names))
        return tuple(n for n, s, size in zip(names, sigma, sizes, strict=True) if s > size)


def _last_position(campaign: Campaign, assessed: Assessment | None) -> LastPosition | None:
    """Say of the last position what the assessment says of it."""
    last = campaign.n_positions - 1
    if last < 0:
        return None
    if assessed is None:
        return LastPosition(last, np.nan, conflict=False)
    conflict = any(suspect.position == last for suspect in assessed.suspects)
    return LastPosition(last, float(assessed.p_adjusted[last]), conflict)


def _noise_taken(
    recursion: Recursion, campaign: Campaign, trusted: bool, unit: float
) -> NoiseTaken:
    """Noise of a position by which the accuracy is judged."""
    stated, r = campaign.sigma_force, recursion.redundancy
    seen, taken = None, stated
    if recursion.solved[0] and r > 0:
        seen = unit * float(np.sqrt(recursion.omega[0] / r))
    refuted = stated is not None and not trusted
    if refuted:
        taken = seen
    elif stated is None:
        bound = float(np.sqrt(get_rule("bound")(recursion.omega, r)[0]))
        taken = unit * bound if np.isfinite(bound) else None
    return NoiseTaken(stated, seen, taken, refuted, r)


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
    roll, pitch = roll_pitch(tuple(f_b.T))
    return HoldConditions(
        temperature=goes_on(last.temperature, REFERENCE_TEMPERATURE),
        time=time,
        vibration=goes_on(last.vibration, 0.0),
        roll=roll,
        pitch=pitch,
        yaw=goes_on(last.yaw, 0.0),
        step_x=step[:, 0],
        step_y=step[:, 1],
        step_z=step[:, 2],
        order=time if campaign.time is not None else np.full(k, n + 1.0),
        course=campaign.hold.take(np.arange(n)).course if n else None,
        full_range=campaign.full_range,
    )


def next_rows(
    campaign: Campaign, model: SensorModel, approach: Approach, noise: Noise, directions: Array
) -> Array:
    """Rows of the design matrix of each of k attitudes as the next position, (k, c, u')."""
    f_b, hold = -campaign.gravity * directions, next_holds(campaign, directions)
    angles, errors = angles_of(f_b), angle_errors(campaign)
    sigma_angle, common = (noise.sigma_angle, None) if errors is None else errors(angles)
    observed = Observations(
        forces=f_b[None],  # of an ideal sensor, all of whose effects are zero
        sigma_force=noise.sigma_force,
        angles=angles[None],
        sigma_angle=sigma_angle,
        common=common,
        gravity=campaign.gravity,
        sigma_gravity=noise.sigma_gravity,
        hold=hold,
    )
    rows = whitened_jacobian(model, approach, observed, np.zeros(model.n_parameters))
    k, c = len(directions), approach.n_conditions
    return np.ascontiguousarray(rows[: c * k].reshape(c, k, -1).swapaxes(0, 1))
