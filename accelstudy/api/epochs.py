"""Calibrations of one sensor beside each other: two are compared, more are followed."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.axes import Axes

from accelstudy.api.calibrations import Calibration, as_calibration
from accelstudy.api.given import check_once
from accelstudy.api.results import Result
from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.wording import counted
from accelstudy.drawing.style import FULL
from accelstudy.epochs import history as epochs
from accelstudy.epochs import output
from accelstudy.epochs.interval import Interval
from accelstudy.files.outputs import COMPARISON, HISTORY


class Comparison(Result):
    """Two calibrations of one sensor: whether it changed, in what, and what it matters.

    Attributes
    ----------
    result : accelstudy.epochs.history.History, all of it
    tilt_range : float, rad, over which tilts are compared
    """

    kind = COMPARISON

    def __init__(self, result: epochs.History, tilt_range: float) -> None:
        self.result, self.tilt_range = result, tilt_range
        self.name = " and ".join(one.content["campaign"] for one in result.calibrations)

    @classmethod
    def of(cls, first: Any, second: Any, tilt_range: float) -> Comparison:
        """Compare by the keywords of `accelstudy.compare`, checked."""
        pair = as_calibration(first, "first").sensor, as_calibration(second, "second").sensor
        return cls(epochs.compare(*pair), tilt_range)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of comparison.json."""
        return output.comparison_document(self.result, self.tilt_range)

    def to_frame(self) -> pd.DataFrame:
        """Return both values of each parameter, the change with its sigma, and what was found."""
        rows = pd.DataFrame(self.content["parameters"]).set_index("name")
        return rows[["first", "second", "change", "sigma", "detectable", "unit", "changed"]]

    def draw(self, ax: Axes) -> None:
        """Draw the change of each parameter over its sigma."""
        output.draw_changes(ax, self.result)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy compare` does."""
        said = output.comparison_said(self.result, self.tilt_range)
        output.write_report(self.result, self.content, said, folder)


class History(Result):
    """Calibrations of one sensor over time: what drifts, and what scatters.

    Attributes
    ----------
    result : accelstudy.epochs.history.History, all of it
    interval : accelstudy.epochs.interval.Interval, how long the last calibration stays good enough;
        None if no accuracy was given
    """

    kind = HISTORY
    size = FULL, 70.0

    def __init__(self, result: epochs.History, interval: Interval | None) -> None:
        self.result, self.interval = result, interval
        of_sensors = (one.content["sensor"] for one in result.calibrations)
        self.name = next(filter(None, of_sensors), result.calibrations[0].content["campaign"])

    @classmethod
    def of(
        cls,
        calibrations: Sequence[Any],
        *,
        dates: Sequence[str | datetime],
        tilt_accuracy: float | None,
        **use: float,
    ) -> History:
        """Follow a sensor by the keywords of `accelstudy.history`, checked."""
        check_once(calibrations, "calibration")
        course = follow([*map(as_calibration, calibrations)], dates, calibrations)
        wanted = None if tilt_accuracy is None else Interval(course, tilt_accuracy, **use)
        return cls(course, wanted)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of history.json."""
        return output.history_document(self.result, self.interval)

    @property
    def values(self) -> pd.DataFrame:
        """Value and sigma of each parameter in each calibration, as history.parquet has them."""
        return output.history_table(self.result)

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

    def draw(self, ax: Axes) -> None:
        """Draw the deviation of each parameter from the first calibration, over its sigma."""
        for name, rows in self.values.groupby("parameter", sort=False):
            off = (rows["value"] - rows["value"].iloc[0]) / rows["sigma"]
            ax.plot(pd.to_datetime(rows["date"]), off, "o-", markersize=3, label=name)
        ax.set(xlabel="date", ylabel="change since the first / sigma")
        ax.legend(ncols=4)

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy history` does."""
        said = output.history_said(self.result, self.interval)
        output.write_report(self.result, self.content, said, folder, self.interval)


def follow(
    calibrations: Sequence[Calibration], dates: Sequence[str | datetime], given: Sequence[Any]
) -> epochs.History:
    """Follow a sensor over its calibrations, which messages call as they were given."""
    if dates and len(dates) != len(calibrations):
        raise InputError(
            f"{key('dates')}: {counted(len(dates), 'date')} for "
            f"{counted(len(calibrations), 'calibration')}; give one for each, in their order, as "
            "2026-03-01"
        )
    paths = all(isinstance(one, str | PathLike) for one in given)
    called = [str(one) for one in given] if paths else None
    first: dict[bytes, int] = {}
    for i, one in enumerate(calibrations):
        # Noise never repeats: the same numbers are one campaign, whatever the file is called.
        same = first.setdefault(one.parameters["value"].to_numpy().tobytes(), i)
        if same != i:
            names = called or [f"calibration {k + 1}" for k in range(len(calibrations))]
            raise InputError(f"{names[i]}: has the numbers of {names[same]}; each counts once")
    stated: Sequence[Any] = dates or [one.content.get("date") for one in calibrations]
    places = [f"{name}: date" for name in called or map(repr, calibrations)]
    where = [key("dates")] * len(dates) or places
    read = [_date(text, what) for text, what in zip(stated, where, strict=True)]
    return epochs.history_of([one.sensor for one in calibrations], read)


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
