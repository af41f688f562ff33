"""What a noise setting or the number of positions does to the calibration."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from accelstudy.approaches import get_approach
from accelstudy.figures.registry import Tables, figure
from accelstudy.figures.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_handles,
    group_label,
    group_of,
    in_order,
    log_ticks,
    model_title,
    new_figure,
    say_empty,
    spread,
    unit_label,
)
from accelstudy.schemes import get_scheme
from accelstudy.study.config import StudyConfig


@dataclass(frozen=True)
class Swept:
    """A quantity that may vary over the cells: its column, its label and its size in SI."""

    column: str
    label: str
    unit: float = 1.0


NOISES = (
    Swept("sensor_sigma_mps2", "sensor noise $\\sigma_f$ / mm/s²", 1e-3),
    Swept("robot_sigma_mgon", "robot noise $\\sigma_r$ / mgon"),
    Swept("gravity_sigma_mps2", "sd of gravity $\\sigma_g$ / mm/s²", 1e-3),
    Swept("gravity_error_mps2", "error of gravity / mm/s²", 1e-3),
)
POSITIONS = Swept("n_positions", "number of positions $n$")
SYSTEMATIC = "gravity_error_mps2"
"""The quantity whose effect is a bias, which is drawn beside the sd."""
TILT = "tilt"
MARKERS = ("o", "^", "s", "D", "v", "P")
LINES = ("-", "--", ":", "-.")
BIAS_STYLE: Style = {"linestyle": ":", "linewidth": 0.8, "marker": "x", "markersize": 4}


def swept_noises(study: StudyConfig) -> tuple[Swept, ...]:
    """Noise settings of which a grid lists more than one value."""
    return tuple(
        noise
        for noise in NOISES
        if any(len(getattr(grid, noise.column) or ()) > 1 for grid in study.grids)
    )


def swept(study: StudyConfig) -> tuple[Swept, ...]:
    """All that varies: noise settings, and positions if a grid names schemes of one family."""
    lists = [[_family(name) for name in grid.schemes] for grid in study.grids]
    positions = any(len(families) > len(set(families)) for families in lists)
    return (*swept_noises(study), *((POSITIONS,) if positions else ()))


def _family(scheme: str) -> str:
    """Name of a scheme without its number of positions: "fibonacci" of "fibonacci-24"."""
    return re.sub(r"-\d+", "", scheme, count=1)


@figure(
    "sweep",
    title="Standard deviations and tilt error over what the study varies",
    category="Study",
    tables=("cells", "summary", "leveling"),
    when=lambda study: bool(swept(study)),
)
def over_what_varies(tables: Tables, study: StudyConfig) -> Figure:
    """Panels for each group of parameters and for the tilt error; rows for what varies."""
    values = _group_values(tables["summary"], tables["leveling"])
    values = values.merge(tables["cells"][["cell", "n_positions"]], on="cell")
    rows_of = {quantity: _rows_of(values, quantity, study) for quantity in swept(study)}
    series = list(dict.fromkeys(name for rows in rows_of.values() for name in rows["series"]))
    panels = {
        quantity: [*in_order(set(rows["group"]) - {TILT}), TILT]
        for quantity, rows in rows_of.items()
    }
    lines = {quantity: 1 if len(names) <= 3 else 2 for quantity, names in panels.items()}
    fig = new_figure(FULL, 24 + 48 * sum(lines.values()))
    parts = fig.subfigures(len(lines), 1, height_ratios=list(lines.values()), squeeze=False)[:, 0]
    for part, (quantity, rows) in zip(parts, rows_of.items(), strict=True):
        names = panels[quantity]
        axes = part.subplots(lines[quantity], -(-len(names) // lines[quantity]), squeeze=False)
        for ax in axes.ravel()[len(names) :]:
            ax.set_axis_off()
        for ax, name in zip(axes.ravel(), names, strict=False):
            _draw_panel(ax, rows[rows["group"] == name], quantity, series)
            ax.set_title("tilt error (roll, rms)" if name == TILT else group_label(name))
            ax.set_xlabel(quantity.label)
    _add_legend(fig, values, series, tuple(rows_of))
    return fig


def _group_values(summary: pd.DataFrame, leveling: pd.DataFrame) -> pd.DataFrame:
    """One row per cell and group: mean sd, rms bias and whether any bias is significant."""
    labels = ["cell", "model", "scheme", "approach", *(noise.column for noise in NOISES)]
    low, high = summary["bias_ci95_low"], summary["bias_ci95_high"]
    parameters = summary.assign(
        group=[group_of(name) for name in summary["parameter"]],
        significant=(low > 0) | (high < 0),
        squared=summary["bias"] ** 2,
    )
    groups = parameters.groupby([*labels, "group", "unit"], sort=False, as_index=False).agg(
        sd=("sd_empirical", "mean"), squared=("squared", "mean"), significant=("significant", "all")
    )
    groups["bias"] = groups.pop("squared") ** 0.5
    if leveling.empty:
        return groups
    tilt = leveling[[*labels, "roll_rms_mgon"]].rename(columns={"roll_rms_mgon": "sd"})
    return pd.concat([groups, tilt.assign(group=TILT, unit="mgon", significant=False)])


def _rows_of(values: pd.DataFrame, quantity: Swept, study: StudyConfig) -> pd.DataFrame:
    """Rows in which all else is as in the study, with x and the name of the series."""
    usual = {
        "sensor_sigma_mps2": study.sigma_force,
        "robot_sigma_mgon": study.noise.robot.sigma_mgon,
        "gravity_sigma_mps2": study.noise.gravity.sigma_mps2,
        "gravity_error_mps2": study.noise.gravity.error_mps2,
    }
    rows = values
    for column, value in usual.items():
        if column != quantity.column:
            same = np.isclose(rows[column], value, rtol=1e-6)
            if column == "robot_sigma_mgon":
                same |= _without_robot(rows)
            rows = rows[same]
    if quantity is POSITIONS:
        families = rows["scheme"].map(_family)
        rows = rows[rows["scheme"].groupby(families).transform("nunique") > 1]
        names = rows["scheme"].map(lambda name: get_scheme(name).title.partition(" ")[2])
    else:
        names = rows["scheme"].map(lambda name: get_scheme(name).title)
    return rows.assign(
        x=rows[quantity.column] / quantity.unit,
        series=rows["model"].map(model_title) + " | " + names,
    )


def _without_robot(rows: pd.DataFrame) -> pd.Series:
    """Whether the approach of a cell makes no use of the robot's angles."""
    return ~rows["approach"].map(lambda name: get_approach(name).uses_angles).astype(bool)


def _draw_panel(ax: Axes, rows: pd.DataFrame, quantity: Swept, series: list[str]) -> None:
    rows = rows[rows["sd"].gt(0)]
    if rows.empty:
        ax.set_xticks([])
        ax.set_yticks([])
        say_empty(ax)
        return
    for (name, approach), its in rows.groupby(["series", "approach"], sort=False):
        its = its.sort_values("x")
        style = _series_style(series.index(str(name)))
        style["color"] = approach_colour(str(approach))
        if quantity.column == "robot_sigma_mgon" and _without_robot(its).all():
            ax.axhline(its["sd"].mean(), **{**style, "marker": ""}, linewidth=0.8)
            continue
        ax.plot(its["x"], its["sd"], **style)
        seen = its[its["significant"].astype(bool)]
        if quantity.column == SYSTEMATIC and len(seen):
            ax.plot(seen["x"], seen["bias"], color=style["color"], **BIAS_STYLE)
    ax.set_yscale("log")
    log_ticks(ax.yaxis, *ax.get_ylim())
    what = "rms" if rows["group"].iloc[0] == TILT else "sd"
    if quantity.column == SYSTEMATIC and what == "sd":
        what = "sd, |bias|"
    ax.set_ylabel(f"{what} / {unit_label(rows['unit'].iloc[0])}")
    if quantity.column == "robot_sigma_mgon":
        rows = rows[~_without_robot(rows)]
    _scale_x(ax, np.unique(rows["x"].to_numpy(float)))


def _series_style(i: int) -> Style:
    return {
        "linestyle": LINES[i % len(LINES)],
        "marker": MARKERS[i % len(MARKERS)],
        "markersize": 3,
    }


def _scale_x(ax: Axes, x: NDArray[np.float64]) -> None:
    """Logarithmic axis, linear about zero if zero is among the values, with ticks at the values."""
    if len(x) < 2:
        ax.set_xticks(x)
        return
    sizes = np.abs(x[x != 0])
    if (x > 0).all():
        ax.set_xscale("log")
    else:
        ax.set_xscale("symlog", linthresh=sizes.min(), linscale=0.5)
    places = ax.transScale.transform(np.column_stack([x, np.ones_like(x)]))[:, 0]
    labelled = spread(places, 0.15 * np.ptp(places))
    ax.set_xticks(x, [f"{value:g}" if i in labelled else "" for i, value in enumerate(x)])
    pad = 0.05 * np.ptp(places)
    ends = np.array([[places[0] - pad, 0], [places[-1] + pad, 0]])
    ax.set_xlim(*ax.transScale.inverted().transform(ends)[:, 0])
    ax.xaxis.set_minor_locator(NullLocator())


def _add_legend(
    fig: Figure, values: pd.DataFrame, series: list[str], quantities: tuple[Swept, ...]
) -> None:
    handles = approach_handles(dict.fromkeys(values["approach"]), marker="", linestyle="-")
    if len(series) > 1:
        handles += [
            Line2D([], [], color=INK, label=name, **_series_style(i))
            for i, name in enumerate(series)
        ]
    if any(quantity.column == SYSTEMATIC for quantity in quantities):
        handles.append(Line2D([], [], color=INK, label="|bias|, if significant", **BIAS_STYLE))
    columns = 2 if any(len(name) > 40 for name in series) else 3
    fig.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=3)
