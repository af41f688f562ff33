"""Figure of the efficiency of schemes, and of the rms of roll and pitch that they reach."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.basics.units import display_unit, to_display
from accelstudy.drawing.style import FULL, INK, STYLE, Style, approach_colour, log_ticks, new_figure

MARKS = {"D": ("#0072B2", "o"), "A": ("#009E73", "s"), "I": ("#D55E00", "D")}
"""Colour and marker of each criterion."""


def efficiency_figure(table: pd.DataFrame) -> Figure:
    """Efficiency by the three criteria, one panel for each approach, and rms over positions.

    Parameters
    ----------
    table : DataFrame of `accelstudy.proposal.efficiency.efficiency_table`
    """
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        approaches = list(dict.fromkeys(table["approach"]))
        schemes = list(dict.fromkeys(table["scheme"]))
        figure = new_figure(FULL, 40 + 5.2 * len(schemes) + 62)
        grid = figure.add_gridspec(2, len(approaches), height_ratios=[5.2 * len(schemes) + 14, 62])
        for column, approach in enumerate(approaches):
            part = table[table["approach"] == approach]
            above = figure.add_subplot(grid[0, column])
            _efficiencies(above, part, schemes, approach, column == 0)
            below = figure.add_subplot(grid[1, column])
            _over_positions(below, part, approach, column == 0, column == len(approaches) - 1)
        return figure


def _efficiencies(
    ax: Axes, table: pd.DataFrame, schemes: list[str], approach: str, labelled: bool
) -> None:
    titles = table.drop_duplicates("scheme").set_index("scheme")["title"]
    for name, (colour, marker) in MARKS.items():
        part = table[table["criterion"] == name].set_index("scheme")
        determined = [s for s in schemes if not part.loc[s, "reason"]]
        y = [schemes.index(s) for s in determined]
        ax.plot(100 * part.loc[determined, "efficiency"], y, marker, color=colour, label=name)
    for place, scheme in enumerate(schemes):
        if table.loc[table["scheme"] == scheme, "reason"].iloc[0]:
            ax.text(2, place, "does not determine the model", va="center", color="#777777", size=7)
    ax.set_xlim(0, 103)
    ax.set_ylim(len(schemes) - 0.4, -0.6)
    ax.set_yticks(range(len(schemes)), [titles[s] for s in schemes] if labelled else [])
    ax.set_title(f"{approach}: share of the best there can be")
    ax.set_xlabel("efficiency, %")
    if labelled:
        ax.legend(title="criterion", loc="center left")


def _over_positions(
    ax: Axes, table: pd.DataFrame, approach: str, labelled: bool, last: bool
) -> None:
    rows = table[(table["criterion"] == "I") & (table["reason"] == "")].copy()
    rows["rms"] = np.sqrt((rows["rms_roll"] ** 2 + rows["rms_pitch"] ** 2) / 2)
    n = np.geomspace(rows["n"].min(), rows["n"].max(), 60)
    one = float((rows["least_rms"] * np.sqrt(rows["n"])).iloc[0])
    ax.plot(n, to_display(one / np.sqrt(n), "rad"), color=INK, label="no positions are below")
    designed = rows["scheme"].str.startswith("I-optimal ")
    style: Style = {"color": approach_colour(approach), "linestyle": ""}
    ax.plot(rows["n"][~designed], to_display(rows["rms"][~designed], "rad"), marker="o", **style,
            label="schemes")  # fmt: skip
    ax.plot(rows["n"][designed], to_display(rows["rms"][designed], "rad"), marker="D", **style,
            markerfacecolor="white", label="I-optimal designs")  # fmt: skip
    least, most = (
        float(to_display(value, "rad")) for value in (rows["least_rms"].min(), rows["rms"].max())
    )
    ax.set_yscale("log")
    log_ticks(ax.yaxis, least, most)
    ax.set_xlabel("positions")
    ax.set_title(f"{approach}: expected rms")
    if labelled:
        ax.set_ylabel(f"rms of roll and pitch, {display_unit('rad')}")
    if last:
        ax.legend(loc="best")
