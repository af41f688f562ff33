"""Diagnoses of a program."""

from __future__ import annotations

from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from numpy.linalg import LinAlgError

from accelstudy.api.calibrations import Calibration, resolve
from accelstudy.api.given import drawing, for_programs, whole
from accelstudy.api.results import Result
from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.loop import REPLICATES, Loop, close_loop
from accelstudy.diagnosis.pipeline import diagnose as diagnosed
from accelstudy.diagnosis.report.document import (
    diagnosed_calibration,
    diagnosed_fit,
    diagnosis_document,
)
from accelstudy.diagnosis.report.figures import draw_explanations
from accelstudy.diagnosis.report.output import write_diagnosis
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import Diagnosis as Found
from accelstudy.drawing.style import COLUMN
from accelstudy.files.outputs import DIAGNOSIS
from accelstudy.sensors.models import NINE

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SESSIONS = Range(100, 10**9)


class Diagnosis(Result):
    """What a campaign says that a model lacks.

    Attributes
    ----------
    result : accelstudy.diagnosis.result.Diagnosis, all of it
    """

    kind = DIAGNOSIS

    def __init__(self, result: Found, seed: int, replicates: int) -> None:
        self.result, self._seed, self._replicates = result, seed, replicates

    @property
    def name(self) -> str:
        """Name of the campaign."""
        return self.result.campaign.name

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of diagnosis.json, without the simulated sessions."""
        return diagnosis_document(self.result)

    @property
    def state(self) -> str:
        """One of no_effect, named, narrowed, learned, unknown, noise_model, gross_error."""
        return self.result.verdict

    @property
    def verdict(self) -> str:
        """What was found, in sentences."""
        return " ".join(verdict_lines(self.result))

    @property
    def explanations(self) -> pd.DataFrame:
        """What may be missing, and its posterior probability, most probable first."""
        rows = [(" with ".join(one.names), one.posterior) for one in self.result.credible_set]
        return pd.DataFrame(rows, columns=["explanation", "posterior"])

    def to_frame(self) -> pd.DataFrame:
        """Return the explanations."""
        return self.explanations

    @cached_property
    def calibration(self) -> Calibration:
        """The calibration with what was found; raises `InputError` if there can be none."""
        try:
            return Calibration(diagnosed_calibration(self.result), diagnosed_fit(self.result))
        except LinAlgError as error:
            raise InputError(f"the diagnosis gives no calibration: {error}") from None

    @cached_property
    def loop(self) -> Loop | None:
        """Sessions simulated with the old and with the new model; None if nothing was added."""
        return close_loop(self.result, self._replicates, self._seed)

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the posterior probabilities of the explanations."""
        explanations = self.result.credible_set
        with drawing(ax, COLUMN, 25 + 8 * len(explanations)) as ax:
            draw_explanations(ax, explanations)
        return ax

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy diagnose` does."""
        write_diagnosis(self.result, folder, self.loop, place=place)


@for_programs
def diagnose(
    campaign: Campaign | str | PathLike[str],
    *,
    model: str = NINE,
    approach: str | None = None,
    prior: str | PathLike[str] | None = None,
    seed: int = 1,
    replicates: int = REPLICATES,
) -> Diagnosis:
    """Find what a sensor model lacks to explain a campaign.

    Parameters
    ----------
    campaign : Campaign, or the path of its folder
    model, prior : as in `calibrate`
    approach : str, optional; with the robot, if the campaign has its angles
    seed : int
    replicates : int
        Sessions simulated with either model, when they are resolve for; fewer beyond 500 positions.

    Raises
    ------
    InputError
        If the campaign does not determine the model, or a name is unknown.
    """
    whole("seed", seed, bounds.SEED)
    whole("replicates", replicates, SESSIONS)
    # The diagnosis, not the reader, looks for wrong units and axes.
    given = resolve(campaign, model, approach, prior, plausible=False)
    return Diagnosis(diagnosed(*given, seed=seed), seed, replicates)
