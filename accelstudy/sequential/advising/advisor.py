"""Advice in a running session."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import (
    campaign_noise,
    campaign_observations,
    check_campaign,
    initial_values,
)
from accelstudy.campaign.files.session import Campaign
from accelstudy.design.estimability import is_blind
from accelstudy.leveling.error import TiltError
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.advising.advice import Advice, Agreement, NextPosition, NoiseTaken
from accelstudy.sequential.advising.conditions import next_holds, next_rows
from accelstudy.sequential.advising.screening import Screening
from accelstudy.sequential.choice.chooser import Chooser
from accelstudy.sequential.choice.choosing import typical_sizes
from accelstudy.sequential.choice.forecast import positions_to_go
from accelstudy.sequential.choice.promise import Promise
from accelstudy.sequential.choice.stopping import LEAST_REDUNDANCY, get_rule
from accelstudy.sequential.estimation.prior import NOTHING_KNOWN, Prior

Array = NDArray[np.float64]

TOLD = 0.5
"""Ratio of sigma to the typical size of a parameter, up to which it counts as known at all."""
CONDITIONS = {"time", "temperature", "vibration"}
"""Columns of the holds that change by themselves from position to position."""


@dataclass
class Advisor:
    """Advice for a session that is being measured.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    promise : Promise
    directions : (k, 3) array, attitudes to choose from
    prior : Prior, optional
    """

    model: SensorModel
    approach: Approach
    promise: Promise
    directions: Array
    prior: Prior = NOTHING_KNOWN

    def __post_init__(self) -> None:
        self._screening: Screening | None = None

    def restart(self) -> None:
        """Forget all positions, because they have changed."""
        self._screening = None

    def check(self, campaign: Campaign) -> None:
        """Raise `InputError` where no number of positions would be enough."""
        if campaign.n_positions:
            check_campaign(campaign, self.model, self.approach)
        elif self.approach.uses_angles and campaign.angles is None:
            raise InputError(
                f"{campaign.name}: approach {self.approach.name!r} needs the block `robot` in the "
                "header"
            )
        noise, known = campaign_noise(campaign), self.prior is not NOTHING_KNOWN
        if not known and is_blind(self.model, self.approach, noise, campaign.gravity):
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
        if self._screening is None or not self._screening.recursion.solved[0]:
            initial = None
            if self.prior is NOTHING_KNOWN and campaign.n_positions:
                initial = initial_values(self.model, campaign.forces, campaign.gravity)
            known = campaign.sigma_force is not None
            self._screening = Screening(
                self.model, self.approach, observed, known, self.prior, initial
            )
        else:
            self._screening.add(observed)
        return self._advice(campaign, self._screening)

    def _advice(self, campaign: Campaign, screening: Screening) -> Advice:
        recursion, noise = screening.recursion, campaign_noise(campaign)
        solved = bool(recursion.solved[0])
        trusted = screening.sigma_known and not screening.refuted
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
        if solved:
            rms = chooser.rms(root, recursion.omega, recursion.redundancy)
        told = bool(np.isfinite(rms).all())
        enough = bool(self.promise.reached(rms)[0])

        last, repeats = None, None
        if campaign.n_positions:
            last = -campaign.forces[-1] / np.linalg.norm(campaign.forces[-1])
        latest = screening.last
        if latest is not None and latest.agreement is Agreement.CONFLICT and not latest.repeats:
            repeats = int(campaign.positions[latest.index])
        # The conditions of later positions are unknown.
        to_go, varying = None, bool(CONDITIONS & {*self.model.hold_columns})
        told_noise = trusted or recursion.redundancy >= LEAST_REDUNDANCY
        if not enough and told_noise and not varying:
            r = recursion.redundancy
            variance = 1.0 if trusted else float(recursion.omega[0]) / r
            to_go = positions_to_go(chooser, root[0], variance, r, rms[0], last)
        if repeats is None or last is None:
            before = None if last is None else last[None]
            best = chooser.directions[chooser.choose(root, recursion.solved, rms, before)[0]]
        else:
            best = last
        return Advice(
            positions=campaign.positions,
            last=latest,
            set_aside=tuple(int(campaign.positions[i]) for i in screening.aside),
            undetermined=self._undetermined(root[0], solved),
            vague=self._vague(screening) if solved else (),
            noise=_noise_taken(screening, campaign.sigma_force, noise.sigma_force),
            rms=rms[0] if told else None,
            next=NextPosition(best, repeats),
            to_go=to_go,
            foreseeable=told_noise and not varying,
            enough=enough,
        )

    def _tilt_error(self, campaign: Campaign, parameters: Array | None) -> TiltError:
        hold = campaign.hold if campaign.n_positions else next_holds(campaign, np.eye(3)[2:])
        own = None if parameters is None else parameters[: self.model.n_parameters]
        return self.promise.tilt_error(self.model, own, campaign.gravity, hold)

    def _undetermined(self, root: Array, solved: bool) -> tuple[str, ...]:
        """Parameters that the positions do not determine better than their typical size."""
        if solved:
            return ()
        names, sizes = self.model.parameter_names, typical_sizes(self.model, len(root))
        known = np.linalg.inv(root.T @ root + np.diag(sizes**-2))
        sigma = np.sqrt(np.diag(known))[: len(names)]
        return tuple(n for n, s, z in zip(names, sigma, sizes, strict=False) if s > TOLD * z)

    def _vague(self, screening: Screening) -> tuple[str, ...]:
        """Parameters that are known less well than they are of any cheap sensor."""
        names = self.model.parameter_names
        sigma = np.sqrt(np.diag(screening.recursion.cofactors[0]))[: len(names)]
        sizes = typical_sizes(self.model, len(names))
        return tuple(n for n, s, size in zip(names, sigma, sizes, strict=True) if s > size)


def _noise_taken(screening: Screening, stated: float | None, unit: float) -> NoiseTaken:
    """Noise of a position by which the accuracy is judged."""
    recursion, refuted = screening.recursion, screening.refuted
    r, seen, taken = recursion.redundancy, None, stated
    if recursion.solved[0] and r > 0:
        seen = unit * float(np.sqrt(recursion.omega[0] / r))
    if stated is None or refuted:
        bound = float(np.sqrt(get_rule("bound")(recursion.omega, r)[0]))
        taken = unit * bound if np.isfinite(bound) else None
    return NoiseTaken(stated, seen, taken, refuted, r)
