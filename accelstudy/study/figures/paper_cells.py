"""Figures 7 and 8: the paper's two calibrations, by gravity alone and with the robot."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import display_unit, unit_label
from accelstudy.drawing.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_marker,
    group_label,
    group_of,
    in_order,
    ink_on,
    new_figure,
    say_empty,
    shown,
    symbol,
)
from accelstudy.sensors.models import get_model
from accelstudy.study.figures.base import Tables, of_the_paper, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

    from accelstudy.study.config import StudyConfig

APPROACHES = ("gravity", "robot")
ANNOTATED = 0.005
"""Correlations above this are written into their field."""
WIDTH = 0.36
"""Width of a bar; the parameters are 1 apart."""


@register(
    "figure-7",
    "Figure 7: errors and standard deviations of the two calibrations",
    """
    Left: estimation errors of the first simulated calibration (open markers) before the middle 95
    % of the errors of all. Right: standard deviations a posteriori, mean of all calibrations
    (bars), the middle 95 % of single calibrations (lines with caps) and the first one (open
    markers). All parameters of one calibration share its variance of unit weight, so a single
    calibration is too low or too high for all of them at once; this spread is wider without the
    robot, which leaves fewer redundant conditions.
    """,
    category="Paper",
    tables=("summary", "quantiles"),
    when=of_the_paper,
)
def errors_and_sigmas(tables: Tables, study: StudyConfig) -> Figure:
    """One simulation before the distribution of all, a row of panels for each unit."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    parameters = _parameters(study)
    units = list(dict.fromkeys(unit for _, unit in parameters))
    fig = new_figure(FULL, 16 + 46 * len(units))
    axes = fig.subplots(len(units), 2, squeeze=False)
    for row, unit in zip(axes, units, strict=True):
        names = [name for name, si_unit in parameters if si_unit == unit]
        shown = unit_label(display_unit(unit))
        for ax in row:
            ax.axhline(0, color=INK, linewidth=0.6)
            ax.set_xticks(range(len(names)), [symbol(name) for name in names])
            ax.set_xlim(-0.6, len(names) - 0.4)
            ax.grid(False, axis="x")
        row[0].set_ylabel(f"error / {shown}")
        row[1].set_ylabel(f"sd a posteriori / {shown}")
        drawn = False
        for cell, approach in _cells(study):
            for x, name in enumerate(names):
                runs = _single_runs(tables, cell, name)
                if runs is not None:
                    drawn = True
                    _draw_parameter(row, x, runs, approach)
        if not drawn:
            for ax in row:
                say_empty(ax)
        groups = " and ".join(group_label(g) for g in in_order(group_of(name) for name in names))
        for ax in row:
            ax.set_title(groups, loc="left")
    one: Style = {"color": INK, "marker": "o", "markersize": 4, "linestyle": ""}
    fig.align_ylabels(axes)
    fig.legend(
        handles=[
            *[
                Patch(color=approach_colour(name), alpha=0.4, label=f"{name}, mean of all")
                for name in APPROACHES
            ],
            Line2D([], [], color=INK, label="95 % of all simulations"),
            Line2D([], [], **one, markerfacecolor="white", label="one simulation"),
        ],
        loc="outside lower center",
        ncols=4,
    )
    return fig


def _parameters(study: StudyConfig) -> list[tuple[str, str]]:
    """Names and SI units of the parameters of the paper's model."""
    assert study.sensitivity is not None
    model = get_model(study.sensitivity.model, study.models)
    return [(parameter.name, parameter.unit) for parameter in model.parameters]


def _cells(study: StudyConfig) -> list[tuple[str, str]]:
    """Name and approach of the paper's two cells."""
    assert study.sensitivity is not None
    setting = study.sensitivity
    return [(f"{setting.model}/{setting.scheme}/{name}", name) for name in APPROACHES]


@dataclass(frozen=True)
class _SingleRuns:
    """One parameter of one cell as shown: what single simulations give.

    Attributes
    ----------
    errors, sds : the first calibration, and the ends of the middle 95 %
    mean_sd : float; NaN without redundancy, and so are the sds
    """

    errors: tuple[float, float, float]
    sds: tuple[float, float, float]
    mean_sd: float


def _single_runs(tables: Tables, cell: str, name: str) -> _SingleRuns | None:
    """Numbers of one parameter; None if there is no calibration."""
    rows = tables["summary"]
    rows = rows[(rows["cell"] == cell) & (rows["parameter"] == name)]
    if rows.empty or not rows["n_converged"].iloc[0]:
        return None
    row = rows.iloc[0]
    table = tables["quantiles"]
    table = table[(table["cell"] == cell) & (table["name"] == name)]

    def three(first: str, quantity: str) -> tuple[float, float, float]:
        quantiles = table[table["quantity"] == quantity]
        ends = [
            quantiles["value"][np.isclose(quantiles["probability"], p)].max()
            for p in (0.025, 0.975)
        ]
        values = shown([row[first], *ends], row["unit"])[0]
        return float(values[0]), float(values[1]), float(values[2])

    return _SingleRuns(
        three("first_error", "error"),
        three("first_sd_posteriori", "sd_posteriori"),
        float(shown(row["sd_posteriori_mean"], row["unit"])[0]),
    )


def _draw_parameter(axes: NDArray[np.object_], x: int, runs: _SingleRuns, approach: str) -> None:
    """Draw one parameter of one approach into the panels of errors and of sds."""
    colour, marker = approach_colour(approach), approach_marker(approach)
    at = x + (APPROACHES.index(approach) - 0.5) * (WIDTH + 0.04)
    one: Style = {
        "marker": marker,
        "markersize": 4,
        "color": colour,
        "markerfacecolor": "white",
        "zorder": 4,
    }
    _draw_range(axes[0], at, *runs.errors[1:], colour)
    axes[0].plot(at, runs.errors[0], **one)
    if np.isfinite(runs.mean_sd):
        axes[1].bar(at, runs.mean_sd, WIDTH, color=colour, alpha=0.4)
        _draw_range(axes[1], at, *runs.sds[1:], colour)
        axes[1].plot(at, runs.sds[0], **one)
    else:
        axes[1].text(at, 0, "no redundancy ", rotation=90, ha="center", va="bottom", fontsize=7)


def _draw_range(ax: Axes, at: float, low: float, high: float, colour: str) -> None:
    """Bar with caps from low to high."""
    ax.errorbar(
        at, (low + high) / 2, yerr=(high - low) / 2, color=colour, elinewidth=1.2, capsize=3
    )


@register(
    "figure-8",
    "Figure 8: correlations of the parameters of the two calibrations",
    """
    Absolute correlations of the estimated parameters less the identity, from the covariance matrix
    of the adjustment, without (left) and with (right) the robot. Both matrices share one colour
    scale, and values above 0.005 are written out. With evenly spread positions only the scales are
    correlated, and the robot all but removes that.
    """,
    category="Paper",
    tables=("correlations",),
    when=of_the_paper,
    angles=False,
)
def correlations(tables: Tables, study: StudyConfig) -> Figure:
    """Absolute correlations less the identity, from the cofactors of the adjustment."""
    names = [name for name, _ in _parameters(study)]
    matrices = {
        approach: _matrix(tables["correlations"], cell, names) for cell, approach in _cells(study)
    }
    largest = max(
        (np.nanmax(matrix) for matrix in matrices.values() if matrix is not None), default=0
    )
    top = max(0.1, np.ceil(largest * 20) / 20)
    fig = new_figure(FULL, 84)
    axes = fig.subplots(1, 2)
    image = None
    for ax, (approach, matrix) in zip(axes, matrices.items(), strict=True):
        ax.set_title(f"{approach}-based" if approach == "gravity" else f"{approach}-aided")
        ax.grid(False)
        ax.set_xticks(range(len(names)), [symbol(name) for name in names])
        ax.set_yticks(range(len(names)), [symbol(name) for name in names])
        ax.tick_params(length=0)
        ax.spines[:].set(visible=True, color="#BBBBBB")
        if matrix is None:
            say_empty(ax)
            continue
        image = ax.imshow(matrix, cmap="Blues", vmin=0, vmax=top)
        _write_values(ax, image, matrix)
        _separate(ax, [group_of(name) for name in names])
    if image is not None:
        fig.colorbar(image, ax=axes, label="|correlation| − I", pad=0.02, shrink=0.8)
    return fig


def _matrix(table: pd.DataFrame, cell: str, names: list[str]) -> NDArray[np.float64] | None:
    rows = table if table.empty else table[table["cell"] == cell]
    if rows.empty:
        return None
    square = rows.pivot_table("adjustment", "parameter_1", "parameter_2", dropna=False)
    return np.abs(square.reindex(index=names, columns=names).to_numpy(float)) - np.eye(len(names))


def _write_values(ax: Axes, image: AxesImage, matrix: NDArray[np.float64]) -> None:
    if len(matrix) > 12:  # no room
        return
    for i, j in np.argwhere(np.abs(matrix) > ANNOTATED):
        ax.text(
            j,
            i,
            f"{matrix[i, j]:.2f}".replace("0.", "."),
            ha="center",
            va="center",
            fontsize=7,
            color=ink_on(image, matrix[i, j]),
        )


def _separate(ax: Axes, groups: list[str]) -> None:
    """Thin lines between the groups of parameters."""
    edge = -0.5
    for _, members in groupby(groups):
        edge += len(list(members))
        if edge < len(groups) - 1:
            ax.axhline(edge, color="#BBBBBB", linewidth=0.6)
            ax.axvline(edge, color="#BBBBBB", linewidth=0.6)
