"""Calibrations of one sensor with one model, at two times or more: what changed, and how."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics.dates import read_date
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import comma_list, estimate, plural
from accelstudy.campaign.calibration.document import json_content, write_json
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, INK, group_colour, group_of, new_figure, symbol
from accelstudy.effects import Parameter
from accelstudy.epochs.congruence import LEVEL, Differences
from accelstudy.epochs.course import YEAR, ParameterCourse
from accelstudy.epochs.interval import Interval
from accelstudy.files.outputs import COMPARISON, HISTORY
from accelstudy.leveling.error import ATTITUDES, TiltError, cap_forces, tilt_error
from accelstudy.pages import render_lines, write_page
from accelstudy.pages.result import Result

Array = NDArray[np.float64]

STATES = {True: "unchanged", False: "changed"}
"""States of a result by whether the calibrations agree."""
MIN_CALIBRATIONS = 3
"""Calibrations of which a line leaves a degree of freedom."""
MIN_DIFFERENCE = 1e-12
"""rad, largest difference of tilts that rounding may cause."""
PANELS = 3
"""Panels side by side."""
LINE_POINTS = 50
"""Number of points of a line."""


class Epochs(Result):
    """Calibrations of one sensor with one model.

    Attributes
    ----------
    calibrations : tuple of n SensorCalibration
    model : SensorModel
    estimates : (n, p) array, SI
    covariances : (n, p, p) array
    sigmas : (n, p) array
    dof : (n,) array, degrees of freedom by which the noise was estimated; inf if it is known
    """

    dates: tuple[datetime, ...] = ()
    """Of each calibration, by which they are a history; empty for two that are compared."""

    def __init__(self, calibrations: Sequence[SensorCalibration]) -> None:
        _check_alike(calibrations)
        self.calibrations, self.model = tuple(calibrations), calibrations[0].model
        self.parameters, names = self.model.parameters, self.model.parameter_names
        orders = [[one.model.parameter_names.index(n) for n in names] for one in calibrations]
        each = [*zip(calibrations, orders, strict=True)]
        self.estimates = np.array([one.parameters[order] for one, order in each])
        self.covariances = np.array([one.covariance[np.ix_(order, order)] for one, order in each])
        self.sigmas = np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2))
        self.dof = np.array([one.dof for one in calibrations])

    @property
    @abstractmethod
    def sentences(self) -> list[str]:
        """What was found, in sentences; the verdict comes first."""

    def tilt_error(self, first: Array, second: Array, tilt_range: float) -> TiltError:
        """Tilt error by one set of parameters for another, in conditions of the last session."""
        last = self.calibrations[-1]
        forces = cap_forces(tilt_range, ATTITUDES, last.gravity)
        forces, hold = last.with_conditions(forces, self.model.hold_columns)
        return tilt_error(self.model, first, self.model, second, forces, last.gravity, hold)

    def _write(self, folder: Path, name: str, draw: Callable[[], Figure]) -> None:
        """Write the page with its figure, and the JSON file."""
        write_page(
            folder / "report.html",
            "epochs/report.html.j2",
            self.verdict,
            doc=self.content,
            h=self,
            lines=self.sentences,
            figure=save_all({name: draw}, folder / "figures")[name],
        )
        write_json(folder / self.kind.marker, self.content)


def _check_alike(calibrations: Sequence[SensorCalibration]) -> None:
    """Check that the parameters of all calibrations are known, and mean the same.

    Raises
    ------
    InputError
        If one of them has no sigmas, or other effects or another conversion of its readings than
        the first. The line names the calibration by its number and its campaign.
    """
    names = [effect.spec for effect in calibrations[0].model.effects]
    for number, one in enumerate(calibrations, start=1):
        own = [effect.spec for effect in one.model.effects]
        if not np.isfinite(one.covariance).all():
            why = "no sigmas; calibrate with more positions, or state the noise of the campaign"
        elif one.content["nominal"] != calibrations[0].content["nominal"]:
            why = (
                "nominal: other scales or offsets from counts to m/s^2 than in the first "
                "calibration, so their parameters do not mean the same; import both logs with the "
                "same ones"
            )
        elif {*own} != {*names}:
            why = (
                f"effects: {comma_list(own)}, but {comma_list(names)} in the first calibration; "
                "calibrate both campaigns with one `--model`"
            )
        else:
            continue
        raise InputError(f"calibration {number} ({one.content['campaign']}): {why}")


# --- two calibrations ---------------------------------------------------------------------------


class Comparison(Epochs):
    """Two calibrations of one sensor: whether it changed, in what, and what it matters.

    What changed is told by all parameters together, with their whole covariance matrices.

    Attributes
    ----------
    calibrations : tuple of SensorCalibration, the older one first
    model : SensorModel
    estimates : (2, p) array, SI
    covariances : (2, p, p) array
    tilt_range : float, rad, over which tilts are compared
    """

    kind = COMPARISON

    def __init__(
        self, first: SensorCalibration, second: SensorCalibration, tilt_range: float
    ) -> None:
        super().__init__((first, second))
        self.tilt_range = tilt_range
        self.name = " and ".join(one.content["campaign"] for one in self.calibrations)
        dof = float(self.dof[0]), float(self.dof[1])
        apart = self.estimates[1] - self.estimates[0]
        self.change = Differences(apart, tuple(self.covariances), dof)

    @cached_property
    def tilt(self) -> Array:
        """Rms by which roll and pitch differ, and that which chance would give, (2, 2), rad.

        Readings are those of the sensor as it was at first; they are leveled as if it had not
        changed, and as it is at last.
        """
        error = self.tilt_error(self.estimates[0], self.estimates[1], self.tilt_range)
        by_chance = np.einsum("auw,uw->a", error.quadratic, self.change.covariance)
        plain = np.where(error.constant > MIN_DIFFERENCE**2, error.constant, 0.0)
        return np.sqrt([plain, by_chance])

    @cached_property
    def _rows(self) -> pd.DataFrame:
        """What each parameter was and is, a row each."""
        change, names = self.change, self.model.parameter_names
        instead = {i: [names[k] for k in change.instead_of(i)] for i in change.fewest_changes}
        columns = {
            "name": names,
            "first": self.estimates[0],
            "second": self.estimates[1],
            "change": change.differences,
            "sigma": change.sigmas,
            "detectable": change.detectable,
            "unit": [parameter.unit for parameter in self.parameters],
            "changed": [i in instead for i in range(len(names))],
            "or": [instead.get(i, []) for i in range(len(names))],
        }
        return pd.DataFrame(columns)

    @cached_property
    def sentences(self) -> list[str]:
        """Whether the sensor changed, in what, and what it matters; the verdict comes first."""
        change = self.change
        return render_lines(
            "epochs/wording.txt.j2",
            "comparison",
            self,
            changes=[
                change_text(self.parameters[i], change.differences[i], change.sigmas[i])
                for i in change.fewest_changes
            ],
            least=largest_texts(self.parameters, change.detectable),
            rows=self._rows.to_dict("records"),
        )

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of comparison.json, in SI but for keys that name another unit."""
        test, (first, second) = self.change.test, self.calibrations
        names = ("roll_mgon", "pitch_mgon", "roll_by_chance_mgon", "pitch_by_chance_mgon")
        tilt = zip(names, (self.tilt / MGON).ravel().tolist(), strict=True)
        content: dict[str, Any] = json_content({
            "schema_version": 1,
            "first": first.content["campaign"],
            "second": second.content["campaign"],
            "state": STATES[test.congruent],
            "test": {**test._asdict(), "level": LEVEL},
            "parameters": self._rows.to_dict("records"),
            "covariance": self.change.covariance,
            "tilt": {**dict(tilt), "max_tilt_gon": self.tilt_range / GON},
            "verdict": " ".join(self.sentences),
        })  # fmt: skip
        return content

    def to_frame(self) -> pd.DataFrame:
        """Return both values of each parameter, the change with its sigma, and what was found."""
        return self._rows.set_index("name").drop(columns="or")

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy compare` does."""

        def draw() -> Figure:
            figure = new_figure(*self.size)
            self.draw(figure.subplots())
            return figure

        self._write(folder, "changes", draw)

    def draw(self, ax: Axes) -> None:
        """Draw the change of each parameter over its sigma, with the interval that holds 95 %."""
        ax.axhline(0, color=INK, linewidth=0.8)
        for i, parameter in enumerate(self.parameters):
            colour = group_colour(group_of(parameter.name))
            filled = colour if i in self.change.fewest_changes else "white"
            size = self.change.differences[i] / self.change.sigmas[i]
            ax.errorbar(i, size, 1.96, fmt="o", color=colour, markerfacecolor=filled, capsize=2.5)
        ax.set_xticks(range(len(self.parameters)), [symbol(p.name) for p in self.parameters])
        ax.set(ylabel="change / sigma")


# --- three or more ------------------------------------------------------------------------------


class History(Epochs):
    """Calibrations of one sensor over time: what drifts, and what scatters.

    Attributes
    ----------
    calibrations : tuple of n SensorCalibration, in the order of time
    model : SensorModel
    estimates : (n, p) array, SI
    covariances : (n, p, p) array
    dates : tuple of n datetime
    courses : tuple of p accelstudy.epochs.course.ParameterCourse
    found : tuple of p tuples of str, what each parameter does over time, at one level for all
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
        order = sorted(range(len(dates)), key=dates.__getitem__)
        super().__init__([calibrations[i] for i in order])
        self.dates = tuple(dates[i] for i in order)
        years = np.array([(date - self.dates[-1]).total_seconds() / YEAR for date in self.dates])
        self.courses = tuple(
            ParameterCourse(years, values, variances, self.dof)
            for values, variances in zip(self.estimates.T, np.square(self.sigmas).T, strict=True)
        )
        self.level = LEVEL / len(self.parameters)
        self.interval = None if wanted is None else Interval(self, *wanted)
        sensors = (one.content["sensor"] for one in self.calibrations)
        self.sensor: str | None = next(filter(None, sensors), None)
        self.name = self.sensor or self.calibrations[0].content["campaign"]

    @cached_property
    def found(self) -> tuple[tuple[str, ...], ...]:
        """What each parameter does over time, in words."""
        return tuple(course.found(self.level) for course in self.courses)

    @cached_property
    def sentences(self) -> list[str]:
        """What drifts and what scatters; the verdict comes first."""
        level, each = self.level, [*zip(self.parameters, self.courses, self.found, strict=True)]
        drifting = [(parameter, course) for parameter, course, found in each if "drifts" in found]
        least = (
            [course.detectable_rate(level) for course in self.courses],
            [course.detectable_scatter(level) for course in self.courses],
        )
        return render_lines(
            "epochs/wording.txt.j2",
            "history",
            self,
            rates=[change_text(parameter, *course.rate[:2]) for parameter, course in drifting],
            unsure=[
                change_text(parameter, *course.wandering_rate[:2])
                for parameter, course in drifting
                if course.wandering_rate.p_value >= level
            ],
            scatters=[
                f"{parameter.name} by {size_text(course.line.scatter, parameter.unit)}"
                for parameter, course, found in each
                if "scatters" in found
            ],
            others=[parameter.name for parameter, _, found in each if "changed" in found],
            least=[largest_texts(self.parameters, sizes) for sizes in least],
        )

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of history.json, in SI but for keys that name another unit; per year."""
        each = zip(self.calibrations, self.dates, strict=True)
        content: dict[str, Any] = json_content({
            "schema_version": 1,
            "sensor": self.sensor,
            "calibrations": [
                {"campaign": one.content["campaign"], "date": date.isoformat()}
                for one, date in each
            ],
            "effects": [effect.spec for effect in self.model.effects],
            "state": STATES[not any(self.found)],
            "level": LEVEL,
            "parameters": [self._parameter(k) for k in range(len(self.parameters))],
            "interval": self.interval and self.interval.content,
            "verdict": " ".join(self.sentences),
        })  # fmt: skip
        return content

    def _parameter(self, k: int) -> dict[str, Any]:
        """What history.json has of a parameter."""
        parameter, course = self.parameters[k], self.courses[k]
        line, rate, level = course.line, course.rate, self.level
        change, _, scatter = course.p_values(level)
        return {
            "name": parameter.name,
            "unit": parameter.unit,
            "values": self.estimates[:, k],
            "sigmas": self.sigmas[:, k],
            "value": float(line.estimates[0]),
            "sigma": float(np.sqrt(line.covariance[0, 0])),
            "found": self.found[k],
            "p_value": change,
            "rate": {
                "per_year": rate.per_year,
                "sigma": rate.sigma,
                "ci95": rate.interval,
                "ci95_wandering": course.wandering_rate.interval,
                "p_value": rate.p_value,
                "detectable": course.detectable_rate(level),
            },
            "scatter": {
                "sd": line.scatter,
                "ci95": line.scatter_interval(),
                "p_value": scatter,
                "detectable": course.detectable_scatter(level),
            },
        }

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
        self._write(folder, "history", self.figure)

    @property
    def _at(self) -> NDArray[np.datetime64]:
        """Dates for the axis of a figure."""
        return np.array(self.dates, dtype="datetime64[us]")

    def draw(self, ax: Axes) -> None:
        """Draw the deviation of each parameter from the first calibration, over its sigma."""
        off = (self.estimates - self.estimates[0]) / self.sigmas
        ax.plot(self._at, off, "o-", markersize=3, label=self.model.parameter_names)
        ax.set(xlabel="date", ylabel="change since the first / sigma")
        ax.legend(ncols=4)

    def figure(self) -> Figure:
        """Draw each parameter in all calibrations, and its line, with 95 % intervals."""
        rows = -(-len(self.parameters) // PANELS)
        figure = new_figure(FULL, 12 + 36 * rows)
        panels = figure.subplots(rows, PANELS, sharex=True, squeeze=False).ravel()
        for k, ax in enumerate(panels[: len(self.parameters)]):
            self._draw_parameter(ax, k)
            ax.tick_params(axis="x", labelbottom=k + PANELS >= len(self.parameters))
        for ax in panels[len(self.parameters) :]:
            ax.set_visible(False)
        figure.suptitle("Calibrations and lines with 95 % intervals; dotted: no drift found")
        return figure

    def _draw_parameter(self, ax: Axes, k: int) -> None:
        """Draw the calibrations of a parameter, and its line with the band that holds 95 %."""
        from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

        parameter, course, found = self.parameters[k], self.courses[k], self.found[k]
        colour, unit = group_colour(group_of(parameter.name)), parameter.unit
        values, halves = (to_display(v[:, k], unit) for v in (self.estimates, 1.96 * self.sigmas))
        ax.errorbar(self._at, values, halves, fmt="o", color=INK, capsize=2, linewidth=0.8, ms=3)
        years = np.linspace(course.years[0], 0.0, LINE_POINTS)
        design = np.column_stack([np.ones(LINE_POINTS), years])
        between = self._at[-1] + (years * YEAR * 1e6).astype("timedelta64[us]")
        line = to_display(design @ course.line.estimates, unit)
        variance = np.einsum("iu,uw,iw->i", design, course.line.covariance, design)
        half = to_display(sigmas_95(course.rate.dof) * np.sqrt(variance), unit)
        seen = ax.get_ylim()
        ax.fill_between(between, line - half, line + half, color=colour, alpha=0.15, linewidth=0)
        ax.plot(between, line, "-" if "drifts" in found else ":", color=colour)
        # The band of a few calibrations would dwarf them.
        ax.set_ylim(seen[0] - 0.3 * np.ptp(seen), seen[1] + 0.3 * np.ptp(seen))
        locator = AutoDateLocator(minticks=2, maxticks=5)  # type: ignore[no-untyped-call]
        formatter = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
        ax.xaxis.set(major_locator=locator, major_formatter=formatter)
        ax.set_title(symbol(parameter.name) + (f" ({' and '.join(found)})" if found else ""))
        ax.set_ylabel(shown_unit(unit))


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
    stated = list[datetime]()
    for i, (one, name) in enumerate(zip(calibrations, names, strict=True)):
        # Noise never repeats: the same numbers are one campaign, whatever the file is called.
        if (same := first.setdefault(one.parameters.tobytes(), name)) is not name:
            raise InputError(f"{name}: has the numbers of {same}; each counts once")
        date = dates[i] if dates else one.content["date"]
        if date is None:
            raise InputError(
                f"{name}: date: missing; give `dates` for each calibration, or calibrate "
                "again with `date` in the header of the campaign"
            )
        try:
            stated.append(date if isinstance(date, datetime) else read_date(date))
        except InputError as error:
            raise InputError(f"{key('dates') if dates else f'{name}: date'}: {error}") from None
    return stated


# --- words of both ------------------------------------------------------------------------------


def size_text(size: float, unit: str) -> str:
    """Show a size to two digits."""
    return f"{estimate(size, size, unit)[1]} {shown_unit(unit)}".strip()


def change_text(parameter: Parameter, value: float, sigma: float) -> str:
    """Name a parameter with its change, or its rate, and the sigma of that; in SI."""
    shown, uncertain = estimate(value, sigma, parameter.unit)
    sign = "" if shown.startswith("−") else "+"
    return f"{parameter.name} by {sign}{shown} ± {uncertain} {shown_unit(parameter.unit)}".strip()


def largest_texts(parameters: Sequence[Parameter], sizes: Sequence[float] | Array) -> list[str]:
    """Name the largest of the sizes in each unit, with its parameter."""
    found: dict[str, tuple[float, str]] = {}
    for parameter, size in zip(parameters, sizes, strict=True):
        before = found.get(parameter.unit, (0.0, ""))
        found[parameter.unit] = max(before, (float(size), parameter.name))
    return [f"{size_text(size, unit)} in {name}" for unit, (size, name) in found.items()]
