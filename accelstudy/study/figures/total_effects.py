"""Figures 5 and 6, total effects of forces and parameters, and Shapley effects beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

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
    new_figure,
    say_empty,
    symbol,
)
from accelstudy.study.figures.base import Tables, of_the_paper, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

Array = NDArray[np.float64]

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
    "clip_on": False,
    "linestyle": "",
    "marker": "o",
    "markersize": 6,
    "markerfacecolor": "none",
    "markeredgecolor": INK,
    "markeredgewidth": 0.7,
}


def effects_over_roll(tables: Tables, study: StudyConfig, output: str, approach: str) -> Figure:
    """Total effects on one output, with the standard deviations of one calibration."""
    return _effects_over_roll(read_shares(tables["sensitivity"], approach), output)


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

for _suffix, _approach, _kind, _caption in (
    ("", "gravity", "gravity-based", CAPTION),
    ("-robot", "robot", "robot-aided", CAPTION_ROBOT),
):
    for _number, _output in ((5, "roll"), (6, "pitch")):
        register(
            f"figure-{_number}{_suffix}",
            f"Figure {_number}: total effects on {_output}, {_kind} calibration",
            _caption.format(number=_number, output=_output),
            category="Paper",
            tables=("sensitivity",),
            when=of_the_paper,
        )(partial(effects_over_roll, output=_output, approach=_approach))


def read_shares(table: pd.DataFrame, analysis: str) -> pd.DataFrame:
    """Rows of an analysis with `share`: NaN if undefined, 0 if within its confidence interval."""
    rows = table[table["analysis"] == analysis]
    share = rows["total_effect"].where(rows["total_effect"].abs() > rows["ci95"], 0.0)
    return rows.assign(share=share.where(rows["defined"].astype(bool)))


def _effects_over_roll(table: pd.DataFrame, output: str) -> Figure:
    table = table[(table["output"] == output) & (table["pitch_gon"] >= 0)]
    highest = table.groupby("input", sort=False)["share"].max()
    styles = styles_of(list(highest.index))
    drawn = {name: styles[name] for name in styles if highest[name] >= SMALLEST}
    groups = in_order(map(group_of, drawn))
    pitches = sorted(table["pitch_gon"].unique())
    fig, axes = panels_over_roll([(group_label(g), group_colour(g)) for g in groups], pitches)
    for group, row in zip(groups, axes, strict=True):
        _share_axis(row[0])  # which the others share
        for pitch, ax in zip(pitches, row, strict=True):
            ax.axhspan(BOTTOM, SMALLEST, color="#F0F0F0", linewidth=0, zorder=0)
            members = {name: style for name, style in drawn.items() if group_of(name) == group}
            _draw_shares(ax, table[table["pitch_gon"] == pitch], members)
    small = ", ".join(symbol(name) for name in highest.index if name not in drawn)
    title = f"total effect on {output} / %" + (f"\nbelow 1 % everywhere: {small}" if small else "")
    fig.suptitle(title, fontsize=STYLE["axes.titlesize"])
    return fig


def panels_over_roll(
    rows: Sequence[tuple[str, str]], pitches: Sequence[float], nothing: str = NO_DATA
) -> tuple[Figure, list[list[Axes]]]:
    """Make panels over roll: a row for each label and colour, a column for each pitch.

    So each panel has few lines, and the width of a journal's column is enough for up to four.
    Where there are no rows, the figure says `nothing`.
    """
    fig = new_figure(COLUMN if len(pitches) <= 4 else FULL, 20 + 22 * max(len(rows), 1))
    if not rows:
        say_empty(fig.subplots(), nothing)
        return fig, []
    axes = fig.subplots(len(rows), len(pitches), sharex=True, sharey="row", squeeze=False)
    fig.set_layout_engine("constrained", wspace=0, hspace=0)
    for ax in axes.flat:
        ax.label_outer(remove_inner_ticks=True)
        ax.tick_params(labelsize=7, pad=2)
    for row, (label, colour) in zip(axes, rows, strict=True):
        row[0].set_ylabel(label.replace("-", "-\n"), color=colour)
    fig.align_ylabels(axes[:, 0])
    unit = attitude_unit()
    for ax, pitch in zip(axes[0], pitches, strict=True):
        ax.set_title(f"$\\theta$ = {to_attitude(pitch * GON):g} {unit}")
    fig.supxlabel(f"roll $\\phi$ / {unit}", fontsize=STYLE["axes.labelsize"])
    return fig, axes.tolist()


def styles_of(inputs: list[str]) -> dict[str, Style]:
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


def _share_axis(ax: Axes) -> None:
    """Make the vertical axis one of shares on a log scale; small ones have a band of their own."""
    from matplotlib.ticker import NullLocator

    ax.set_yscale("log")
    ax.set_ylim(BOTTOM, TOP)
    ax.set_yticks([SMALL_AT, 0.01, 0.1, 1], ["<1", "1", "10", "100"])
    ax.yaxis.set_minor_locator(NullLocator())


def _draw_shares(ax: Axes, table: pd.DataFrame, styles: dict[str, Style]) -> None:
    """Draw the effects at one pitch, without those that never reach 1 %."""
    lines = {}
    for name, style in styles.items():
        rows = table[table["input"] == name].sort_values("roll_gon")
        share = rows["share"].to_numpy(float)
        if not (share >= SMALLEST).any():
            continue
        roll = to_attitude(rows["roll_gon"].to_numpy(float) * GON)
        # A line goes on where its share is too small to show, and ends only where there is none.
        y = np.where(share < SMALLEST, SMALL_AT, share)
        ax.plot(roll, y, **{**style, "marker": ""}, linewidth=0.9)
        seen = share >= SMALLEST
        ax.errorbar(
            roll[seen],
            share[seen],
            yerr=rows["ci95"].to_numpy(float)[seen],
            **{**style, "linestyle": ""},
            markersize=1.8,
            elinewidth=0.5,
        )
        lines[name] = roll, share
    label_lines(ax, lines)
    undefined = table.loc[table["share"].isna(), "roll_gon"].unique()
    for roll in to_attitude(undefined * GON):
        ax.axvspan(roll - 2, roll + 2, facecolor=MISSING, hatch=HATCH, edgecolor="#999999", lw=0)


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
    for side, places in labels.items():
        taken: list[tuple[float, float]] = []
        for out, at_x, wide, name in sorted(places):
            place = out + 0.6 * HIGH
            for other_x, other in taken:
                if abs(other_x - at_x) < wide:
                    place = max(place, other + HIGH)
            taken.append((at_x, place))
            ax.text(
                at_x,
                side * place,
                symbol(name),
                transform=ax.get_xaxis_transform(),
                color=group_colour(group_of(name)),
                ha="center",
                va="center",
                fontsize=7.5,
                path_effects=[Stroke(linewidth=2, foreground="white"), Normal()],
            )


@register(
    "shapley",
    "Shapley effects on roll and pitch, gravity-based calibration",
    """
    What the correlations of the calibration's parameters change: Shapley effects, with the
    covariance matrix of the gravity-based calibration, less the total effects of figures 5 and 6,
    which take the parameters as independent. In percentage points of the variance of roll (upper
    rows) and pitch (lower rows), one column for each pitch that is not negative; groups of inputs
    that change by less than half a point are left out. A ring says that the input overtakes
    another one there: it has the larger Shapley effect and the smaller total effect, by more than
    2 %.
    """,
    category="Paper",
    tables=("shapley",),
    when=of_the_paper,
)
def shapley(tables: Tables, study: StudyConfig) -> Figure:
    """Draw a row for each output and group of inputs that changes, a column for each pitch."""
    import pandas as pd

    from accelstudy.leveling.sensitivity import OUTPUTS
    from accelstudy.leveling.shares import overtaken

    table = tables["shapley"]
    table = table[(table["analysis"] == "gravity") & (table["pitch_gon"] >= 0)]
    change = 100 * (table["shapley_effect"] - table["total_effect"])
    table = table.assign(
        change=change.where(table["defined"].astype(bool)),
        group=table["input"].map(group_of),
        overtakes=pd.MultiIndex.from_frame(table[PLACE]).isin(
            pd.MultiIndex.from_frame(overtaken(table)[PLACE])
        ),
    )
    groups = table.groupby(["output", "group"])
    drawn = (groups["change"].agg(lambda x: x.abs().max()) >= SEEN) | groups["overtakes"].any()
    rows = [(o, g) for o in OUTPUTS for g in in_order(table["group"]) if drawn.get((o, g), False)]
    pitches = sorted(table["pitch_gon"].unique())
    labels = [(f"{group_label(group)}\non {output}", group_colour(group)) for output, group in rows]
    fig, axes = panels_over_roll(labels, pitches, f"no share changes by {SEEN:g} points")
    styles = styles_of(list(dict.fromkeys(table["input"])))
    for (output, group), panels in zip(rows, axes, strict=True):
        shown = table[(table["output"] == output) & (table["group"] == group)]
        low, high = min(shown["change"].min(), 0), max(shown["change"].max(), 0)
        for pitch, ax in zip(pitches, panels, strict=True):
            ax.set_ylim(1.7 * low - 0.1, 1.7 * high + 0.1)
            _draw_changes(ax, shown[shown["pitch_gon"] == pitch], styles)
    fig.suptitle(
        "Shapley effect less total effect / percentage points\n"
        f"all others: less than {SEEN:g}; ○ overtakes another input",
        fontsize=STYLE["axes.titlesize"],
    )
    return fig


def _draw_changes(ax: Axes, table: pd.DataFrame, styles: dict[str, Style]) -> None:
    """Draw the changes of a group's inputs at one pitch, with rings where one overtakes another."""
    ax.axhline(0, color=INK, linewidth=0.6)
    lines = {}
    for name in dict.fromkeys(table["input"]):
        rows = table[table["input"] == name].sort_values("roll_gon")
        roll = to_attitude(rows["roll_gon"].to_numpy(float) * GON)
        change = rows["change"].to_numpy(float)
        ax.plot(roll, change, **styles[name], markersize=1.5, linewidth=0.9)
        for i in np.flatnonzero(rows["overtakes"]):
            ax.plot(roll[i], change[i], **OVERTAKES)
        if (np.abs(change) >= 0.2 * SEEN).any():
            lines[name] = roll, change
    label_lines(ax, lines)
