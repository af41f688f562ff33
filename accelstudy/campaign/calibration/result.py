"""The result of `accelstudy.calibrate`: a calibration, its tables, files and page."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

import accelstudy
from accelstudy.basics.arguments import quantity, to_python
from accelstudy.basics.arrays import CachedTable
from accelstudy.basics.errors import InputError
from accelstudy.basics.levels import MAX_TILT_GON, REFUTATION_LEVEL
from accelstudy.basics.progress import say, show, warn
from accelstudy.basics.suggestions import HERE
from accelstudy.basics.units import GON, InputQuantity
from accelstudy.campaign.calibration import wording
from accelstudy.campaign.calibration.campaign_fit import CampaignFit
from accelstudy.campaign.calibration.document import assessed_positions, calibration_document
from accelstudy.campaign.calibration.figures import (
    correlation_figure,
    draw_residuals,
    residual_figure,
)
from accelstudy.campaign.calibration.file_format import CalibrationDocument
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.drawing.saving import save_all
from accelstudy.files.outputs import CALIBRATION
from accelstudy.files.tables import write_table
from accelstudy.pages import write_page
from accelstudy.pages.result import Result
from accelstudy.sensors.frames import axes_note

TILT = InputQuantity("rad", 1e-3, np.pi / 2)
LEVEL = InputQuantity("1", -np.inf, bare=True)
MAX_ROWS = 200
"""Positions up to which the page lists all of them; of more, those that fit worst."""


class Calibration(Result):
    """A calibration of a campaign.

    Attributes
    ----------
    fit : CampaignFit, the adjustment; None of a calibration that was read from a file
    content : mapping, that of calibration.json
    source : path of the campaign, for the commands that are suggested
    """

    kind = CALIBRATION

    def __init__(
        self,
        fit: CampaignFit | None,
        content: Mapping[str, Any] | None = None,
        source: Path | None = None,
    ) -> None:
        self.fit, self.source = fit, Path("CAMPAIGN") if source is None else source
        if content is None:
            content = calibration_document(self._fitted("content"))
        self._content = content
        self.name = str(content["campaign"])

    @property
    def content(self) -> Mapping[str, Any]:
        """Content of calibration.json."""
        return self._content

    @property
    def state(self) -> str:
        """State: accepted, rejected, cannot tell or implausible."""
        return str(self.content["quality"]["state"])

    @property
    def verdict(self) -> str:
        """Verdict in sentences."""
        return str(self.content["quality"]["verdict"])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings of the campaign and of the calibration."""
        return (*self.content["warnings"], *self.content["quality"]["warnings"])

    @property
    def parameters(self) -> pd.DataFrame:
        """Value, standard deviation and unit of each parameter, SI."""
        rows = pd.DataFrame(self.content["parameters"])[["name", "value", "sigma", "unit"]]
        return rows.set_index("name")

    @property
    def covariance(self) -> pd.DataFrame:
        """Covariance matrix of the parameters, SI."""
        return self._matrix("covariance")

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlation matrix of the parameters."""
        return self._matrix("correlation")

    @cached_property
    def sensor(self) -> SensorCalibration:
        """The calibration as it stays with the sensor: it levels readings, and is compared."""
        document = CalibrationDocument.check(self.content)
        return SensorCalibration.of(document, CalibrationDocument.refusal())

    def _matrix(self, key: str) -> pd.DataFrame:
        names = self.parameters.index
        values = np.array(self.content[key], dtype=float)  # None becomes NaN
        return pd.DataFrame(values, index=names, columns=names)

    def intervals(self, level: float | str = 0.95) -> pd.DataFrame:
        """Return the interval of each parameter that holds it with a probability, SI.

        It is that of the normal distribution where the noise is known, and of Student's t where it
        was estimated, from the residuals or from the samples within the holds.

        Parameters
        ----------
        level : float or str, between 0 and 1, as 0.95 or 95%

        Returns
        -------
        DataFrame
            Columns low, high and unit.
        """
        from scipy import stats

        level = quantity("level", to_python(level), LEVEL)
        if not 0 < level < 1:
            raise InputError(f"level: expected a probability between 0 and 1, not {level:g}")
        half = stats.t.ppf((1 + level) / 2, self.sensor.dof) * self.parameters["sigma"]
        value, unit = self.parameters["value"], self.parameters["unit"]
        return pd.DataFrame({"low": value - half, "high": value + half, "unit": unit})

    @CachedTable
    def residuals(self) -> pd.DataFrame:
        """Residuals, tests and reliability of each position, as positions.parquet has them."""
        return assessed_positions(self._fitted("residuals"))

    def tilt_error(self, tilt_range: float | str = MAX_TILT_GON * GON) -> pd.Series:
        """Return the rms tilt error that the calibration leaves, rad, of roll and of pitch.

        It comes from the uncertainty of the parameters and from what the residuals show that the
        model lacks, over all attitudes up to a tilt, without the noise of a reading.

        Parameters
        ----------
        tilt_range : float in rad or str with a unit, largest tilt
        """
        left = self._fitted("tilt_error").tilt_budget(quantity("tilt_range", tilt_range, TILT))
        return pd.Series(left.total, index=["roll", "pitch"], name="tilt_error_rad")

    def _fitted(self, what: str) -> CampaignFit:
        if self.fit is None:
            raise InputError(
                f"{what}: a calibration that was read from a file has none; calibrate its campaign"
            )
        return self.fit

    def apply(
        self, log: Any, *, start: float | str | None = None, sigma: float | str | None = None
    ) -> pd.DataFrame:
        """Level a log; see `accelstudy.apply`, which takes more keywords.

        Parameters
        ----------
        log : Log, or what `read_log` takes
        start : float in s or str with a unit, from the start of the calibration session
        sigma : float in m/s² or str with a unit, of a reading
        """
        return accelstudy.apply(self, log, start=start, sigma=sigma)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters, as `parameters`."""
        return self.parameters

    def draw(self, ax: Axes) -> None:
        """Draw |f| − g of each position, mm/s²."""
        draw_residuals(ax, self._fitted("plot"), self.residuals)

    def _table(self) -> str:
        """Parameters with sigmas in the units that people read, then what the user should know."""
        warnings = (f"warning: {one}" for one in self.warnings)
        return "\n".join([*wording.parameter_lines(self.content), *warnings])

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy calibrate` does; calibration.json alone where there is no fit.

        Each file is whole or not there; calibration.json comes last. If the page fails, the numbers
        are written all the same.
        """
        if self.fit is not None:
            self._write_page(self.fit, folder, place)
        CalibrationDocument.write(folder, self.content)

    def _write_page(self, fit: CampaignFit, folder: Path, place: Path) -> None:
        """Write positions.parquet, figures/ and report.html."""
        positions, lines = self.residuals, wording.sentences(fit)
        drawn = save_all(
            {
                "residuals": lambda: residual_figure(fit, positions),
                "correlations": lambda: correlation_figure(fit),
            },
            folder / "figures",
        )
        write_table(folder / "positions.parquet", positions)
        worst = positions.sort_values(
            ["suspect", "p_value"], ascending=[False, True], kind="stable"
        )
        write_page(
            folder / "report.html",
            "campaign/calibration/report.html.j2",
            " ".join(lines),
            doc=self.content,
            quality=self.content["quality"],
            lines=lines,
            angles_unused=fit.campaign.angles is not None and not fit.approach.uses_angles,
            positions=worst.head(MAX_ROWS).sort_index().to_dict("records"),
            refuted=REFUTATION_LEVEL,
            figures=drawn,
            next_steps=wording.next_steps(fit, self.source, place / HERE),
        )

    def tell(self, place: Path) -> None:
        """Print the parameters, the verdict and what to do next."""
        fit = self._fitted("tell")
        for warning in fit.campaign.warnings:
            warn(warning)
        say("\n".join(wording.parameter_lines(self.content)))
        if self.content["sigmas_95"] is not None:
            say(f"±: {wording.sentences(fit, 'sigmas')[0]}")
        say(wording.sentences(fit, "approach")[0])
        say(axes_note(None if (log := fit.campaign.header.log) is None else log.frame))
        show(f"{self.state.upper()}: {self.verdict}")
        steps = wording.next_steps(fit, self.source, place / HERE)
        say(": ".join(steps[0]))
        say(f"report: {place / 'report.html'}")
