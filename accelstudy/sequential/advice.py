"""What to do next in a session: the result of `accelstudy.advise`."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.levels import IMPLAUSIBLE, REJECTED
from accelstudy.basics.progress import show, warn
from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.campaign.session import Campaign
from accelstudy.files.documents import Document, Part
from accelstudy.files.outputs import ADVICE
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.attitudes import attitude
from accelstudy.pages import render_lines
from accelstudy.pages.result import Result
from accelstudy.sensors.frames import FRD
from accelstudy.sensors.sensor import SensorModel
from accelstudy.sequential.promise import LEAST_REDUNDANCY, Promise

if TYPE_CHECKING:
    from matplotlib.axes import Axes


SENTENCES = "sequential/wording.txt.j2"


class AngleAdvice(Part):
    """Roll, or pitch.

    Attributes
    ----------
    angle : which of them
    next_rad : that of the position to take next
    rms_rad : error that is left; null as long as it is unknown
    wanted_rad : accuracy that is wanted
    """

    angle: Literal["roll", "pitch"]
    next_rad: float
    rms_rad: float | None
    wanted_rad: float


class AdviceDocument(Document):
    """What to do next in a session; `save` of `accelstudy.advise` writes it.

    Attributes
    ----------
    campaign : name of the session
    state : whether it is enough, or as that of the calibration so far
    verdict : the last line of the advice
    advice : all lines
    positions : numbers of the positions so far
    in_conflict : numbers of those that contradict the others
    undetermined : parameters that are not determined yet
    to_go : positions that are still needed; null if unknown
    tilt : of roll and of pitch
    command : that calibrates the session; empty unless it is enough
    """

    file = "advice.json"
    campaign: str
    state: Literal["enough", "not yet", "rejected", "implausible"]
    verdict: str
    advice: list[str]
    positions: list[int]
    in_conflict: list[int]
    undetermined: list[str]
    to_go: int | None
    tilt: list[AngleAdvice]
    command: str


@dataclass(frozen=True, eq=False, repr=False)
class Advice(Result):
    """What to do next in a session.

    Attributes
    ----------
    session : Campaign, so far
    model, approach, promise : by which it is judged
    p_last : float, of the last position by all others, adjusted for the number of positions, as in
        the report of a calibration; NaN where they cannot test it
    in_conflict : tuple of int, numbers of positions that contradict the others; they are used
    calibration_state : str, state of a calibration with these positions; empty if there is none yet
    undetermined : tuple of str, parameters that the positions do not determine yet
    sigma_seen : float or None, m/s², noise of a position by the residuals; None without redundancy
    sigma_taken : float or None, m/s², by which the accuracy is judged; None as long as it is
        unknown. It is the stated one if that is known, an upper confidence bound if it is an
        estimate, and that of the residuals if these refute it.
    redundancy : int
    rms : (2,) array, rad, of roll and of pitch; None as long as it is not known
    next : (3,) array, direction of gravity in the body frame in the position to take next
    to_go : int or None, positions still needed; None if unknown or too many
    foreseeable : bool, whether `to_go` can be known
    enough : bool, whether the promise is kept, by a calibration that is not rejected
    command : str, that calibrates the session if it is enough; else empty
    """

    kind, document = ADVICE, AdviceDocument

    session: Campaign
    model: SensorModel
    approach: Approach
    promise: Promise
    p_last: float
    in_conflict: tuple[int, ...]
    calibration_state: str
    undetermined: tuple[str, ...]
    sigma_seen: float | None
    sigma_taken: float | None
    redundancy: int
    rms: Array | None
    next: Array
    to_go: int | None
    foreseeable: bool
    enough: bool
    command: str = ""

    @property
    def campaign(self) -> str:
        """Name of the session."""
        return self.session.name

    name = campaign

    @property
    def positions(self) -> NDArray[np.int_]:
        """Numbers of the positions so far, (n,), without those that the campaign leaves out."""
        return self.session.positions

    @property
    def repeats(self) -> int | None:
        """Number of the last position, if it contradicts the others, so that it is taken again."""
        last = int(self.positions[-1]) if len(self.positions) else None
        return last if last in self.in_conflict else None

    @property
    def state(self) -> str:
        """State in a word: enough, not yet, or rejected or implausible as the calibration."""
        wrong = self.calibration_state in (REJECTED, IMPLAUSIBLE)
        return "enough" if self.enough else self.calibration_state if wrong else "not yet"

    @property
    def verdict(self) -> str:
        """How far it is to the accuracy that is wanted, in a sentence."""
        return self.advice[-1]

    @cached_property
    def advice(self) -> list[str]:
        """All lines of the advice, most important last."""
        log = self.session.header.log
        there = attitude(self.next, FRD if log is None else log.axes)
        return render_lines(SENTENCES, "lines", self, there, LEAST_REDUNDANCY)

    @property
    def tilt(self) -> pd.DataFrame:
        """Roll and pitch: those of the next position, their rms error now, and as wanted."""
        rows = {
            "next_rad": angles_of(-self.next),
            "rms_rad": np.nan if self.rms is None else self.rms,
            "wanted_rad": self.promise.accuracy,
        }
        return pd.DataFrame(rows, index=pd.Index(["roll", "pitch"], name="angle"))

    def to_frame(self) -> pd.DataFrame:
        """Return roll and pitch, as `tilt`."""
        return self.tilt

    def draw(self, ax: Axes) -> None:
        """Draw roll and pitch of the positions so far, and of the next one."""
        so_far, after = (
            to_attitude(angles_of(forces)).T for forces in (self.session.forces, -self.next)
        )
        ax.plot(*so_far, "o", label="so far")
        ax.plot(*after, "*", markersize=10, label="next")
        ax.set(xlabel=f"roll / {attitude_unit()}", ylabel=f"pitch / {attitude_unit()}")
        ax.legend()

    def tell(self, place: Path | None) -> None:
        """Print the advice, and what was odd in the table so far."""
        for warning in self.session.warnings:
            warn(warning)
        show(self.summary())

    def summary(self) -> str:
        """Return the advice as text."""
        more = [f"calibrate: {self.command}"] if self.command else []
        (heading,) = render_lines(SENTENCES, "heading", self)
        return "\n".join([heading, *(f"  {line}" for line in (*self.advice, *more))])
