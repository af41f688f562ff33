"""The figure of a budget: contribution of each source over the tilt."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from accelstudy.basics.units import GON, attitude_unit, to_attitude
from accelstudy.drawing.style import FULL, INK, STYLE, legend_columns, log_ticks, new_figure
from accelstudy.pole.budget import TOTAL, Budget
from accelstudy.pole.sources import sources

WIDEST = 1e4
"""Largest ratio of the largest error to the smallest that is shown."""
NAMED = 8.0
"""Per cent at the largest tilt; larger areas have room for their name."""


def budget_figure(budget: Budget, simulated: pd.DataFrame) -> Figure:
    """Contributions to the horizontal error: as curves in mm, and as parts of its square.

    Parameters
    ----------
    budget : Budget
    simulated : DataFrame of `simulate`, drawn as points
    """
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        figure = new_figure(FULL, 92)
        curves, parts = figure.subplots(1, 2)
        tilts = to_attitude(budget.tilts)
        drawn = [each for each in sources() if budget.horizontal(each.name).max() > 0]
        squares = []
        for each in drawn:
            # Sources of the tilt sensor have full lines.
            line = "-" if each.sensor else (0, (5, 1.5))
            values = 1e3 * budget.horizontal(each.name)
            curves.plot(tilts, values, color=each.colour, linestyle=line, label=each.title)
            squares.append(values**2)
        total = 1e3 * budget.total.horizontal
        curves.fill_between(
            tilts, total.min(axis=1), total.max(axis=1), color=INK, alpha=0.15, linewidth=0,
            label="all together, by direction",
        )  # fmt: skip
        curves.plot(
            tilts, 1e3 * budget.horizontal(TOTAL), color=INK, linewidth=2, label="all together"
        )
        curves.plot(
            to_attitude(simulated["tilt_gon"] * GON), 1e3 * simulated["simulated_horizontal_m"],
            color=INK, marker="o", linestyle="", markerfacecolor="white", label="Monte Carlo",
            clip_on=False, zorder=4,
        )  # fmt: skip
        high = 1.3 * float(total.max())
        low = max(0.7 * float(np.sqrt(min(square[-1] for square in squares))), high / WIDEST)
        curves.set(yscale="log", xlim=(0, tilts[-1]), ylim=(low, high))
        log_ticks(curves.yaxis, low, high)
        curves.set(xlabel=f"tilt / {attitude_unit()}", ylabel="horizontal error, rms / mm")
        shares = 100 * np.array(squares) / np.maximum(np.sum(squares, axis=0), 1e-300)
        areas = parts.stackplot(
            tilts, shares, colors=[each.colour for each in drawn], linewidth=0.4,
            edgecolor="white",
        )  # fmt: skip
        middles = np.cumsum(shares[:, -1]) - shares[:, -1] / 2
        for each, area, share, middle in zip(drawn, areas, shares[:, -1], middles, strict=True):
            area.set_hatch(each.hatch)
            if share > NAMED:
                parts.text(0.97 * tilts[-1], middle, each.title, ha="right", va="center",
                           fontsize=STYLE["legend.fontsize"],
                           bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.5,
                                 "alpha": 0.85})  # fmt: skip
        parts.set(xlim=(0, tilts[-1]), ylim=(0, 100), xlabel=f"tilt / {attitude_unit()}",
                  ylabel="part of the mean square / %")  # fmt: skip
        handles, labels = curves.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=legend_columns(labels))
        figure.suptitle(f"Foot of a pole of {budget.setup.length:g} m, by linear theory")
    return figure
