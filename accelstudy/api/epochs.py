"""Calibrations of one sensor beside each other: two are compared, more are followed."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from accelstudy.api.calibrations import TILT, Calibration, as_calibration
from accelstudy.api.given import drawing, for_programs, of_type, quantity
from accelstudy.api.results import Result
from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, Given
from accelstudy.basics.wording import counted
from accelstudy.drawing.style import FULL
from accelstudy.epochs import comparison as comparing
from accelstudy.epochs.history import History as Course
from accelstudy.epochs.history import history_of
from accelstudy.epochs.history_output import history_document, history_table, write_history
from accelstudy.epochs.interval import Interval
from accelstudy.epochs.output import comparison_document, draw_changes, write_comparison
from accelstudy.files.outputs import COMPARISON, HISTORY
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.planning.question import confidence_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


ACCURACY = Given("rad", "", "Accuracy.", 1e-9, np.pi / 2)


class Comparison(Result):
    """Two calibrations of one sensor: whether it changed, in what, and what it matters.

    Attributes
    ----------
    result : accelstudy.epochs.comparison.Comparison, all of it
    """

    kind = COMPARISON

    def __init__(self, result: comparing.Comparison) -> None:
        self.result = result

    @property
    def name(self) -> str:
        """Names of the campaigns."""
        return f"{self.content['first']} and {self.content['second']}"

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of comparison.json."""
        return comparison_document(self.result)

    def to_frame(self) -> pd.DataFrame:
        """Return both values of each parameter, the change with its sigma, and what was found."""
        rows = pd.DataFrame(self.content["parameters"]).set_index("name")
        return rows[["first", "second", "change", "sigma", "detectable", "unit", "changed"]]

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the change of each parameter over its sigma."""
        with drawing(ax, FULL, 62) as ax:
            draw_changes(ax, self.result)
        return ax

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy compare` does."""
        write_comparison(self.result, folder)


@for_programs
def compare(
    first: Calibration | str | PathLike[str],
    second: Calibration | str | PathLike[str],
    *,
    tilt_range: float | str = MAX_TILT_GON * GON,
) -> Comparison:
    """Say whether a sensor is still what it was.

    The congruence test of deformation analysis takes all parameters with both covariance matrices;
    if it rejects, the parameters that changed are named, at one level for all.

    Parameters
    ----------
    first, second : Calibration, or the path of a calibration.json, the older one first
    tilt_range : float in rad or str with a unit
        Tilts over which the change of roll and pitch is taken.

    Raises
    ------
    InputError
        If they are not of one sensor, or have no effect in common.
    """
    pair = as_calibration(first, "first"), as_calibration(second, "second")
    return Comparison(comparing.compare(*pair, quantity("tilt_range", tilt_range, TILT)))


class History(Result):
    """Calibrations of one sensor over time: what drifts, and what scatters.

    Attributes
    ----------
    result : accelstudy.epochs.history.History, all of it
    interval : accelstudy.epochs.interval.Interval, how long the last calibration stays good enough;
        None if no accuracy was given
    """

    kind = HISTORY

    def __init__(self, result: Course, interval: Interval | None) -> None:
        self.result, self.interval = result, interval

    @property
    def name(self) -> str:
        """Name of the sensor, or of the first campaign."""
        return self.content["sensor"] or self.content["calibrations"][0]["campaign"]

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of history.json."""
        return history_document(self.result, self.interval)

    @property
    def values(self) -> pd.DataFrame:
        """Value and sigma of each parameter in each calibration, as history.parquet has them."""
        return history_table(self.result)

    def to_frame(self) -> pd.DataFrame:
        """Return value, rate a year and scatter of each parameter, and what was found."""
        rows = [
            {
                "name": one["name"],
                "value": one["value"],
                "sigma": one["sigma"],
                "rate_per_year": one["rate"]["per_year"],
                "sigma_rate": one["rate"]["sigma"],
                "scatter": one["scatter"]["sd"],
                "unit": one["unit"],
                "found": ", ".join(one["found"]),
            }
            for one in self.content["parameters"]
        ]
        return pd.DataFrame(rows).set_index("name")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the deviation of each parameter from the first calibration, over its sigma."""
        table = self.values
        with drawing(ax, FULL, 70) as ax:
            for name, rows in table.groupby("parameter", sort=False):
                off = (rows["value"] - rows["value"].iloc[0]) / rows["sigma"]
                ax.plot(pd.to_datetime(rows["date"]), off, "o-", markersize=3, label=name)
            ax.set(xlabel="date", ylabel="change since the first / sigma")
            ax.legend(ncols=4)
        return ax

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy history` does."""
        write_history(self.result, folder, self.interval)


@for_programs
def history(
    calibrations: Sequence[Calibration | str | PathLike[str]],
    *,
    dates: Sequence[str | datetime] = (),
    tilt_accuracy: float | str | None = None,
    tilt_range: float | str = MAX_TILT_GON * GON,
    confidence: float | str = 0.95,
) -> History:
    """Say how a sensor changes over time.

    For each parameter there is a rate with its interval, and the scatter from session to session.
    All tests together have one level.

    Parameters
    ----------
    calibrations : three or more of Calibration, or paths of calibration.json, of one sensor
    dates : of the calibrations, in their order, as "2026-03-01"; those of the campaigns if omitted
    tilt_accuracy : float in rad or str with a unit, optional
        Ask how long the last calibration stays this accurate in roll and pitch.
    tilt_range : float in rad or str with a unit, largest tilt at which the accuracy is wanted
    confidence : float or str, as 0.95 or "95%", probability with which it stays so

    Raises
    ------
    InputError
        If they are fewer than three, of one date, or not of one sensor.
    """
    chosen = _confidence(confidence)
    read = [as_calibration(one) for one in calibrations]
    if dates and len(dates) != len(read):
        raise InputError(
            f"--date: {counted(len(dates), 'date')} for {counted(len(read), 'calibration')}; give "
            "one for each, in their order, as 2026-03-01"
        )
    paths = all(isinstance(one, str | PathLike) for one in calibrations)
    places = [str(one) for one in calibrations] if paths else None
    first: dict[bytes, int] = {}
    for i, one in enumerate(read):
        # Noise never repeats: the same numbers are one campaign, whatever the file is called.
        same = first.setdefault(one.parameters["value"].to_numpy().tobytes(), i)
        if same != i:
            called = places or [f"calibration {k + 1}" for k in range(len(read))]
            raise InputError(f"{called[i]}: has the numbers of {called[same]}; each counts once")
    given: Sequence[Any] = dates or [one.content.get("date") for one in read]
    where = ["--date"] * len(dates) or [f"{place}: date" for place in places or map(repr, read)]
    when = [_date(text, what) for text, what in zip(given, where, strict=True)]
    found, interval = history_of(read, when), None
    if tilt_accuracy is not None:
        interval = Interval(
            found,
            quantity("tilt_accuracy", tilt_accuracy, ACCURACY),
            quantity("tilt_range", tilt_range, TILT),
            chosen,
        )
    return History(found, interval)


def _confidence(value: float | str) -> float:
    of_type("confidence", value, float, str, expected="a probability, as 0.95 or 95%")
    chosen = confidence_of(str(value).strip())
    if chosen is None:
        raise InputError("--confidence: a probability, such as 95%, not rms")
    return chosen


def _date(given: str | datetime | None, where: str) -> datetime:
    if given is None:
        raise InputError(
            f"{where}: missing; give --date for each calibration, or calibrate again with `date` "
            "in the header of the campaign"
        )
    if isinstance(given, datetime):
        return given
    try:
        return read_date(given)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
