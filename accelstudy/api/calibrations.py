"""Calibrations of a program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pandas as pd

from accelstudy.api.given import (
    IN_MEMORY,
    drawing,
    for_programs,
    of_type,
    path_of,
    python_words,
    quantity,
)
from accelstudy.api.logs import log_of
from accelstudy.approaches import get_approach
from accelstudy.basics.units import Given
from accelstudy.basics.wording import counted
from accelstudy.campaign.calibration.applying import read_calibration
from accelstudy.campaign.calibration.assessment import assess
from accelstudy.campaign.calibration.document import assessed_positions, json_text
from accelstudy.campaign.calibration.fit import CampaignFit, fit_campaign
from accelstudy.campaign.calibration.leveling import level_log
from accelstudy.campaign.calibration.output import (
    calibration_content,
    draw_residuals,
    write_calibration,
)
from accelstudy.campaign.session import Campaign
from accelstudy.drawing.style import FULL
from accelstudy.files.outputs import CALIBRATION, result_folder
from accelstudy.pages.notebook import notebook_html
from accelstudy.sensors.models import get_model

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SIGMA = Given("m/s^2", "", "Noise of a reading.")


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """A calibration of a campaign.

    Attributes
    ----------
    content : mapping, that of calibration.json
    fit : CampaignFit
    """

    content: Mapping[str, Any]
    fit: CampaignFit

    def __repr__(self) -> str:
        n = counted(self.content["n_positions"], "position")
        return f"Calibration({self.content['campaign']!r}, {n}, {self.verdict})"

    def _repr_html_(self) -> str:
        return notebook_html("Calibration", self.content["quality"]["verdict"], self.parameters)

    @property
    def verdict(self) -> str:
        """State of the calibration: accepted, rejected, cannot tell or implausible."""
        return str(self.content["quality"]["state"])

    @property
    def parameters(self) -> pd.DataFrame:
        """Value, standard deviation and unit of each parameter, SI."""
        rows = pd.DataFrame(self.content["parameters"])[["name", "value", "sigma", "unit"]]
        return rows.set_index("name")

    @for_programs
    def apply(self, log: Any, *, sigma: float | str | None = None) -> pd.DataFrame:
        """Level a log.

        Parameters
        ----------
        log : Log, or what `read_log` takes
        sigma : float in m/s² or str with a unit, of a reading; as within the holds of the campaign
            if omitted

        Returns
        -------
        DataFrame
            The columns of the log, the calibrated force in m/s², roll and pitch in the unit that
            the names say, and their sigmas. Warnings stand in ``attrs["warnings"]``.
        """
        log = log_of(log)
        reading = None if sigma is None else quantity("sigma", sigma, SIGMA)
        with TemporaryDirectory(prefix=IN_MEMORY) as folder:
            kept, out = Path(folder) / "calibration.json", Path(folder) / "leveled.parquet"
            kept.write_text(json_text(dict(self.content)), encoding="utf-8")
            leveled = level_log(read_calibration(kept), log.path, out, log.layout, reading)
            table = pd.read_parquet(out)
        table.attrs["warnings"] = list(map(python_words, leveled.warnings))
        return table

    @for_programs
    def save(self, folder: str | PathLike[str], *, force: bool = False) -> None:
        """Write what ``accelstudy calibrate`` writes into a folder."""
        path = path_of("folder", folder)
        with result_folder(path, CALIBRATION, force=force) as part:
            write_calibration(self.fit, part, place=path)
            (part / "calibration.json").write_text(json_text(dict(self.content)), encoding="utf-8")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw |f| − g of each position, mm/s²."""
        with drawing(ax, FULL, 62) as ax:
            draw_residuals(ax, self.fit, assessed_positions(assess(self.fit)))
        return ax


@for_programs
def calibrate(
    campaign: Campaign,
    *,
    model: str = "bias-scale-nonorthogonality",
    approach: str | None = None,
) -> Calibration:
    """Calibrate a campaign.

    Parameters
    ----------
    campaign : Campaign
    model : str, a name, a composition, or the path of a YAML file
    approach : str, optional, "gravity" or "robot"; with the robot, if the campaign has its angles

    Raises
    ------
    InputError
        If the campaign does not determine the model, or a name is unknown.
    """
    of_type("campaign", campaign, Campaign, expected="a Campaign, as find_holds returns")
    of_type("model", model, str, expected="the name of a model")
    if approach is not None:
        of_type("approach", approach, str, expected="the name of an approach")
    chosen = None if approach is None else get_approach(approach)
    fit = fit_campaign(campaign, get_model(model), chosen)
    return Calibration(calibration_content(fit, assess(fit)), fit)
