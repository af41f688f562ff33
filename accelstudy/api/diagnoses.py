"""The result of `accelstudy.diagnose`."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes
from numpy.linalg import LinAlgError

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import say, show, stage, warn
from accelstudy.campaign.calibration.result import Calibration
from accelstudy.diagnosis.report import document
from accelstudy.diagnosis.report.figures import draw_explanations
from accelstudy.diagnosis.report.output import write_diagnosis
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import Diagnosis as Found
from accelstudy.drawing.style import COLUMN
from accelstudy.files.outputs import DIAGNOSIS
from accelstudy.pages.result import Result
from accelstudy.sensors.frames import FRD, axes_note


class Diagnosis(Result):
    """A diagnosis: which effects, seen in a campaign, a model lacks.

    Attributes
    ----------
    result : accelstudy.diagnosis.result.Diagnosis, all of it
    source : path of the campaign, for the commands that are suggested
    """

    kind = DIAGNOSIS

    def __init__(self, result: Found, source: Path | None = None) -> None:
        self.result, self.name = result, result.campaign.name
        self.source = Path("CAMPAIGN") if source is None else source
        self.size = COLUMN, 25.0 + 8 * len(result.credible_set)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of diagnosis.json."""
        return document.diagnosis_document(self.result)

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
            content = document.diagnosed_calibration(self.result)
            return Calibration(document.diagnosed_fit(self.result), content)
        except LinAlgError as error:
            raise InputError(f"the diagnosis gives no calibration: {error}") from None

    def draw(self, ax: Axes) -> None:
        """Draw the posterior probabilities of the explanations."""
        draw_explanations(ax, self.result.credible_set)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy diagnose` does."""
        with stage("figures and page"):
            write_diagnosis(self.result, folder, self.source, place)

    def tell(self, place: Path) -> None:
        """Print the verdict and what is said with it."""
        campaign = self.result.campaign
        for warning in campaign.warnings:
            warn(warning)
        if self.result.recognised is not None:
            warn(f"calibration.json is of mended data: {self.result.recognised.reason}")
        verdict, *lines = verdict_lines(self.result)
        show(verdict)
        for line in lines:
            say(line)
        if campaign.log is not None and campaign.log.frame != FRD.name:
            say(axes_note(campaign.log.frame))
        say(f"report: {place / 'report.html'}")
