"""How many positions a promise takes, and how often it is broken."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from accelstudy.basics.units import attitude_unit, display_unit, to_attitude, to_display
from accelstudy.drawing.style import FULL, INK, MM, STYLE, approach_colour, approach_marker
from accelstudy.schemes import get_scheme

NAMES = {
    "known": "noise known",
    "bound": "upper bound from residuals",
    "plain": "as the residuals seem",
}
LINES: dict[str, Any] = {"known": "-", "bound": "--", "plain": ":"}


def sequential_figure(summary: pd.DataFrame, fixed: str) -> Figure:
    """Draw the summary of simulated sessions.

    Parameters
    ----------
    summary : DataFrame, of `accelstudy.sequential.simulation.summary_table`
    fixed : str, name of the fixed scheme
    """
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = Figure(figsize=(FULL, 92 * MM), layout="constrained")
        left, right = figure.subplots(1, 2)
        for (approach, rule), part in summary.groupby(["approach", "rule"], sort=False):
            ordered = part.sort_values("promised")
            _positions(left, str(approach), str(rule), ordered)
            _broken(right, str(approach), str(rule), ordered)
        for approach, part in summary.groupby("approach", sort=False):
            accuracy = (part["promised"] / part["multiple"]).iloc[0]
            left.plot(
                to_display(accuracy, "rad"), get_scheme(fixed).n_positions, "*", markersize=11,
                color=approach_colour(str(approach)), markeredgecolor="white", zorder=5,
            )  # fmt: skip
        tilt = f"{float(to_attitude(summary['tilt_range'].iloc[0])):.0f} {attitude_unit()}"
        for axes in (left, right):
            axes.set_xscale("log")
            axes.set_xlabel(f"promised rms up to {tilt} of tilt [{display_unit('rad')}]")
            axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 3, 5)))
            axes.xaxis.set_major_formatter("{x:g}")
            axes.minorticks_off()
        left.set_ylabel("positions")
        left.set_title("until the promise seems kept: mean, central 90 %", loc="left")
        left.set_ylim(bottom=0)
        right.set_ylabel("sessions [%]")
        right.set_title("less accurate than promised", loc="left")
        right.set_ylim(-2, 102)
        right.axhline(5, color=INK, linewidth=0.6)
        right.annotate("5 %", (1, 5), xycoords=("axes fraction", "data"), fontsize=7,
                       xytext=(-2, 2), textcoords="offset points", ha="right")  # fmt: skip
        handles = [
            Line2D([], [], color=approach_colour(a), marker=approach_marker(a), label=a)
            for a in summary["approach"].unique()
        ]
        handles += [
            Line2D([], [], color=INK, linestyle=LINES[r], label=NAMES[r])
            for r in summary["rule"].unique()
        ]
        handles.append(
            Line2D(
                [], [], color=INK, marker="*", markersize=9, linestyle="", label=f"fixed: {fixed}"
            )
        )
        figure.legend(handles=handles, loc="outside upper center", ncols=3)
    return figure


def _positions(axes: Axes, approach: str, rule: str, part: pd.DataFrame) -> None:
    colour, x = approach_colour(approach), to_display(part["promised"], "rad")
    axes.plot(x, part["positions"], LINES[rule], color=colour, marker=approach_marker(approach))
    if rule != "plain":
        low, high = part["positions_5"], part["positions_95"]
        axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)


def _broken(axes: Axes, approach: str, rule: str, part: pd.DataFrame) -> None:
    x, share = to_display(part["promised"], "rad"), 100 * part["broken"].to_numpy()
    ends = 100 * part[["broken_low", "broken_high"]].to_numpy().T
    axes.errorbar(
        x, share, yerr=np.abs(ends - share), color=approach_colour(approach), capsize=2,
        marker=approach_marker(approach), linestyle=LINES[rule],
    )  # fmt: skip
