"""Diagnoses of a program."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import pandas as pd

from accelstudy.api.calibrations import Calibration
from accelstudy.api.given import axes_of, of_type, table_html
from accelstudy.approaches import get_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.pipeline import diagnose as diagnosed
from accelstudy.diagnosis.report.document import diagnosed_calibration, diagnosed_fit
from accelstudy.diagnosis.report.figures import draw_explanations
from accelstudy.diagnosis.report.words import verdict_lines
from accelstudy.diagnosis.result import Diagnosis as Result
from accelstudy.sensors.models import get_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, repr=False)
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
        return table_html("Diagnosis", " ".join(verdict_lines(self.result)), self.explanations)

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
        return Calibration(diagnosed_calibration(self.result), diagnosed_fit(self.result))

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the posterior probabilities of the explanations."""
        ax = axes_of(ax)
        draw_explanations(ax, self.result.credible_set)
        return ax


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
    chosen = None if approach is None else get_approach(approach)
    return Diagnosis(diagnosed(campaign, get_model(model), chosen, seed=seed))
