"""What two or more calibrations say of their sensor: a comparison, or a history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import estimate
from accelstudy.campaign.calibration.document import json_number, write_json
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import COLUMN, FULL, INK, group_colour, group_of, new_figure, symbol
from accelstudy.effects import Parameter
from accelstudy.epochs import history as epochs
from accelstudy.epochs.congruence import LEVEL
from accelstudy.epochs.history import YEAR
from accelstudy.epochs.interval import MAX_YEARS, SHOWN_YEARS, Interval
from accelstudy.files.outputs import COMPARISON, HISTORY
from accelstudy.files.parquet import write_frame
from accelstudy.pages import lines, write_page
from accelstudy.pages.result import Result

STATES = {True: "unchanged", False: "changed"}
"""States by whether the calibrations agree, as `pages.BADGES` has them."""
COLUMNS = 3
"""Panels side by side."""
WRONG = "#C2247A"
"""Colour of what must not be exceeded."""
LINE_POINTS = 50
"""Points of a line."""


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

    @cached_property
    def said(self) -> list[str]:
        """Whether the sensor changed, in what, and what it matters; the verdict comes first."""
        h, change, tilt_range = self.result, self.result.change, self.tilt_range
        changes = [
            _change_of(h.parameters[i], float(change.differences[i]), float(change.sigmas[i]))
            for i in change.changed
        ]
        least, tilts = _largest(h.parameters, change.detectable()), h.tilt(tilt_range).tolist()
        return lines("epochs/wording.txt.j2", "comparison", h, changes, least, tilts, tilt_range)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of comparison.json, in SI but for keys that name another unit."""
        h, change, tilt_range = self.result, self.result.change, self.tilt_range
        test, changed, (first, second) = change.test(), change.changed, h.calibrations
        (roll, pitch), (roll_by_chance, pitch_by_chance) = h.tilt(tilt_range) / MGON
        return {
            "schema_version": 1,
            "first": first.content["campaign"],
            "second": second.content["campaign"],
            "state": STATES[test.congruent],
            "test": {
                "statistic": test.statistic,
                "dof": [test.dof[0], json_number(test.dof[1])],
                "p_value": test.p_value,
                "level": LEVEL,
            },
            "parameters": [
                {
                    "name": parameter.name,
                    "first": float(h.values[0, i]),
                    "second": float(h.values[1, i]),
                    "change": float(change.differences[i]),
                    "sigma": float(change.sigmas[i]),
                    "detectable": float(detectable),
                    "unit": parameter.unit,
                    "changed": i in changed,
                    "or": h.instead_of(i) if i in changed else [],
                }
                for i, (parameter, detectable) in enumerate(
                    zip(h.parameters, change.detectable(), strict=True)
                )
            ],
            "covariance": change.covariance.tolist(),
            "only_first": h.left_out(first),
            "only_second": h.left_out(second),
            "tilt": {
                "roll_mgon": roll,
                "pitch_mgon": pitch,
                "roll_by_chance_mgon": roll_by_chance,
                "pitch_by_chance_mgon": pitch_by_chance,
                "max_tilt_gon": tilt_range / GON,
            },
            "verdict": " ".join(self.said),
        }

    def to_frame(self) -> pd.DataFrame:
        """Return both values of each parameter, the change with its sigma, and what was found."""
        rows = pd.DataFrame(self.content["parameters"]).set_index("name")
        return rows[["first", "second", "change", "sigma", "detectable", "unit", "changed"]]

    def write(self, folder: Path, place: Path) -> None:
        """Write what `accelstudy compare` does."""
        _write(self, {"changes": lambda: parameters_figure(self.result)}, folder)

    def draw(self, ax: Axes) -> None:
        """Draw the change of each parameter over its sigma, with the interval that holds 95 %."""
        change, parameters = self.result.change, self.result.parameters
        ax.axhline(0, color=INK, linewidth=0.8)
        for i, parameter in enumerate(parameters):
            colour = group_colour(group_of(parameter.name))
            filled = colour if i in change.changed else "white"
            size = change.differences[i] / change.sigmas[i]
            ax.errorbar(i, size, 1.96, fmt="o", color=colour, markerfacecolor=filled, capsize=2.5)
        ax.set_xticks(range(len(parameters)), [symbol(p.name) for p in parameters])
        ax.set(ylabel="change / sigma")


class History(Result):
    """Calibrations of one sensor over time: what drifts, and what scatters.

    Attributes
    ----------
    result : accelstudy.epochs.history.History, all of it
    interval : accelstudy.epochs.interval.Interval, how long the last calibration stays good enough;
        None if no accuracy was given
    sensor : str, what was calibrated; None if no campaign says it
    """

    kind = HISTORY
    size = FULL, 70.0

    def __init__(self, result: epochs.History, interval: Interval | None) -> None:
        self.result, self.interval = result, interval
        sensors = (one.content["sensor"] for one in result.calibrations)
        self.sensor: str | None = next(filter(None, sensors), None)
        self.name = self.sensor or result.calibrations[0].content["campaign"]

    @cached_property
    def said(self) -> list[str]:
        """What drifts and what scatters; the verdict comes first."""
        h, level = self.result, self.result.level
        each = list(zip(h.courses, h.parameters, h.found, strict=True))
        drifting = [(course, parameter) for course, parameter, found in each if "drifts" in found]
        rates = [_change_of(parameter, *course.rate) for course, parameter in drifting]
        unsure = [
            _change_of(parameter, *course.wandering_rate)
            for course, parameter in drifting
            if course.may_wander(level)
        ]
        scatters = [
            f"{parameter.name} by {_size(course.line.scatter, parameter.unit)}"
            for course, parameter, found in each
            if "scatters" in found
        ]
        others = [parameter.name for _, parameter, found in each if "changed" in found]
        least = [
            _largest(h.parameters, [course.detectable_rate(level) for course in h.courses]),
            _largest(h.parameters, [course.detectable_scatter(level) for course in h.courses]),
        ]
        kinds = rates, unsure, scatters, others, least
        return lines("epochs/wording.txt.j2", "history", h, *kinds, self.interval)

    @cached_property
    def content(self) -> dict[str, Any]:
        """Content of history.json, in SI but for keys that name another unit; per year."""
        h, interval = self.result, self.interval
        return {
            "schema_version": 1,
            "sensor": self.sensor,
            "calibrations": [
                {
                    "campaign": one.content["campaign"],
                    "date": date.isoformat(),
                    "left_out": h.left_out(one),
                }
                for one, date in zip(h.calibrations, h.dates, strict=True)
            ],
            "effects": [effect.spec for effect in h.model.effects],
            "state": STATES[not any(h.found)],
            "level": LEVEL,
            "parameters": [
                {
                    "name": parameter.name,
                    "unit": parameter.unit,
                    "value": float(course.line.estimates[0]),
                    "sigma": float(np.sqrt(course.line.covariance[0, 0])),
                    "found": found,
                    "p_value": course.p_values(h.level)[0],
                    "rate": {
                        "per_year": course.rate[0],
                        "sigma": course.rate[1],
                        "ci95": course.rate_interval,
                        "ci95_wandering": course.wandering_interval,
                        "p_value": course.p_values(h.level)[1],
                        "detectable": course.detectable_rate(h.level),
                    },
                    "scatter": {
                        "sd": course.line.scatter,
                        "ci95": course.line.scatter_interval(),
                        "p_value": course.p_values(h.level)[2],
                        "detectable": course.detectable_scatter(h.level),
                    },
                }
                for course, parameter, found in zip(h.courses, h.parameters, h.found, strict=True)
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
            "verdict": " ".join(self.said),
        }

    @cached_property
    def values(self) -> pd.DataFrame:
        """Value and sigma of each parameter in each calibration, as history.parquet has them."""
        h = self.result
        return pd.DataFrame(
            [
                {
                    "calibration": i + 1,
                    "campaign": one.content["campaign"],
                    "date": date.isoformat(),
                    "parameter": parameter.name,
                    "value": float(h.values[i, k]),
                    "sigma": float(h.sigmas[i, k]),
                    "unit": parameter.unit,
                }
                for i, (one, date) in enumerate(zip(h.calibrations, h.dates, strict=True))
                for k, parameter in enumerate(h.parameters)
            ]
        )

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
        figures = {"history": lambda: parameters_figure(self.result)}
        if (interval := self.interval) is not None:
            figures["interval"] = lambda: interval_figure(interval)
        write_frame(folder / "history.parquet", self.values)
        _write(self, figures, folder)


def _write(
    one: Comparison | History, figures: dict[str, Callable[[], Figure]], folder: Path
) -> None:
    """Write the page with its figures, and the JSON file."""
    write_page(
        folder / "report.html",
        "epochs/report.html.j2",
        one.verdict,
        doc=one.content,
        h=one.result,
        lines=one.said,
        figures=save_all(figures, folder / "figures"),
    )
    write_json(folder / one.kind.marker, one.content)


def _size(size: float, unit: str) -> str:
    """Show a size to two digits."""
    return f"{estimate(size, size, unit)[1]} {shown_unit(unit)}".strip()


def _change_of(parameter: Parameter, value: float, sigma: float) -> str:
    """Name a parameter with its change, or its rate, and the sigma of that; in SI."""
    shown, uncertain = estimate(value, sigma, parameter.unit)
    sign = "" if shown.startswith("−") else "+"
    return f"{parameter.name} by {sign}{shown} ± {uncertain} {shown_unit(parameter.unit)}".strip()


def _largest(
    parameters: Sequence[Parameter], sizes: Sequence[float] | NDArray[np.float64]
) -> list[str]:
    """Name the largest of the sizes in each unit, with its parameter."""
    found: dict[str, tuple[float, str]] = {}
    for parameter, size in zip(parameters, sizes, strict=True):
        before = found.get(parameter.unit, (0.0, ""))
        found[parameter.unit] = max(before, (float(size), parameter.name))
    return [f"{_size(size, unit)} in {name}" for unit, (size, name) in found.items()]


def parameters_figure(history: epochs.History) -> Figure:
    """Draw each parameter in all calibrations with 95 % intervals; over time, with its line."""
    h, names = history, history.parameters
    rows = -(-len(names) // COLUMNS)
    figure = new_figure(FULL, 12 + 36 * rows)
    panels = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
    at = np.array(h.dates, dtype="datetime64[us]") if h.dates else np.arange(2)
    found = (
        h.found if h.dates else [("changed",) * (k in h.change.changed) for k in range(len(names))]
    )
    for k, (ax, parameter) in enumerate(zip(panels, names, strict=False)):
        unit = parameter.unit
        values, halves = (to_display(v[:, k], unit) for v in (h.values, 1.96 * h.sigmas))
        ax.errorbar(at, values, halves, fmt="o", color=INK, capsize=2, linewidth=0.8, ms=3)
        if h.dates:
            _draw_line(ax, h, k)
        else:
            ax.set_xticks(at, ["first", "second"])
            ax.set_xlim(-0.5, 1.5)
        ax.set_title(symbol(parameter.name) + (f" ({' and '.join(found[k])})" if found[k] else ""))
        ax.set_ylabel(shown_unit(unit))
        ax.tick_params(axis="x", labelbottom=k + COLUMNS >= len(names))
    for ax in panels[len(names) :]:
        ax.set_visible(False)
    lines_too = " and lines" if h.dates else ""
    dotted = "; dotted: no drift found" if h.dates else ""
    figure.suptitle(f"Calibrations{lines_too} with 95 % intervals{dotted}")
    return figure


def _draw_line(ax: Axes, history: epochs.History, k: int) -> None:
    """Draw the line of a parameter over time, with the band that holds 95 %."""
    parameter, course = history.parameters[k], history.courses[k]
    colour, unit = group_colour(group_of(parameter.name)), parameter.unit
    years = np.linspace(history.years[0], 0.0, LINE_POINTS)
    design = np.column_stack([np.ones(LINE_POINTS), years])
    last = np.datetime64(history.dates[-1], "us")
    between = last + (years * YEAR * 1e6).astype("timedelta64[us]")
    line = to_display(design @ course.line.estimates, unit)
    variance = np.einsum("iu,uw,iw->i", design, course.line.covariance, design)
    half = to_display(course.sigmas_95 * np.sqrt(variance), unit)
    seen = ax.get_ylim()
    ax.fill_between(between, line - half, line + half, color=colour, alpha=0.15, linewidth=0)
    ax.plot(between, line, "-" if "drifts" in history.found[k] else ":", color=colour)
    # The band of a few calibrations would dwarf them.
    ax.set_ylim(seen[0] - 0.3 * np.ptp(seen), seen[1] + 0.3 * np.ptp(seen))
    locator = AutoDateLocator(minticks=2, maxticks=5)  # type: ignore[no-untyped-call]
    formatter = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
    ax.xaxis.set(major_locator=locator, major_formatter=formatter)


def interval_figure(interval: Interval) -> Figure:
    """Draw the tilt error that is not exceeded, over the time since the last calibration."""
    figure = new_figure(COLUMN, 55)
    ax = figure.subplots()
    last = min(MAX_YEARS, max(1.0, 1.5 * interval.years))
    years = np.linspace(0.0, last, LINE_POINTS)
    error = to_display([interval.error(t) for t in years], "rad")
    ax.plot(years, error, color=INK)
    ax.axhline(float(error[0]), color=INK, linewidth=0.8, linestyle=":")
    ax.annotate("a new calibration", (last, float(error[0])), (0, 2), textcoords="offset points",
                ha="right", fontsize=7)  # fmt: skip
    accuracy = float(to_display(interval.accuracy, "rad"))
    ax.axhline(accuracy, color=WRONG, linewidth=0.8)
    ax.annotate("accuracy", (0, accuracy), (2, 2), textcoords="offset points", fontsize=7,
                color=WRONG)  # fmt: skip
    ax.set(
        xlabel="years since the last calibration",
        ylabel=f"tilt error / {shown_unit('rad')}",
        xlim=(0, last),
        ylim=(0, 1.1 * max(float(error.max()), accuracy)),
    )
    ax.set_title(f"Not exceeded with {100 * interval.confidence:g} %")
    return figure
