"""Diagnoses of a program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import pandas as pd
from numpy.linalg import LinAlgError

from accelstudy.api.calibrations import Calibration
from accelstudy.api.given import drawing, for_programs, of_type, whole
from accelstudy.approaches import get_approach
from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.pipeline import diagnose as diagnosed
from accelstudy.diagnosis.report.document import diagnosed_calibration, diagnosed_fit
from accelstudy.diagnosis.report.figures import draw_explanations
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import Diagnosis as Result
from accelstudy.drawing.style import COLUMN
from accelstudy.pages.notebook import notebook_html
from accelstudy.sensors.models import get_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis:
    """What a campaign says that a model lacks.

    Attributes
    ----------
    result : accelstudy.diagnosis.result.Diagnosis, all of it
    """

    result: Result

    def __repr__(self) -> str:
        return f"Diagnosis({self.result.campaign.name!r}, {self.verdict})"

    def _repr_html_(self) -> str:
        return notebook_html("Diagnosis", " ".join(verdict_lines(self.result)), self.explanations)

    @property
    def verdict(self) -> str:
        """One of no_effect, named, narrowed, learned, unknown, noise_model, gross_error."""
        return str(self.result.verdict)

    @property
    def explanations(self) -> pd.DataFrame:
        """What may be missing, and its posterior probability, most probable first."""
        rows = [(" with ".join(one.names), one.posterior) for one in self.result.credible_set]
        return pd.DataFrame(rows, columns=["explanation", "posterior"])

    @cached_property
    def calibration(self) -> Calibration:
        """The calibration with what was found; raises `InputError` if there can be none."""
        try:
            return Calibration(diagnosed_calibration(self.result), diagnosed_fit(self.result))
        except LinAlgError as error:
            raise InputError(f"the diagnosis gives no calibration: {error}") from None

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the posterior probabilities of the explanations."""
        explanations = self.result.credible_set
        with drawing(ax, COLUMN, 25 + 8 * len(explanations)) as ax:
            draw_explanations(ax, explanations)
        return ax


@for_programs
def diagnose(
    campaign: Campaign,
    *,
    model: str = "bias-scale-nonorthogonality",
    approach: str | None = None,
    seed: int = 1,
) -> Diagnosis:
    """Find what a sensor model lacks to explain a campaign.

    Parameters
    ----------
    campaign : Campaign
    model : str, as in `calibrate`
    approach : str, optional; with the robot, if the campaign has its angles
    seed : int

    Raises
    ------
    InputError
        If the campaign does not determine the model, or a name is unknown.
    """
    of_type("campaign", campaign, Campaign, expected="a Campaign, as find_holds returns")
    of_type("model", model, str, expected="the name of a model")
    whole("seed", seed, bounds.SEED)
    if approach is not None:
        of_type("approach", approach, str, expected="the name of an approach")
    chosen = None if approach is None else get_approach(approach)
    return Diagnosis(diagnosed(campaign, get_model(model), chosen, seed=seed))
