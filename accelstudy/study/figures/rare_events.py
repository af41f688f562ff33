"""Rare events, once in thousands of calibrations: tails of tilt errors, and failures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.shares import Z95
from accelstudy.basics.units import unit_label
from accelstudy.drawing.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_handles,
    model_title,
    new_figure,
    say_empty,
    shown,
)
from accelstudy.study.figures.base import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

LINES: Style = {"roll": "-", "pitch": "--"}
MARKERS = {"roll": "o", "pitch": "s"}
POINTS: Style = {"markersize": 3, "elinewidth": 0.8}
MOST = 3
"""Number of set-ups whose tails are drawn, one panel each."""
NONE: Style = {"linestyle": "", "marker": "v", "markersize": 4, "fillstyle": "none"}


@register(
    "rare-events",
    "Tails of the tilt error, and calibrations that fail",
    """
    What happens once in thousands of calibrations and more. Left: the tilt error, as its rms over
    all attitudes up to the study's largest tilt, over the share of calibrations that leave more of
    it, for the least noise of the sensor in the study. Lines are quantiles of the calibrations of
    each cell, as far as their number reaches. Points are of calibrations that were drawn where
    linear theory expects large errors, and weighted; their intervals of 95 % are mostly shorter
    than the points are wide. Right: the share of calibrations that do
    not converge, over the noise of the sensor, with intervals of 95 %; a triangle is the upper
    limit where none failed.
    """,
    tables=("cells", "quantiles", "rare"),
    when=lambda study: study.rare is not None,
)
def rare_events(tables: Tables, study: StudyConfig) -> Figure:
    """Tilt error over the share of calibrations that leave more, and shares that do not converge.

    The tails are those of the set-ups with the least noise of the sensor.
    """
    from matplotlib.lines import Line2D

    cells, tilt, rare = tables["cells"], tables["quantiles"], tables["rare"]
    tilt = tilt[(tilt["quantity"] == "tilt") & (tilt["probability"] >= 0.5)]
    tilt = tilt[tilt["name"].isin(LINES)]
    tilt = tilt[tilt["sensor_sigma_mps2"] == tilt["sensor_sigma_mps2"].min()]
    setups = list(dict.fromkeys(zip(tilt["model"], tilt["scheme"], strict=True)))
    fig = new_figure(FULL, 72)
    *tails, failures = fig.subplots(1, max(len(setups[:MOST]), 1) + 1)
    if not setups:
        say_empty(tails[0])
    for ax, (model, scheme) in zip(tails, setups, strict=False):
        of_setup = tilt[(tilt["model"] == model) & (tilt["scheme"] == scheme)]
        _draw_tails(ax, of_setup)
        _draw_rare(ax, rare.merge(cells[["cell", "approach"]]), set(of_setup["cell"]))
        ax.set_ylim(bottom=0)
        ax.set_title(f"{model_title(model)}, {scheme}")
    _draw_failures(failures, cells[cells["n_replicates"] > 0])
    left_out = len(setups[MOST:])
    if left_out:
        fig.text(0, 0, f"{left_out} more set-ups are not drawn; their numbers are in the tables.")
    fig.legend(
        handles=[
            *approach_handles(dict.fromkeys(cells["approach"]), linestyle="-", marker=""),
            *(
                Line2D([], [], color=INK, linestyle=style, label=name, marker=MARKERS[name])
                for name, style in LINES.items()
            ),
            Line2D([], [], color=INK, label="none failed: 97.5 % limit", **NONE),
        ],
        loc="outside lower center",
        ncols=5,
    )
    return fig


def _draw_tails(ax: Axes, rows: pd.DataFrame) -> None:
    for (cell, name), quantiles in rows.groupby(["cell", "name"], sort=False):
        values, unit = shown(quantiles["value"], quantiles["unit"].iloc[0])
        colour = approach_colour(quantiles["approach"].iloc[0])
        beyond = 1 - quantiles["probability"].to_numpy(float)
        ax.plot(beyond, values, LINES[str(name)], color=colour, gid=f"{cell} {name}")
        ax.set_ylabel(f"tilt error / {unit}")
    ax.set_xscale("log")
    ax.invert_xaxis()
    ax.set_xlabel("share of calibrations that leave more")


def _draw_rare(ax: Axes, rare: pd.DataFrame, cells: set[str]) -> None:
    rows = rare[rare["cell"].isin(cells) & rare["name"].isin(LINES)]
    for (cell, name), points in rows.groupby(["cell", "name"], sort=False):
        values, _ = shown(points["value_mgon"], "mgon")
        half, _ = shown(Z95 * points["value_se_mgon"], "mgon")
        colour, marker = approach_colour(points["approach"].iloc[0]), MARKERS[str(name)]
        bars = ax.errorbar(points["share_beyond"], values, half, color=colour, fmt=marker, **POINTS)
        bars[0].set_gid(f"{cell} {name} rare")


def _draw_failures(ax: Axes, cells: pd.DataFrame) -> None:
    from accelstudy.basics.shares import clopper_pearson

    for approach, group in cells.groupby("approach", sort=False):
        group = group.sort_values("sensor_sigma_mps2")
        n = group["n_replicates"].to_numpy(float)
        failed = n - group["n_converged"].to_numpy(float)
        low, high = clopper_pearson(failed, n)
        share, sigma = failed / n, group["sensor_sigma_mps2"].to_numpy(float)
        colour, some = approach_colour(str(approach)), failed > 0
        bars = np.stack([share - low, high - share])[:, some]
        ax.errorbar(sigma[some], share[some], bars, color=colour, marker="o", elinewidth=0.8)
        ax.plot(sigma[~some], high[~some], color=colour, **NONE)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_title("not converged")
    ax.set_xlabel(f"sensor noise / {unit_label('m/s^2')}")
    ax.set_ylabel("share of calibrations")
