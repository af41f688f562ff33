"""Shapley effects over total effects: what the correlations of the parameters change."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.drawing.style import FULL, INK, Style, new_figure, say_empty, symbol
from accelstudy.study.figures.base import Tables, of_the_paper, register
from accelstudy.study.figures.total_effects import (
    NO_DATA,
    SMALLEST,
    draw_pitch,
    group_handles,
    styles_of,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

BAND, TOP = 1.3, 4.5
"""Ends of the band above all shares that says which inputs overtake others."""
PALE: Style = {"linewidth": 3.0, "alpha": 0.3, "solid_capstyle": "butt"}


@register(
    "shapley",
    "Shapley effects on roll and pitch, gravity-based calibration",
    """
    What the correlations of the calibration's parameters change: Shapley effects on roll (left)
    and pitch (right), with the covariance matrix of the gravity-based calibration, over the total
    effects of figures 5 and 6 (pale), which take the parameters as independent. The band on top
    names the inputs that overtake another one at that roll: they have the larger Shapley effect
    and the smaller total effect, by more than 2 %. There is a row for each pitch, of those that
    are not negative, at which this happens.
    """,
    category="Paper",
    tables=("shapley",),
    when=of_the_paper,
)
def shapley(tables: Tables, study: StudyConfig) -> Figure:
    """Draw roll at the left and pitch at the right, a row for each pitch that changes an order.

    Where none does, a row for the first pitch that is not negative shows it.
    """
    from matplotlib.lines import Line2D

    from accelstudy.leveling.sensitivity import OUTPUTS
    from accelstudy.leveling.shares import overtaken

    table = tables["shapley"]
    table = table[(table["analysis"] == "gravity") & (table["pitch_gon"] >= 0)]
    table = table.assign(share=table["shapley_effect"].where(table["defined"].astype(bool)))
    pairs = overtaken(table)
    pitches = sorted(pairs["pitch_gon"].unique()) or sorted(table["pitch_gon"].unique())[:1]
    rows = max(1, len(pitches))
    fig = new_figure(FULL, 26 + 54 * rows)
    axes = fig.subplots(rows, 2, sharex=True, sharey=True, squeeze=False)
    if not pitches:
        for ax in axes[0]:
            say_empty(ax, NO_DATA)
        return fig
    highest = table.groupby("input", sort=False)["share"].max()
    drawn = [name for name in highest.index if highest[name] >= SMALLEST]
    styles = styles_of(drawn)
    for row, pitch in zip(axes, pitches, strict=True):
        for ax, output in zip(row, OUTPUTS, strict=True):
            here, there = (
                its[(its["pitch_gon"] == pitch) & (its["output"] == output)]
                for its in (table, pairs)
            )
            _draw_total(ax, here, styles)
            draw_pitch(ax, here, styles, TOP)
            _write_overtaking(ax, there, styles)
            angle = to_attitude(pitch * GON)
            ax.set_title(f"on {output}, pitch $\\theta$ = {angle:g} {attitude_unit()}")
        row[0].set_ylabel("share of the variance")
        at = {"x": -0.03, "y": np.sqrt(BAND * TOP), "transform": row[0].get_yaxis_transform()}
        row[0].text(**at, s="overtakes", ha="right", va="center", fontsize=7.5)
    for ax in axes[-1]:
        ax.set_xlabel(f"roll $\\phi$ / {attitude_unit()}")
    handles = [
        *group_handles(drawn),
        Line2D([], [], color=INK, linewidth=1, label="Shapley effect"),
        Line2D([], [], color=INK, label="total effect", **PALE),
    ]
    fig.legend(handles=handles, loc="outside lower center", ncols=len(handles))
    return fig


def _draw_total(ax: Axes, table: pd.DataFrame, styles: dict[str, Style]) -> None:
    """Draw the total effects, where they can be seen, as pale lines behind."""
    for name, style in styles.items():
        rows = table[table["input"] == name].sort_values("roll_gon")
        share = rows["total_effect"].to_numpy(float)
        roll = to_attitude(rows["roll_gon"].to_numpy(float) * GON)
        ax.plot(roll, np.where(share < SMALLEST, np.nan, share), color=style["color"], **PALE)


def _write_overtaking(ax: Axes, pairs: pd.DataFrame, styles: dict[str, Style]) -> None:
    """Write above the shares at each roll which inputs overtake others."""
    ax.axhspan(BAND, TOP, color="#F0F0F0", linewidth=0, zorder=0)
    for roll in pairs["roll_gon"].unique():
        names = list(dict.fromkeys(pairs.loc[pairs["roll_gon"] == roll, "input"]))
        heights = np.geomspace(BAND, TOP, len(names) + 2)[-2:0:-1]
        for name, height in zip(names, heights, strict=True):
            ax.text(
                float(to_attitude(roll * GON)),
                height,
                symbol(name),
                color=styles[name]["color"],
                ha="center",
                va="center",
                fontsize=7,
            )
