"""Figures 4, 5 and 6: total effects of forces and parameters on roll and pitch."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullLocator
from numpy.typing import NDArray

from accelstudy.figures.registry import Tables, figure
from accelstudy.figures.style import (
    FULL,
    HATCH,
    MISSING,
    Style,
    group_colour,
    group_label,
    group_of,
    in_order,
    new_figure,
    say_empty,
    symbol,
)
from accelstudy.sensitivity import FORCES, OUTPUTS
from accelstudy.study.config import StudyConfig

GREEK = {"roll": "$\\phi$", "pitch": "$\\theta$"}
LINE_STYLES = ("-", "--", ":")
MARKERS = ("o", "^", "s")
"""Styles of the first, second and third member of a group."""
SMALLEST = 1e-4
"""Total effects below this share are drawn as zero."""
ZERO = 5e-5
"""Where zero is drawn on the log axis."""
NO_DATA = "no total effects"


@figure(
    "figure-4",
    title="Figure 4: total effects of the forces on roll and pitch",
    category="Paper",
    tables=("sensitivity",),
    when=lambda study: study.paper,
)
def effects_of_forces(tables: Tables, study: StudyConfig) -> Figure:
    """Maps over roll and pitch, one for each output and force."""
    table = _read(tables["sensitivity"], "forces")
    fig = new_figure(FULL, 92)
    axes = fig.subplots(len(OUTPUTS), len(FORCES), sharex=True, sharey=True)
    image = None
    for row, output in zip(axes, OUTPUTS, strict=True):
        for ax, force in zip(row, FORCES, strict=True):
            cells = table[(table["output"] == output) & (table["input"] == force)]
            ax.set_title(f"{symbol(force)} on {output} {GREEK[output]}")
            ax.grid(False)
            if cells.empty:
                say_empty(ax, NO_DATA)
                continue
            grid = cells.pivot_table("share", "pitch_gon", "roll_gon", dropna=False)
            roll, pitch = grid.columns.to_numpy(float), grid.index.to_numpy(float)
            ax.patch.set(facecolor=MISSING, hatch=HATCH, edgecolor="#999999")
            image = ax.pcolormesh(
                _edges(roll), _edges(pitch), grid.to_numpy(float), vmin=0, vmax=1, cmap="viridis"
            )
    for ax in axes[-1]:
        ax.set_xlabel("roll $\\phi$ / gon")
    for ax in axes[:, 0]:
        ax.set_ylabel("pitch $\\theta$ / gon")
    if image is not None:
        fig.colorbar(image, ax=axes, label="total effect (share of variance)", pad=0.02)
    return fig


def _register(number: int, output: str, approach: str, suffix: str) -> None:
    """Register figure 5 or 6 for the standard deviations of one calibration."""

    def effects_over_roll(tables: Tables, study: StudyConfig) -> Figure:
        return _effects_over_roll(_read(tables["sensitivity"], approach), output)

    figure(
        f"figure-{number}{suffix}",
        title=f"Figure {number}: total effects on {output}, {approach}-based calibration",
        category="Paper",
        tables=("sensitivity",),
        when=lambda study: study.paper,
    )(effects_over_roll)


for _approach, _suffix in (("gravity", ""), ("robot", "-robot")):
    _register(5, "roll", _approach, _suffix)
    _register(6, "pitch", _approach, _suffix)


def _read(table: pd.DataFrame, analysis: str) -> pd.DataFrame:
    """Rows of an analysis with `share`: NaN if undefined, 0 if within its confidence interval."""
    rows = table[table["analysis"] == analysis]
    share = rows["total_effect"].where(rows["total_effect"].abs() > rows["ci95"], 0.0)
    return rows.assign(share=share.where(rows["defined"].astype(bool)))


def _edges(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Edges of the fields around the values of a grid; the outer ones end at the grid."""
    middle = (centres[1:] + centres[:-1]) / 2
    if len(centres) == 1:
        return np.array([centres[0] - 1, centres[0] + 1])
    return np.concatenate([centres[:1], middle, centres[-1:]])


def _effects_over_roll(table: pd.DataFrame, output: str) -> Figure:
    table = table[(table["output"] == output) & (table["pitch_gon"] >= 0)]
    pitches = sorted(table["pitch_gon"].unique())
    columns = min(2, max(1, len(pitches)))
    rows = max(1, -(-len(pitches) // columns))
    fig = new_figure(FULL, 28 + 55 * rows)
    axes = fig.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    inputs = list(dict.fromkeys(table["input"]))
    styles = _styles(inputs)
    for ax, pitch in zip(axes, pitches, strict=False):
        _draw_pitch(ax, table[table["pitch_gon"] == pitch], styles)
        ax.set_title(f"pitch $\\theta$ = {pitch:g} gon")
    for ax in axes[len(pitches) :]:
        ax.set_axis_off()
    if not pitches:
        say_empty(axes[0], NO_DATA)
    for i, ax in enumerate(axes):
        if i >= len(axes) - columns:
            ax.set_xlabel("roll $\\phi$ / gon")
        if i % columns == 0:
            ax.set_ylabel(f"total effect on {output}")
    if styles:
        groups = in_order(group_of(name) for name in inputs)
        handles = [
            Line2D([], [], **styles[name], label=f"{group_label(group)} {symbol(name)}")
            for group in groups
            for name in inputs
            if group_of(name) == group
        ]
        fig.legend(handles=handles, loc="outside lower center", ncols=len(groups), handlelength=3)
    return fig


def _styles(inputs: list[str]) -> dict[str, Style]:
    """Colour of the group; line and marker by the position among all that have the colour."""
    count: dict[str, int] = {}
    styles = {}
    for name in inputs:
        colour = group_colour(group_of(name))
        i = count.get(colour, 0)
        count[colour] = i + 1
        styles[name] = {
            "color": colour,
            "linestyle": LINE_STYLES[i % len(LINE_STYLES)],
            "marker": MARKERS[(i + i // len(LINE_STYLES)) % len(MARKERS)],
        }
    return styles


def _draw_pitch(ax: Axes, table: pd.DataFrame, styles: dict[str, Style]) -> None:
    ax.set_yscale("log")
    ax.set_ylim(3e-5, 1.6)
    ax.set_yticks([ZERO, 1e-4, 1e-3, 1e-2, 1e-1, 1], ["0", "0.0001", "0.001", "0.01", "0.1", "1"])
    ax.yaxis.set_minor_locator(NullLocator())
    ax.axhspan(3e-5, SMALLEST, color="#F0F0F0", linewidth=0, zorder=0)
    for name, style in styles.items():
        rows = table[table["input"] == name].sort_values("roll_gon")
        roll, share = rows["roll_gon"].to_numpy(float), rows["share"].to_numpy(float)
        seen = np.where(share >= SMALLEST, share, np.nan)
        ci95 = rows["ci95"].to_numpy(float)
        below = np.minimum(ci95, seen - SMALLEST)
        ax.errorbar(
            roll,
            seen,
            yerr=[below, ci95],
            **style,
            markersize=3,
            linewidth=1,
            elinewidth=0.6,
        )
        none = share < SMALLEST
        ax.plot(
            roll[none],
            np.full(none.sum(), ZERO),
            linestyle="",
            marker=style["marker"],
            markersize=3,
            markerfacecolor="none",
            markeredgewidth=0.6,
            color=style["color"],
        )
    undefined = table.loc[table["share"].isna(), "roll_gon"].unique()
    for roll in undefined:
        ax.axvspan(roll - 2, roll + 2, facecolor=MISSING, hatch=HATCH, edgecolor="#999999", lw=0)
