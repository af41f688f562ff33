"""Advice in a running session."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.api.calibrations import as_calibration
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import IMPLAUSIBLE, REJECTED
from accelstudy.basics.suggested import calibrate
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.of_type import SensorType, read_type
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.advisor import Advice, advise
from accelstudy.sequential.choice import DEFAULTS, candidates
from accelstudy.sequential.estimate import NOTHING_KNOWN, Prior
from accelstudy.sequential.promise import Promise
from accelstudy.sequential.wording import heading, lines

TYPES = (".yaml", ".yml")
"""Endings of files of a type."""


@dataclass(frozen=True, eq=False, repr=False)
class SessionAdvice:
    """What to do next in a session.

    Attributes
    ----------
    advice : accelstudy.sequential.advisor.Advice, all of it
    heading : str, what was advised on
    lines : list of str, the advice, most important last
    command : str, that calibrates the session if it is enough; else empty
    """

    advice: Advice
    heading: str
    lines: list[str]
    command: str

    @property
    def enough(self) -> bool:
        """Whether the accuracy is reached."""
        return self.advice.enough

    @property
    def state(self) -> str:
        """State in a word: enough, not yet, or rejected or implausible as the calibration."""
        if self.enough:
            return "enough"
        wrong = self.advice.state in (REJECTED, IMPLAUSIBLE)
        return self.advice.state if wrong else "not yet"

    @property
    def verdict(self) -> str:
        """How far it is to the accuracy that is wanted, in a sentence."""
        return self.lines[-1]

    def summary(self) -> str:
        """Return the advice as text."""
        more = [f"calibrate: {self.command}"] if self.command else []
        return "\n".join([self.heading, *(f"  {line}" for line in (*self.lines, *more))])

    def __repr__(self) -> str:
        return f"SessionAdvice({self.heading!r}, {self.state})"


class Adviser:
    """Advises on a session, whatever its positions are so far.

    Parameters
    ----------
    session : Campaign, as it is now
    place : Path, optional, of its folder
    model, approach, prior, attitudes, limits : keywords of `advise`, checked
    """

    def __init__(
        self,
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
    ) -> None:
        self.place, self.promise = place, Promise(tilt_accuracy, tilt_range)
        self.approach: Approach = (
            usual_approach(session) if approach is None else get_approach(approach)
        )
        self.model, self._called = get_model(model), model
        chosen = attitudes or DEFAULTS.get(self.approach.name, "grid")
        self.directions = candidates(chosen, **limits)
        self.prior = _prior(prior, self.model)
        self.type = prior if prior is not None and prior.suffix in TYPES else None

    def __call__(self, session: Campaign) -> SessionAdvice:
        """Advise on the session as it is now."""
        known = self.model, self.approach, self.promise, self.directions, self.prior
        advice = advise(session, *known)
        command = ""
        if advice.enough:
            place, approach = self.place or Path("CAMPAIGN"), self.approach.name
            command = calibrate(place, self._called, approach, self.type)
        return SessionAdvice(
            advice,
            heading(advice, session, self.model, self.approach.name),
            lines(advice, session, self.model, self.promise),
            command,
        )


def _prior(given: Any, wanted: SensorModel) -> Prior | SensorType:
    """What an earlier calibration, or a type, says; nothing without one."""
    if given is None:
        return NOTHING_KNOWN
    if given.suffix in TYPES:
        return read_type(given, wanted)
    earlier = as_calibration(given).sensor
    if earlier.model.parameter_names != wanted.parameter_names:
        raise InputError(
            f"{given}: calibrates {', '.join(earlier.model.parameter_names)}, but the model "
            f"{wanted.name!r} has {', '.join(wanted.parameter_names)}"
        )
    if not np.isfinite(earlier.covariance).all():
        raise InputError(f"{given}: does not say how well its parameters are known")
    return Prior.of_covariance(earlier.parameters, earlier.covariance)
