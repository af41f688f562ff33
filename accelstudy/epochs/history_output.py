"""What a history of calibrations writes: JSON, a table, a figure and a page."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure

from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import estimate
from accelstudy.campaign.calibration.document import write_json
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import COLUMN, FULL, INK, group_colour, group_of, new_figure, symbol
from accelstudy.epochs.congruence import LEVEL
from accelstudy.epochs.history import YEAR, History
from accelstudy.epochs.interval import LONGEST, SHOWN, Interval
from accelstudy.epochs.output import STATES, change_of, largest
from accelstudy.files.parquet import write_frame
from accelstudy.pages import lines, write_page

COLUMNS = 3
"""Panels side by side."""
WRONG = "#C2247A"
"""Colour of what must not be exceeded."""
GRID = 50
"""Points of a line."""


def history_said(history: History, interval: Interval | None = None) -> list[str]:
    """Say what drifts and what scatters; the verdict comes first."""
    rates, scatters, others, unsure = [], [], [], []
    for course, parameter, found in zip(
        history.courses, history.parameters, history.found, strict=True
    ):
        if "drifts" in found:
            rates.append(change_of(parameter, *course.rate))
            if course.may_wander(history.level):
                unsure.append(change_of(parameter, *course.wandering_rate))
        if "scatters" in found:
            size = estimate(course.line.scatter, course.line.scatter, parameter.unit)[1]
            scatters.append(f"{parameter.name} by {size} {shown_unit(parameter.unit)}".strip())
        if "changed" in found:
            others.append(parameter.name)
    least = [
        largest(history.parameters, [c.detectable_rate(history.level) for c in history.courses]),
        largest(history.parameters, [c.detectable_scatter(history.level) for c in history.courses]),
    ]
    return lines(
        "epochs/wording.txt.j2",
        "history",
        history,
        rates,
        unsure,
        scatters,
        others,
        least,
        interval,
    )


def history_document(history: History, interval: Interval | None = None) -> dict[str, Any]:
    """Describe a history, in SI but for keys that name another unit; rates are per year."""
    h = history
    return {
        "schema_version": 1,
        "sensor": next((c.content["sensor"] for c in h.calibrations if c.content["sensor"]), None),
        "calibrations": [
            {
                "campaign": one.content["campaign"],
                "date": date.isoformat(),
                "left_out": h.common.missing_in(one),
            }
            for one, date in zip(h.calibrations, h.dates, strict=True)
        ],
        "effects": [effect.spec for effect in h.common.model.effects],
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
        "interval": None if interval is None else _interval(interval),
        "verdict": " ".join(history_said(h, interval)),
    }


def _interval(interval: Interval) -> dict[str, Any]:
    """Describe how long the last calibration stays good enough."""
    return {
        "years": interval.years,
        "until": interval.until.date().isoformat(),
        "accuracy_mgon": interval.accuracy / MGON,
        "max_tilt_gon": interval.tilt_range / GON,
        "confidence": interval.confidence,
        "errors": [{"years": years, "mgon": interval.error(years) / MGON} for years in SHOWN],
    }


def history_table(history: History) -> pd.DataFrame:
    """Return a row per calibration and parameter, in SI."""
    sigmas = np.sqrt(np.diagonal(history.common.covariances, axis1=1, axis2=2))
    return pd.DataFrame(
        [
            {
                "calibration": number,
                "campaign": one.content["campaign"],
                "date": date.isoformat(),
                "parameter": parameter.name,
                "value": float(history.common.values[number - 1, k]),
                "sigma": float(sigmas[number - 1, k]),
                "unit": parameter.unit,
            }
            for number, (one, date) in enumerate(
                zip(history.calibrations, history.dates, strict=True), start=1
            )
            for k, parameter in enumerate(history.parameters)
        ]
    )


def write_history(
    history: History, folder: str | Path, interval: Interval | None = None
) -> dict[str, Any]:
    """Write history.json, history.parquet, report.html and the figure; returns the content."""
    folder, content = Path(folder), history_document(history, interval)
    figures = {"history": lambda: history_figure(history)}
    if interval is not None:
        figures["interval"] = lambda: interval_figure(interval)
    drawn = save_all(figures, folder / "figures")
    sentences = history_said(history, interval)
    write_page(
        folder / "report.html",
        "epochs/history.html.j2",
        " ".join(sentences),
        doc=content,
        lines=sentences,
        figures=drawn,
    )
    write_frame(folder / "history.parquet", history_table(history))
    write_json(folder / "history.json", content)
    return content


def history_figure(history: History) -> Figure:
    """Draw each parameter over time with 95 % intervals, and its line."""
    h = history
    rows = -(-len(h.parameters) // COLUMNS)
    figure = new_figure(FULL, 12 + 36 * rows)
    panels = figure.subplots(rows, COLUMNS, sharex=True, squeeze=False).ravel()
    sigmas = np.sqrt(np.diagonal(h.common.covariances, axis1=1, axis2=2))
    dates = np.array(h.dates, dtype="datetime64[us]")
    years = np.linspace(h.years[0], 0.0, GRID)
    design = np.column_stack([np.ones(GRID), years])
    between = dates[-1] + (years * YEAR * 1e6).astype("timedelta64[us]")
    for k, (ax, parameter, course) in enumerate(zip(panels, h.parameters, h.courses, strict=False)):
        colour, unit = group_colour(group_of(parameter.name)), parameter.unit
        values, halves = (to_display(v[:, k], unit) for v in (h.common.values, 1.96 * sigmas))
        ax.errorbar(dates, values, halves, fmt="o", color=INK, capsize=2, linewidth=0.8, ms=3)
        seen = ax.get_ylim()
        line = to_display(design @ course.line.estimates, unit)
        variance = np.einsum("iu,uw,iw->i", design, course.line.covariance, design)
        half = to_display(course.sigmas_95 * np.sqrt(variance), unit)
        ax.fill_between(between, line - half, line + half, color=colour, alpha=0.15, linewidth=0)
        ax.plot(between, line, "-" if "drifts" in h.found[k] else ":", color=colour)
        # The band of a few calibrations would dwarf them.
        ax.set_ylim(seen[0] - 0.3 * np.ptp(seen), seen[1] + 0.3 * np.ptp(seen))
        said = f" ({' and '.join(h.found[k])})" if h.found[k] else ""
        ax.set_title(symbol(parameter.name) + said)
        ax.set_ylabel(shown_unit(unit))
        locator = AutoDateLocator(minticks=2, maxticks=5)  # type: ignore[no-untyped-call]
        formatter = ConciseDateFormatter(locator)  # type: ignore[no-untyped-call]
        ax.xaxis.set(major_locator=locator, major_formatter=formatter)
        ax.tick_params(axis="x", labelbottom=k + COLUMNS >= len(h.parameters))
    for ax in panels[len(h.parameters) :]:
        ax.set_visible(False)
    figure.suptitle("Calibrations and lines with 95 % intervals; dotted: no drift found")
    return figure


def interval_figure(interval: Interval) -> Figure:
    """Draw the tilt error that is not exceeded, over the time since the last calibration."""
    figure = new_figure(COLUMN, 55)
    ax = figure.subplots()
    last = min(LONGEST, max(1.0, 1.5 * interval.years))
    years = np.linspace(0.0, last, GRID)
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
