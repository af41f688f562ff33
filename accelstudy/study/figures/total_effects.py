"""Figures 5 and 6, total effects of forces and parameters, and Shapley effects beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.drawing.style import (
    COLUMN,
    FULL,
    HATCH,
    INK,
    MISSING,
    STYLE,
    Style,
    group_colour,
    group_label,
    group_of,
    in_order,
    symbol,
)
from accelstudy.study.figures.panels import Array, Panel, panels
from accelstudy.study.figures.registry import Tables, of_the_paper, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

LINE_STYLES = ("-", "--", ":")
MARKERS = ("o", "^", "s")
"""Styles of the first, second and third member of a group."""
SMALLEST = 0.01
"""Shares below this are drawn at `SMALL_AT`, in a band of their own."""
SMALL_AT, BOTTOM, TOP = 0.0033, 0.002, 5.0
WIDE, HIGH = 0.25, 0.17
"""Size of a label as a share of its panel."""
NO_DATA = "no total effects"
PLACE = ["output", "roll_gon", "pitch_gon", "input"]
SEEN = 0.5
"""Percentage points; groups of inputs that change by less are left out."""
OVERTAKES: Style = {
    **{"clip_on": False, "linestyle": "", "marker": "o", "markersize": 6},
    **{"markerfacecolor": "none", "markeredgecolor": INK, "markeredgewidth": 0.7},
}

CAPTION = """
    Total effects of the measured forces and of the calibration parameters on {output}, on a log
    scale, with the standard deviations of the gravity-based calibration; one panel for each pitch
    that is not negative. Bars are 95 % confidence intervals. Shares below 1 %, zero included, run
    through the grey band, and what never reaches 1 % in a panel is not drawn there. The parameters
    are sampled independently, although those of a calibration are correlated.
    """
CAPTION_ROBOT = """
    As figure {number}, with the standard deviations of the robot-aided calibration. Compared with
    figure {number} the share of the non-orthogonality shrinks and that of the measured forces
    grows, because the robot improves the angles most.
    """


def effects_over_roll(tables: Tables, study: Study, output: str, approach: str) -> Figure:
    """Total effects on one output, with the standard deviations of one calibration."""
    table = read_shares(tables["sensitivity"], approach)
    table = table[(table["output"] == output) & (table["pitch_gon"] >= 0)]
    highest = table.groupby("input", sort=False)["share"].max()
    drawn = table[table["input"].isin(highest.index[highest >= SMALLEST])]
    fig, axes = panels_over_roll(
        drawn.assign(output=""), styles_of(highest.index), _draw_shares, NO_DATA
    )
    for row in axes:
        share_axis(row[0])  # which the others share
    small = ", ".join(symbol(name) for name in highest.index if highest[name] < SMALLEST)
    title = f"total effect on {output} / %" + (f"\nbelow 1 % everywhere: {small}" if small else "")
    fig.suptitle(title, fontsize=STYLE["axes.titlesize"])
    return fig


for _suffix, _approach, _kind, _caption in (
    ("", "gravity", "gravity-based", CAPTION),
    ("-robot", "robot", "robot-aided", CAPTION_ROBOT),
):
    for _number, _output in ((5, "roll"), (6, "pitch")):
        register(
            f"figure-{_number}{_suffix}",
            title=f"Figure {_number}: total effects on {_output}, {_kind} calibration",
            caption=_caption.format(number=_number, output=_output),
            category="Paper",
            tables=("sensitivity",),
            when=of_the_paper,
        )(partial(effects_over_roll, output=_output, approach=_approach))


@register(
    "shapley",
    category="Paper",
    tables=("shapley",),
    when=of_the_paper,
)
def shapley(tables: Tables, study: Study) -> Figure:
    """Shapley effects on roll and pitch, gravity-based calibration.

    What the correlations of the calibration's parameters change: Shapley effects, with the
    covariance matrix of the gravity-based calibration, less the total effects of figures 5 and 6,
    which take the parameters as independent. In percentage points of the variance of roll (upper
    rows) and pitch (lower rows), one column for each pitch that is not negative; groups of inputs
    that change by less than half a point are left out. A ring says that the input overtakes
    another one there: it has the larger Shapley effect and the smaller total effect, by more than
    2 %.
    """
    table = changes(tables["shapley"])
    of_group = table.groupby(["output", "group"])
    table = table.assign(
        low=of_group["change"].transform("min").clip(upper=0),
        high=of_group["change"].transform("max").clip(lower=0),
    )
    drawn = (table["high"] >= SEEN) | (table["low"] <= -SEEN)
    drawn |= of_group["overtakes"].transform("any")
    fig, _ = panels_over_roll(
        table[drawn],
        styles_of(dict.fromkeys(table["input"])),
        _draw_changes,
        f"no share changes by {SEEN:g} points",
    )
    title = "Shapley effect less total effect / percentage points\n"
    title += f"all others: less than {SEEN:g}; ○ overtakes another input"
    fig.suptitle(title, fontsize=STYLE["axes.titlesize"])
    return fig


# --- tables --------------------------------------------------------------------------------------


def read_shares(table: pd.DataFrame, analysis: str) -> pd.DataFrame:
    """Rows of an analysis with `share`: NaN if undefined, 0 if within its confidence interval."""
    rows = table[table["analysis"] == analysis]
    share = rows["total_effect"].where(rows["total_effect"].abs() > rows["ci95"], 0.0)
    return rows.assign(share=share.where(rows["defined"].astype(bool)))


def changes(table: pd.DataFrame) -> pd.DataFrame:
    """Rows with `change`, Shapley less total effect in percentage points, and `overtakes`."""
    import pandas as pd

    from accelstudy.leveling.shares import overtaken

    table = table[(table["analysis"] == "gravity") & (table["pitch_gon"] >= 0)]
    change = 100 * (table["shapley_effect"] - table["total_effect"])
    winners = pd.MultiIndex.from_frame(overtaken(table)[PLACE])
    return table.assign(
        change=change.where(table["defined"].astype(bool)),
        overtakes=pd.MultiIndex.from_frame(table[PLACE]).isin(winners),
        group=table["input"].map(group_of),
    )


# --- panels --------------------------------------------------------------------------------------


def panels_over_roll(
    table: pd.DataFrame,
    styles: Mapping[str, Style],
    draw: Callable[..., None],
    nothing: str,
) -> tuple[Any, Any]:
    """Panels over roll: a row for each output and group of inputs, a column for each pitch.

    So each panel has few lines, and the width of a journal's column is enough for up to four.
    """
    unit = attitude_unit()
    pitches = sorted(table["pitch_gon"].unique())
    group = table["input"].map(group_of)
    grid: list[list[Panel]] = []
    colours = []
    for output in dict.fromkeys(table["output"]):
        for name in in_order(group[table["output"] == output]):
            rows = table[(table["output"] == output) & (group == name)]
            label = group_label(name).replace("-", "-\n") + (f"\non {output}" if output else "")
            colours.append(group_colour(name))
            grid.append([
                Panel(
                    rows[rows["pitch_gon"] == pitch],
                    "" if grid else rf"$\theta$ = {to_attitude(pitch * GON):g} {unit}",
                    ylabel=label if pitch == pitches[0] else "",
                )
                for pitch in pitches
            ])  # fmt: skip
    shared: Style = {"sharex": True, "sharey": "row"} if grid else {}
    shared["width"] = COLUMN if len(pitches) <= 4 else FULL
    nowhere, height = [[Panel([], nothing=nothing)]], 20 + 22 * max(len(grid), 1)
    fig, axes = panels(grid or nowhere, partial(draw, styles=styles), height, **shared)
    fig.set_layout_engine("constrained", wspace=0, hspace=0)
    for row, colour in zip(axes, colours, strict=False):
        row[0].yaxis.label.set_color(colour)
        for ax in row:
            ax.label_outer(remove_inner_ticks=True)
            ax.tick_params(labelsize=7, pad=2)
    if grid:
        fig.align_ylabels(axes[:, 0])
        fig.supxlabel(rf"roll $\phi$ / {unit}", fontsize=STYLE["axes.labelsize"])
    return fig, axes if grid else ()


def styles_of(inputs: Iterable[str]) -> dict[str, Style]:
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


def share_axis(ax: Axes) -> None:
    """Make the vertical axis one of shares on a log scale; small ones have a band of their own."""
    from matplotlib.ticker import NullLocator

    ax.set_yscale("log")
    ax.set_ylim(BOTTOM, TOP)
    ax.set_yticks([SMALL_AT, 0.01, 0.1, 1], ["<1", "1", "10", "100"])
    ax.yaxis.set_minor_locator(NullLocator())


def _lines(table: pd.DataFrame, column: str) -> dict[str, tuple[Array, Array, pd.DataFrame]]:
    """Roll as shown, a column, and the rows of each input, over roll."""
    lines = {}
    for name in dict.fromkeys(table["input"]):
        rows = table[table["input"] == name].sort_values("roll_gon")
        roll = to_attitude(rows["roll_gon"].to_numpy(float) * GON)
        lines[name] = roll, rows[column].to_numpy(float), rows
    return lines


def _draw_shares(ax: Axes, table: pd.DataFrame, styles: Mapping[str, Style]) -> None:
    """Draw the effects of a group at one pitch, without those that never reach 1 %."""
    share_axis(ax)
    ax.axhspan(BOTTOM, SMALLEST, color="#F0F0F0", linewidth=0, zorder=0)
    drawn = {}
    for name, (roll, share, rows) in _lines(table, "share").items():
        seen = share >= SMALLEST
        if not seen.any():
            continue
        # A line goes on where its share is too small to show, and ends only where there is none.
        y = np.where(share < SMALLEST, SMALL_AT, share)
        ax.plot(roll, y, **{**styles[name], "marker": ""}, linewidth=0.9)
        bars: Style = {"linestyle": "", "markersize": 1.8, "elinewidth": 0.5}
        half = rows["ci95"].to_numpy(float)[seen]
        ax.errorbar(roll[seen], share[seen], yerr=half, **{**styles[name], **bars})
        drawn[name] = roll, share
    label_lines(ax, drawn)
    for roll in to_attitude(table.loc[table["share"].isna(), "roll_gon"].unique() * GON):
        ax.axvspan(roll - 2, roll + 2, facecolor=MISSING, hatch=HATCH, edgecolor="#999999", lw=0)


def _draw_changes(ax: Axes, table: pd.DataFrame, styles: Mapping[str, Style]) -> None:
    """Draw the changes of a group's inputs at one pitch, with rings where one overtakes another."""
    ax.axhline(0, color=INK, linewidth=0.6)
    ax.set_ylim(1.7 * table["low"].iloc[0] - 0.1, 1.7 * table["high"].iloc[0] + 0.1)
    drawn = {}
    for name, (roll, change, rows) in _lines(table, "change").items():
        ax.plot(roll, change, **styles[name], markersize=1.5, linewidth=0.9)
        for i in np.flatnonzero(rows["overtakes"]):
            ax.plot(roll[i], change[i], **OVERTAKES)
        if (np.abs(change) >= 0.2 * SEEN).any():
            drawn[name] = roll, change
    label_lines(ax, drawn)


def label_lines(ax: Axes, lines: Mapping[str, tuple[Array, Array]]) -> None:
    """Write the symbol of each line above its right end or, if it falls to there, its peak.

    Symbols of negative values stand below. None stands over another one or covers the line of
    another one that ends there. The limits of the vertical axis must be set.
    """
    from matplotlib.patheffects import Normal, Stroke

    labels: dict[int, list[tuple[float, float, float, str]]] = {1: [], -1: []}
    for name, (x, y) in lines.items():
        size = np.abs(y)
        best = int(np.nanargmax(np.where(x >= 0, size, -1.0) if (x >= 0).any() else size))
        at = len(y) - 1 if size[-1] >= 0.5 * size[best] else best
        _, height = ax.transAxes.inverted().transform(ax.transData.transform((x[at], y[at])))
        side = -1 if y[at] < 0 else 1
        labels[side].append((side * height, float(x[at]), WIDE * float(np.ptp(x)), name))
    style: Style = {"ha": "center", "va": "center", "fontsize": 7.5}
    style |= {"path_effects": [Stroke(linewidth=2, foreground="white"), Normal()]}
    for side, places in labels.items():
        taken: list[tuple[float, float]] = []
        for out, at_x, wide, name in sorted(places):
            place = out + 0.6 * HIGH
            for other_x, other in taken:
                if abs(other_x - at_x) < wide:
                    place = max(place, other + HIGH)
            taken.append((at_x, place))
            colour = group_colour(group_of(name))
            across = ax.get_xaxis_transform()
            ax.text(at_x, side * place, symbol(name), transform=across, color=colour, **style)
