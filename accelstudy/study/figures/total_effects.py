"""Figures 5 and 6: total effects of forces and parameters on roll and pitch."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.drawing.style import (
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
from accelstudy.study.figures.base import Tables, of_the_paper, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from accelstudy.study.config import StudyConfig

LINE_STYLES = ("-", "--", ":")
MARKERS = ("o", "^", "s")
"""Styles of the first, second and third member of a group."""
SMALLEST = 0.01
"""Shares below this are drawn at `SMALL_AT`, in a band of their own."""
SMALL_AT, BOTTOM = 0.0065, 0.005
LABEL_APART = 0.06
"""Least distance of two labels at the right, as a share of the panel's height."""
NO_DATA = "no total effects"


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
    from matplotlib.lines import Line2D

    table = table[(table["output"] == output) & (table["pitch_gon"] >= 0)]
    pitches = sorted(table["pitch_gon"].unique())
    columns = min(2, max(1, len(pitches)))
    rows = max(1, -(-len(pitches) // columns))
    fig = new_figure(FULL, 28 + 58 * rows)
    axes = fig.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    inputs = list(dict.fromkeys(table["input"]))
    highest = table.groupby("input")["share"].max()
    drawn = [name for name in inputs if highest[name] >= SMALLEST]
    styles = styles_of(drawn)
    for ax, pitch in zip(axes, pitches, strict=False):
        draw_pitch(ax, table[table["pitch_gon"] == pitch], styles)
        angle = to_attitude(pitch * GON)
        ax.set_title(f"pitch $\\theta$ = {angle:g} {attitude_unit()}")
    for ax in axes[len(pitches) :]:
        ax.set_axis_off()
    if not pitches:
        say_empty(axes[0], NO_DATA)
    for i, ax in enumerate(axes):
        if i >= len(axes) - columns:
            ax.set_xlabel(f"roll $\\phi$ / {attitude_unit()}")
        if i % columns == 0:
            ax.set_ylabel(f"total effect on {output}")
    if drawn:
        handles = group_handles(drawn)
        if small := [symbol(name) for name in inputs if name not in drawn]:
            text = f"below {SMALLEST:.0%} everywhere: {', '.join(small)}".replace("%", " %")
            handles.append(Line2D([], [], linestyle="", label=text))
        fig.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return fig


def group_handles(inputs: Iterable[str]) -> list[Line2D]:
    """Entries of a legend, one for each group of the inputs."""
    from matplotlib.lines import Line2D

    groups = in_order(group_of(name) for name in inputs)
    return [Line2D([], [], color=group_colour(group), label=group_label(group)) for group in groups]


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


def draw_pitch(ax: Axes, table: pd.DataFrame, styles: dict[str, Style], top: float = 1.25) -> None:
    """Draw the effects at one pitch, each with its symbol, without those that never reach 1 %."""
    from matplotlib.ticker import NullLocator

    ax.set_yscale("log")
    ax.set_ylim(BOTTOM, top)
    ax.set_yticks(
        [SMALL_AT, 0.01, 0.03, 0.1, 0.3, 1], ["less", "1 %", "3 %", "10 %", "30 %", "100 %"]
    )
    ax.yaxis.set_minor_locator(NullLocator())
    ax.axhspan(BOTTOM, SMALLEST, color="#F0F0F0", linewidth=0, zorder=0)
    labels: dict[float | None, list[tuple[float, str, str]]] = {}
    for name, style in styles.items():
        rows = table[table["input"] == name].sort_values("roll_gon")
        share = rows["share"].to_numpy(float)
        if not (share >= SMALLEST).any():
            continue
        roll = to_attitude(rows["roll_gon"].to_numpy(float) * GON)
        # A line goes on where its share is too small to show, and ends only where there is none.
        y = np.where(share < SMALLEST, SMALL_AT, share)
        ax.plot(roll, y, **{**style, "marker": ""}, linewidth=1)
        seen = share >= SMALLEST
        ax.errorbar(
            roll[seen],
            share[seen],
            yerr=rows["ci95"].to_numpy(float)[seen],
            **{**style, "linestyle": ""},
            markersize=2.5,
            elinewidth=0.6,
        )
        best = int(np.nanargmax(np.where(roll >= 0, share, -1) if (roll >= 0).any() else share))
        # A symbol stands at the right end of its line, or at the peak of one that falls to there.
        at = len(share) - 1 if share[-1] >= 0.5 * share[best] else best
        place = None if at == len(share) - 1 else float(roll[at])
        labels.setdefault(place, []).append((float(share[at]), symbol(name), style["color"]))
    for place, its in labels.items():
        _write(ax, place, its)
    undefined = table.loc[table["share"].isna(), "roll_gon"].unique()
    for roll in to_attitude(undefined * GON):
        ax.axvspan(roll - 2, roll + 2, facecolor=MISSING, hatch=HATCH, edgecolor="#999999", lw=0)


def _write(ax: Axes, x: float | None, labels: list[tuple[float, str, str]]) -> None:
    """Write symbols (share, text, colour) above a roll, or at the right edge; none over another."""
    from matplotlib.patheffects import Normal, Stroke
    from scipy.optimize import isotonic_regression

    labels = sorted(labels)
    low, high = np.log(ax.get_ylim())
    wanted = (np.log([share for share, _, _ in labels]) - low) / (high - low)
    if x is not None:
        wanted += 0.75 * LABEL_APART
    apart = LABEL_APART * np.arange(len(labels))
    heights = isotonic_regression(wanted - apart).x + apart
    for height, (_, text, colour) in zip(heights, labels, strict=True):
        ax.text(
            1.01 if x is None else x,
            height,
            text,
            transform=ax.transAxes if x is None else ax.get_xaxis_transform(),
            color=colour,
            ha="left" if x is None else "center",
            va="center",
            fontsize=7.5,
            path_effects=[Stroke(linewidth=2, foreground="white"), Normal()],
        )
