"""Three or more calibrations of one sensor over time: what drifts, and what scatters."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from numpy.typing import NDArray

from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.units import GON, MGON, to_display
from accelstudy.basics.wording import plural
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.drawing.style import FULL, group_colour, group_of
from accelstudy.epochs.calibrations import (
    STATES,
    Calibrations,
    change_text,
    largest_texts,
    size_text,
)
from accelstudy.epochs.congruence import LEVEL
from accelstudy.epochs.course import YEAR, ParameterCourse
from accelstudy.epochs.interval import LINE_POINTS, SHOWN_YEARS, Interval, interval_figure
from accelstudy.files.outputs import HISTORY
from accelstudy.files.parquet import write_frame
from accelstudy.pages import render_lines

MIN_CALIBRATIONS = 3
"""Calibrations of which a line leaves a degree of freedom."""


class History(Calibrations):
    """Calibrations of one sensor over time: what drifts, and what scatters.

    Attributes
    ----------
    calibrations : tuple of n SensorCalibration, in the order of time
    model : SensorModel
    estimates : (n, p) array, SI
    covariances : (n, p, p) array
    dates : tuple of n datetime
    interval : accelstudy.epochs.interval.Interval, how long the last calibration stays good enough;
        None if no accuracy was given
    sensor : str, what was calibrated; None if no campaign says it
    """

    kind = HISTORY
    size = FULL, 70.0

    def __init__(
        self,
        calibrations: Sequence[SensorCalibration],
        dates: Sequence[datetime],
        wanted: tuple[float, float, float] | None = None,
    ) -> None:
        """Put calibrations in the order of time.

        Parameters
        ----------
        calibrations, dates : of one sensor
        wanted : accuracy, tilt range and confidence, as in `Interval`

        Raises
        ------
        InputError
            If they are fewer than three, of one date, or of different models.
        """
        if len(calibrations) < MIN_CALIBRATIONS:
            raise InputError(
                f"CALIBRATION: a history has {MIN_CALIBRATIONS} or more, not {len(calibrations)}; "
                "`compare` takes two"
            )
        if len(set(dates)) < 2:
            raise InputError(f"{key('dates')}: all are the same; a rate needs two dates or more")
        super().__init__(calibrations)
        order = sorted(range(len(dates)), key=dates.__getitem__)
        self.calibrations = tuple(calibrations[i] for i in order)
        self.estimates, self.covariances = self.estimates[order], self.covariances[order]
        self.dates = tuple(dates[i] for i in order)
        self.interval = None if wanted is None else Interval(self, *wanted)
        sensors = (one.content["sensor"] for one in self.calibrations)
        self.sensor: str | None = next(filter(None, sensors), None)
        self.name = self.sensor or self.calibrations[0].content["campaign"]

    @cached_property
    def courses(self) -> tuple[ParameterCourse, ...]:
        """Courses of the parameters over time."""
        years = [(date - self.dates[-1]).total_seconds() / YEAR for date in self.dates]
        each = zip(self.estimates.T, np.square(self.sigmas).T, strict=True)
        return tuple(ParameterCourse(np.array(years), *parameter, self.dof) for parameter in each)

    @property
    def level(self) -> float:
        """Level of the tests of one parameter over time."""
        return LEVEL / len(self.parameters)

    @cached_property
    def statements(self) -> tuple[tuple[str, ...], ...]:
        """What each parameter does over time, in words, at one level for all."""
        return tuple(course.found(self.level) for course in self.courses)

    @cached_property
    def sentences(self) -> list[str]:
        """What drifts and what scatters; the verdict comes first."""
        level = self.level
        each = list(zip(self.courses, self.parameters, self.statements, strict=True))
        drifting = [(course, parameter) for course, parameter, found in each if "drifts" in found]
        least = (
            [course.detectable_rate(level) for course in self.courses],
            [course.detectable_scatter(level) for course in self.courses],
        )
        return render_lines(
            "epochs/wording.txt.j2",
            "history",
            self,
            rates=[change_text(parameter, *course.rate[:2]) for course, parameter in drifting],
            unsure=[
                change_text(parameter, *course.wandering_rate[:2])
                for course, parameter in drifting
                if course.wandering_rate.p_value >= level
            ],
            scatters=[
                f"{parameter.name} by {size_text(course.line.scatter, parameter.unit)}"
                for course, parameter, found in each
                if "scatters" in found
            ],
            others=[parameter.name for _, parameter, found in each if "changed" in found],
            least=[largest_texts(self.parameters, sizes) for sizes in least],
        )

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of history.json, in SI but for keys that name another unit; per year."""
        interval, level = self.interval, self.level
        return {
            "schema_version": 1,
            "sensor": self.sensor,
            "calibrations": [
                {"campaign": one.content["campaign"], "date": date.isoformat()}
                for one, date in zip(self.calibrations, self.dates, strict=True)
            ],
            "effects": [effect.spec for effect in self.model.effects],
            "state": STATES[not any(self.statements)],
            "level": LEVEL,
            "parameters": [
                {
                    "name": parameter.name,
                    "unit": parameter.unit,
                    "value": float(course.line.estimates[0]),
                    "sigma": float(np.sqrt(course.line.covariance[0, 0])),
                    "found": found,
                    "p_value": course.p_values(level)[0],
                    "rate": {
                        "per_year": course.rate.per_year,
                        "sigma": course.rate.sigma,
                        "ci95": course.rate.interval,
                        "ci95_wandering": course.wandering_rate.interval,
                        "p_value": course.rate.p_value,
                        "detectable": course.detectable_rate(level),
                    },
                    "scatter": {
                        "sd": course.line.scatter,
                        "ci95": course.line.scatter_interval(),
                        "p_value": course.p_values(level)[2],
                        "detectable": course.detectable_scatter(level),
                    },
                }
                for course, parameter, found in zip(
                    self.courses, self.parameters, self.statements, strict=True
                )
            ],
            "interval": interval
            and {
                "years": interval.years,
                "until": interval.until.date().isoformat(),
                "accuracy_mgon": interval.accuracy / MGON,
                "max_tilt_gon": interval.tilt_range / GON,
                "confidence": interval.confidence,
                "errors": [{"years": t, "mgon": interval.error(t) / MGON} for t in SHOWN_YEARS],
            },
            "verdict": " ".join(self.sentences),
        }

    @cached_property
    def values(self) -> pd.DataFrame:
        """Value and sigma of each parameter in each calibration, as history.parquet has them."""
        n, p = self.estimates.shape
        return pd.DataFrame({
            "calibration": np.repeat(np.arange(1, n + 1), p),
            "campaign": np.repeat([one.content["campaign"] for one in self.calibrations], p),
            "date": np.repeat([date.isoformat() for date in self.dates], p),
            "parameter": self.model.parameter_names * n,
            "value": self.estimates.ravel(),
            "sigma": self.sigmas.ravel(),
            "unit": [parameter.unit for parameter in self.parameters] * n,
        })  # fmt: skip

    def to_frame(self) -> pd.DataFrame:
        """Return value, rate a year and scatter of each parameter, and what was found."""
        rows = pd.json_normalize([*self.content["parameters"]]).set_index("name")
        rows["found"] = rows["found"].str.join(", ")
        rates = {
            "rate.per_year": "rate_per_year",
            "rate.sigma": "sigma_rate",
            "scatter.sd": "scatter",
        }
        return rows[["value", "sigma", *rates, "unit", "found"]].rename(columns=rates)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy history` does."""
        title = "Calibrations and lines with 95 % intervals; dotted: no drift found"
        figures = {"history": lambda: self.parameters_figure(title, self._at, self._draw_line)}
        if (interval := self.interval) is not None:
            figures["interval"] = lambda: interval_figure(interval)
        write_frame(folder / "history.parquet", self.values)
        self._write(folder, figures)

    @property
    def _at(self) -> NDArray[np.datetime64]:
        """Dates for the axis of a figure."""
        return np.array(self.dates, dtype="datetime64[us]")

    def _draw_line(self, ax: Axes, k: int) -> None:
        """Draw the line of a parameter over time, with the band that holds 95 %."""
        parameter, course = self.parameters[k], self.courses[k]
        colour, unit = group_colour(group_of(parameter.name)), parameter.unit
        years = np.linspace(course.years[0], 0.0, LINE_POINTS)
        design = np.column_stack([np.ones(LINE_POINTS), years])
        between = self._at[-1] + (years * YEAR * 1e6).astype("timedelta64[us]")
        line = to_display(design @ course.line.estimates, unit)
        variance = np.einsum("iu,uw,iw->i", design, course.line.covariance, design)
        half = to_display(course.rate.sigmas_95 * np.sqrt(variance), unit)
        seen = ax.get_ylim()
        ax.fill_between(between, line - half, line + half, color=colour, alpha=0.15, linewidth=0)
        ax.plot(between, line, "-" if "drifts" in self.statements[k] else ":", color=colour)
        # The band of a few calibrations would dwarf them.
        ax.set_ylim(seen[0] - 0.3 * np.ptp(seen), seen[1] + 0.3 * np.ptp(seen))
        locator = AutoDateLocator(minticks=2, maxticks=5)  # type: ignore[no-untyped-call]
        formatter = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
        ax.xaxis.set(major_locator=locator, major_formatter=formatter)

    def draw(self, ax: Axes) -> None:
        """Draw the deviation of each parameter from the first calibration, over its sigma."""
        off = (self.estimates - self.estimates[0]) / self.sigmas
        ax.plot(self._at, off, "o-", markersize=3, label=self.model.parameter_names)
        ax.set(xlabel="date", ylabel="change since the first / sigma")
        ax.legend(ncols=4)


def dates_of(
    calibrations: Sequence[SensorCalibration],
    dates: Sequence[str | datetime],
    names: Sequence[str],
) -> list[datetime]:
    """Dates of calibrations that are given, or those of the campaigns.

    Parameters
    ----------
    calibrations : sequence of SensorCalibration
    dates : sequence of str or datetime, of each calibration; none for those of the campaigns
    names : sequence of str, what messages call the calibrations

    Raises
    ------
    InputError
        If a date is missing or wrong, or a calibration is given twice.
    """
    if dates and len(dates) != len(calibrations):
        raise InputError(
            f"{key('dates')}: {plural(len(dates), 'date')} for "
            f"{plural(len(calibrations), 'calibration')}; give one for each, in their order, as "
            "2026-03-01"
        )
    first: dict[bytes, str] = {}
    for one, name in zip(calibrations, names, strict=True):
        # Noise never repeats: the same numbers are one campaign, whatever the file is called.
        same = first.setdefault(one.parameters.tobytes(), name)
        if same is not name:
            raise InputError(f"{name}: has the numbers of {same}; each counts once")
    where = [key("dates")] * len(dates) or [f"{name}: date" for name in names]
    stated = dates or [one.content["date"] for one in calibrations]
    return [_date(*each) for each in zip(stated, where, strict=True)]


def _date(given: str | datetime | None, where: str) -> datetime:
    if given is None:
        raise InputError(
            f"{where}: missing; give `dates` for each calibration, or calibrate "
            "again with `date` in the header of the campaign"
        )
    if isinstance(given, datetime):
        return given
    try:
        return read_date(given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
