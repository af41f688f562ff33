"""Figures 7 and 8: the paper's two calibrations, by gravity alone and with the robot."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import display_unit, unit_label
from accelstudy.drawing.style import (
    INK,
    Style,
    approach_colour,
    group_label,
    group_of,
    in_order,
    shown,
    symbol,
)
from accelstudy.study.figures.panels import Array, Panel, key, matrix, panels, points, write_values
from accelstudy.study.figures.registry import Tables, of_the_paper, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

APPROACHES = ("gravity", "robot")
ANNOTATED = 0.005
"""Correlations above this are written into their field."""
MOST_WRITTEN = 12
"""Most parameters of which the fields have room for numbers."""
WIDTH = 0.36
"""Width of a bar; the parameters are 1 apart."""


@register(
    "figure-7",
    category="Paper",
    tables=("summary", "quantiles"),
    when=of_the_paper,
)
def errors_and_sigmas(tables: Tables, study: Study) -> Figure:
    """Figure 7: errors and standard deviations of the two calibrations.

    Left: estimation errors of the first simulated calibration (open markers) before the middle 95
    % of the errors of all. Right: standard deviations a posteriori, mean of all calibrations
    (bars), the middle 95 % of single calibrations (lines with caps) and the first one (open
    markers). All parameters of one calibration share its variance of unit weight, so a single
    calibration is too low or too high for all of them at once; this spread is wider without the
    robot, which leaves fewer redundant conditions.
    """
    from matplotlib.patches import Patch

    parameters = _parameters(study)
    table, grid = single_runs(tables, study), []
    for unit in dict.fromkeys(parameters.values()):
        names = [name for name in parameters if parameters[name] == unit]
        title = " and ".join(group_label(g) for g in in_order(group_of(name) for name in names))
        rows = table[table["parameter"].isin(names)]
        rows = rows.assign(place=rows["parameter"].map(names.index))
        row = []
        for quantity, label in (("error", "error"), ("sd_posteriori", "sd a posteriori")):
            its = rows[rows["quantity"] == quantity]
            row.append(Panel(its, title, "", f"{label} / {unit_label(display_unit(unit))}"))
        grid.append(row)
    fig, axes = panels(grid, _draw_runs, 16 + 46 * len(grid), loc="left")
    for row, unit in zip(axes, dict.fromkeys(parameters.values()), strict=True):
        names = [symbol(name) for name in parameters if parameters[name] == unit]
        for ax in row:
            ax.set_xticks(range(len(names)), names)
            ax.set_xlim(-0.6, len(names) - 0.4)
            ax.grid(False, axis="x")
    fig.align_ylabels(axes)
    bars = [
        Patch(color=approach_colour(a), alpha=0.4, label=f"{a}, mean of all") for a in APPROACHES
    ]
    one: Style = {"color": INK, "marker": "o", "linestyle": "", "markerfacecolor": "white"}
    lines = [key("95 % of all simulations", color=INK), key("one simulation", **one)]
    fig.legend(handles=[*bars, *lines], loc="outside lower center", ncols=4)
    return fig


def single_runs(tables: Tables, study: Study) -> pd.DataFrame:
    """What single calibrations give, as shown: a row each approach, parameter and quantity.

    Its columns are `first`, the first calibration, `low` and `high`, the ends of the middle 95 %,
    and `mean`, that of an sd a posteriori; NaN where there is no redundancy.
    """
    import pandas as pd

    summary, quantiles, rows = tables["summary"], tables["quantiles"], []
    ends = quantiles[["cell", "quantity", "name", "value"]].assign(
        end=[f"{p:.3f}" for p in quantiles["probability"].astype(float)]
    )
    columns = {"error": ("first_error", None), "sd_posteriori": ("first_sd_posteriori", "mean")}
    for approach, cell in _cells(study).items():
        its = summary[(summary["cell"] == cell) & (summary["n_converged"] > 0)]
        for row in its.to_dict("records"):
            for quantity, (first, mean) in columns.items():
                at = (ends["cell"] == cell) & (ends["name"] == row["parameter"])
                at = ends[at & (ends["quantity"] == quantity)].set_index("end")["value"]
                values = [row[first], *(at.get(p, np.nan) for p in ("0.025", "0.975"))]
                values.append(row["sd_posteriori_mean"] if mean else np.nan)
                numbers = shown(values, row["unit"])[0]
                rows.append([approach, row["parameter"], quantity, *numbers])
    labels = ["approach", "parameter", "quantity", "first", "low", "high", "mean"]
    return pd.DataFrame(rows, columns=labels)


def _draw_runs(ax: Axes, rows: pd.DataFrame) -> None:
    """Draw bars of means, bars with caps of the middle 95 %, and markers of the first run."""
    offset = rows["approach"].map(APPROACHES.index) - 0.5
    rows = rows.assign(x=rows["place"] + offset * (WIDTH + 0.04))
    ax.axhline(0, color=INK, linewidth=0.6)
    for approach, its in rows.groupby("approach"):
        colour, x = approach_colour(str(approach)), its["x"].to_numpy()
        low, high, mean = (its[name].to_numpy(float) for name in ("low", "high", "mean"))
        ax.bar(x, np.nan_to_num(mean), WIDTH, color=colour, alpha=0.4)
        caps: Style = {"linestyle": "", "color": colour, "elinewidth": 1.2, "capsize": 3}
        ax.errorbar(x, (low + high) / 2, yerr=(high - low) / 2, **caps)
        for at in x[np.isnan(its["first"].to_numpy(float))]:
            ax.text(at, 0, "no redundancy ", rotation=90, ha="center", va="bottom", fontsize=7)
    points(ax, rows, y="first", markerfacecolor="white", zorder=4)


def _parameters(study: Study) -> dict[str, str]:
    """SI units of the parameters of the paper's model, by their names."""
    assert study.sensitivity is not None
    return {p.name: p.unit for p in study.sensitivity.model.parameters}


def _cells(study: Study) -> dict[str, str]:
    """Names of the paper's two cells by their approach."""
    assert study.sensitivity is not None
    return {name: study.sensitivity.cell(name) for name in APPROACHES}


@register(
    "figure-8",
    category="Paper",
    tables=("correlations",),
    when=of_the_paper,
    angles=False,
)
def correlations(tables: Tables, study: Study) -> Figure:
    """Figure 8: correlations of the parameters of the two calibrations.

    Absolute correlations of the estimated parameters less the identity, from the covariance matrix
    of the adjustment, without (left) and with (right) the robot. Both matrices share one colour
    scale, and values above 0.005 are written out. With evenly spread positions only the scales are
    correlated, and the robot all but removes that.
    """
    names = list(_parameters(study))
    matrices = [
        correlation_matrix(tables["correlations"], c, names) for c in _cells(study).values()
    ]
    largest = max((np.nanmax(values) for values in matrices if len(values)), default=0.0)
    colours: Style = {"cmap": "Blues", "vmin": 0, "vmax": max(0.1, np.ceil(largest * 20) / 20)}
    groups = [len(list(members)) for _, members in groupby(map(group_of, names))]

    def draw(ax: Axes, values: Array) -> None:
        image = matrix(ax, values, **colours)
        if len(names) <= MOST_WRITTEN:
            some = np.where(np.abs(values) > ANNOTATED, values, np.nan)
            write_values(ax, image, some, lambda value: f"{value:.2f}".replace("0.", "."))
        for edge in np.cumsum(groups)[:-1] - 0.5:  # between the groups of parameters
            ax.axhline(edge, color="#BBBBBB", linewidth=0.6)
            ax.axvline(edge, color="#BBBBBB", linewidth=0.6)

    titles = ("gravity-based", "robot-aided")
    row = [Panel(*each) for each in zip(matrices, titles, strict=True)]
    fig, axes = panels([row], draw, 84)
    for ax in axes[0]:
        ax.set_xticks(range(len(names)), map(symbol, names))
        ax.set_yticks(range(len(names)), map(symbol, names))
        ax.tick_params(length=0)
        ax.spines[:].set(visible=True, color="#BBBBBB")
    images = [image for ax in axes[0] for image in ax.images]
    if images:
        fig.colorbar(images[0], ax=axes, label="|correlation| − I", pad=0.02, shrink=0.8)
    return fig


def correlation_matrix(table: pd.DataFrame, cell: str, names: list[str]) -> Array:
    """Absolute correlations less the identity, (u, u); (0, 0) if there are none."""
    rows = table if table.empty else table[table["cell"] == cell]
    if rows.empty:
        return np.zeros((0, 0))
    square = rows.pivot_table("adjustment", "parameter_1", "parameter_2", dropna=False)
    return np.abs(square.reindex(index=names, columns=names).to_numpy(float)) - np.eye(len(names))
