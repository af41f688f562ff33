"""Figures 7 and 8: the paper's two calibrations, by gravity alone and with the robot."""

from __future__ import annotations

import numpy as np

from accelstudy.drawing import style
from accelstudy.study.config import APPROACHES
from accelstudy.study.figures.panels import Image, fields, handle, in_shown_units, panels, points
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

MIN_WRITTEN = 0.005
"""Correlations above this are written into their field."""
WIDTH = 0.36
"""Width of a bar; the parameters are 1 apart."""


@register("figure-7", "summary", "quantiles", category="Paper")
def errors_and_sigmas(tables: Tables, study: Study) -> Figure:
    """Figure 7: errors and standard deviations of the two calibrations.

    Left: estimation errors of the first simulated calibration (open markers) before the middle 95
    % of the errors of all. Right: standard deviations a posteriori, mean of all calibrations
    (bars), the middle 95 % of single calibrations (lines with caps) and the first one (open
    markers). All parameters of one calibration share its variance of unit weight, so a single
    calibration is too low or too high for all of them at once; this spread is wider without the
    robot, which leaves fewer redundant conditions. Without redundancy there is none.
    """

    def draw(ax: Axes, rows: DataFrame) -> None:
        names = list(rows["parameter"].unique())
        side = rows["approach"].map(APPROACHES.index) - 0.5
        rows = rows.assign(x=rows["parameter"].map(names.index) + side * (WIDTH + 0.04))
        ax.axhline(0, color=style.INK, linewidth=0.6)
        for approach, its in rows.groupby("approach"):
            colour = style.approach_colour(str(approach))
            ax.bar(its["x"], its["mean"], WIDTH, alpha=0.4, color=colour)
            middle, half = (its["low"] + its["high"]) / 2, (its["high"] - its["low"]) / 2
            ax.errorbar(its["x"], middle, half, linestyle="", capsize=3, color=colour)
        points(ax, rows, y="first", markerfacecolor="white", zorder=4)
        ax.set_xticks(range(len(names)), map(style.symbol, names))
        ax.set_xlim(-0.6, len(names) - 0.4)
        ax.grid(False, axis="x")

    colours = {name: style.approach_colour(name) for name in APPROACHES}
    legend = [
        *(handle(f"{n}, mean of all", color=c, alpha=0.4, linewidth=6) for n, c in colours.items()),
        handle("95 % of all simulations"),
        handle("one simulation", marker="o", linestyle="", markerfacecolor="white"),
    ]
    return panels(
        single_runs(tables, study),
        draw,
        46,
        row="group",
        column="quantity",
        title="{group}",
        ylabel="{quantity} / {unit}",
        legend=legend,
        sharex=False,
        sharey=False,
    )


def single_runs(tables: Tables, study: Study) -> DataFrame:
    """What single calibrations give, as shown: a row each approach, parameter and quantity.

    Its columns are `first`, the first calibration, `low` and `high`, the ends of the middle 95 %,
    and `mean`, that of an sd a posteriori; NaN where there is no redundancy.
    """
    import pandas as pd

    ends = paper_cells(tables["quantiles"], study).rename(columns={"name": "parameter"})
    ends = ends.assign(end=ends["probability"].map({0.025: "low", 0.975: "high"}))
    names = ["approach", "quantity", "parameter"]
    ends = ends.pivot_table("value", names, "end")
    ends = ends.reindex(columns=["low", "high"]).rename({"sd_posteriori": "sd a posteriori"})
    rows = paper_cells(tables["summary"], study)
    rows = rows[(rows["n_converged"] > 0) & (rows["parameter"] != "g")]
    rows = rows.assign(group=rows["parameter"].map(style.group_of).map(style.group_label))
    errors = rows.assign(quantity="error", first=rows["first_error"], mean=np.nan)
    sds = {"first": rows["first_sd_posteriori"], "mean": rows["sd_posteriori_mean"]}
    table = pd.concat([errors, rows.assign(quantity="sd a posteriori", **sds)], ignore_index=True)
    table = table.join(ends, on=names)
    return in_shown_units(table, "first", "mean", "low", "high")


def paper_cells(table: DataFrame, study: Study) -> DataFrame:
    """Rows of the paper's two cells, with their approach."""
    assert study.sensitivity is not None
    cells = {study.sensitivity.cell(name): name for name in APPROACHES}
    table = table[table["cell"].isin(cells)]
    return table.assign(approach=table["cell"].map(cells))


@register("figure-8", "correlations", category="Paper")
def correlations_of_parameters(tables: Tables, study: Study) -> Figure:
    """Figure 8: correlations of the parameters of the two calibrations.

    Absolute correlations of the estimated parameters less the identity, from the covariance matrix
    of the adjustment, without (left) and with (right) the robot. Both matrices share one colour
    scale, and values above 0.005 are written out. With evenly spread positions only the scales are
    correlated, and the robot all but removes that.
    """
    table = correlation_table(tables, study)
    symbols = {name: style.symbol(name) for name in table["parameter_1"].unique()}
    groups = np.array([style.group_of(name) for name in symbols])
    edges = np.flatnonzero(groups[1:] != groups[:-1]) + 0.5
    look: style.Style = {"cmap": "Blues", "vmin": 0, "vmax": max(0.1, table["number"].max())}

    def draw(ax: Axes, rows: DataFrame) -> Image:
        for lines in (ax.hlines, ax.vlines):  # between the groups of parameters
            lines(edges, -0.5, len(groups) - 0.5, "#BBBBBB", linewidth=0.6)
        return fields(ax, rows, ("parameter_1", symbols), ("parameter_2", symbols), **look)

    return panels(
        table,
        draw,
        72,
        column="title",
        colours="|correlation| − I",
    )


def correlation_table(tables: Tables, study: Study) -> DataFrame:
    """Correlations of the two calibrations: `number` is the absolute value less the identity."""
    table = paper_cells(tables["correlations"], study).dropna(subset="adjustment")
    identity = table["parameter_1"] == table["parameter_2"]
    titles = table["approach"].map({"gravity": "gravity-based", "robot": "robot-aided"})
    number = table["adjustment"].abs() - identity
    texts = [f"{x:.2f}".lstrip("0") if x > MIN_WRITTEN else "" for x in number]
    return table.assign(number=number, text=texts, title=titles)
