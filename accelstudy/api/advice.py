"""The result of `accelstudy.advise`: advice in a running session."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from accelstudy.api.inputs import as_campaign, campaign_path
from accelstudy.approaches import Approach, get_approach
from accelstudy.basics import suggestions
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import IMPLAUSIBLE, REJECTED
from accelstudy.basics.progress import show, warn
from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.campaign.calibration.document import write_json
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.calibration.sensor_calibration import sensor_of
from accelstudy.campaign.sensor_type import SensorType, read_type
from accelstudy.campaign.session import Campaign
from accelstudy.files.outputs import ADVICE
from accelstudy.leveling.angles import angles_of
from accelstudy.pages.result import Result
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential import wording
from accelstudy.sequential.advisor import Advice, advise
from accelstudy.sequential.choice import DEFAULTS, candidate_positions
from accelstudy.sequential.prior import Prior
from accelstudy.sequential.promise import Promise
from accelstudy.sequential.running import read_running

TYPES = (".yaml", ".yml")
"""Endings of a file that describes a type of sensors."""


class SessionAdvice(Result):
    """What to do next in a session.

    Attributes
    ----------
    advice : accelstudy.sequential.advisor.Advice, all of it
    session : Campaign, so far
    model, approach, promise : by which it is judged
    command : str, that calibrates the session if it is enough; else empty
    """

    kind = ADVICE

    def __init__(
        self,
        advice: Advice,
        session: Campaign,
        model: SensorModel,
        approach: Approach,
        promise: Promise,
        command: str,
    ) -> None:
        self.advice, self.session, self.model = advice, session, model
        self.approach, self.promise, self.name = approach, promise, session.name
        self.command = command if advice.enough else ""

    @classmethod
    def of(
        cls,
        campaign: Any,
        *,
        tilt_accuracy: float,
        tilt_range: float,
        model: str,
        approach: str | None,
        prior: Path | None,
        attitudes: str | None,
        **limits: float | None,
    ) -> SessionAdvice:
        """Advise by the keywords of `accelstudy.advise`, checked."""
        place = campaign_path(campaign)
        session = as_campaign(campaign) if place is None else read_running(place)
        by = get_approach(approach) if approach else usual_approach(session)
        known, promise = get_model(model), Promise(tilt_accuracy, tilt_range)
        directions = candidate_positions(attitudes or DEFAULTS.get(by.name, "grid"), **limits)
        advice = advise(session, known, by, promise, directions, _prior(prior, known))
        of_type = prior if prior is not None and prior.suffix in TYPES else None
        command = suggestions.calibrate(place or "CAMPAIGN", model, by.name, of_type)
        return cls(advice, session, known, by, promise, command)

    @property
    def enough(self) -> bool:
        """Whether the accuracy is reached."""
        return self.advice.enough

    @property
    def state(self) -> str:
        """State in a word: enough, not yet, or rejected or implausible as the calibration."""
        wrong = self.advice.state in (REJECTED, IMPLAUSIBLE)
        return "enough" if self.enough else self.advice.state if wrong else "not yet"

    @property
    def verdict(self) -> str:
        """How far it is to the accuracy that is wanted, in a sentence."""
        return self.lines[-1]

    @cached_property
    def lines(self) -> list[str]:
        """The advice, most important last."""
        return wording.advice_lines(self.advice, self.session, self.model, self.promise)

    @property
    def content(self) -> dict[str, Any]:
        """Content of advice.json, in SI."""
        advice = self.advice
        return {
            "campaign": self.name,
            "state": self.state,
            "verdict": self.verdict,
            "advice": self.lines,
            "positions": advice.positions,
            "in_conflict": advice.suspects,
            "undetermined": advice.undetermined,
            "vague": advice.vague,
            "to_go": advice.to_go,
            "tilt": self.to_frame().reset_index().to_dict("records"),
            "command": self.command,
        }

    def to_frame(self) -> pd.DataFrame:
        """Return roll and pitch: those of the next position, their rms error now, and as wanted."""
        rows = {
            "next_rad": angles_of(-self.advice.next),
            "rms_rad": np.nan if self.advice.rms is None else self.advice.rms,
            "wanted_rad": self.promise.accuracy,
        }
        return pd.DataFrame(rows, index=pd.Index(["roll", "pitch"], name="angle"))

    def draw(self, ax: Axes) -> None:
        """Draw roll and pitch of the positions so far, and of the next one."""
        so_far, after = (
            to_attitude(angles_of(forces)).T for forces in (self.session.forces, -self.advice.next)
        )
        ax.plot(*so_far, "o", label="so far")
        ax.plot(*after, "*", markersize=10, label="next")
        ax.set(xlabel=f"roll / {attitude_unit()}", ylabel=f"pitch / {attitude_unit()}")
        ax.legend()

    def write(self, folder: Path, place: Path) -> None:
        """Write advice.json."""
        write_json(folder / ADVICE.marker, self.content)

    def tell(self, place: Path | None) -> None:
        """Print the advice, and what was odd in the table so far."""
        for warning in self.session.warnings:
            warn(warning)
        show(self.summary())

    def summary(self) -> str:
        """Return the advice as text."""
        more = [f"calibrate: {self.command}"] if self.command else []
        heading = wording.heading(self.advice, self.session, self.model, self.approach.name)
        return "\n".join([heading, *(f"  {line}" for line in (*self.lines, *more))])


def _prior(given: Path | None, wanted: SensorModel) -> Prior | SensorType | None:
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
