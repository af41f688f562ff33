"""Shapley effects less total effects: what the correlations of the parameters change."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import GON, to_attitude
from accelstudy.drawing.style import (
    INK,
    STYLE,
    Style,
    group_colour,
    group_label,
    group_of,
    in_order,
)
from accelstudy.study.figures.base import Tables, of_the_paper, register
from accelstudy.study.figures.total_effects import label_lines, panels_over_roll, styles_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

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
    its = table.groupby(["output", "group"])
    drawn = (its["change"].agg(lambda x: x.abs().max()) >= SEEN) | its["overtakes"].any()
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
