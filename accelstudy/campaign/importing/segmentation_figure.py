"""The figure of a log with its static holds, to judge the segmentation by eye."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullLocator

from accelstudy.basics.arrays import Array
from accelstudy.basics.wording import plural
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.holds import Holds
from accelstudy.drawing.style import FULL, INK, new_figure

# Okabe & Ito's colours.
_COLOURS = ("#0072B2", "#D55E00", "#009E73")
_THRESHOLD = "#CC79A7"
_SHADE = "#DCE6F0"
_LEFT_OUT: dict[str, Any] = {"facecolor": "#F2E4E4", "hatch": "////", "edgecolor": "#B08080"}
_SPANS = 1000
"""Spans of time in which a log is drawn, about as many as a page can show."""
_DIGITS = 130
"""Digits that fit beside each other; if there are more, only every second, third … number is
shown."""


def draw_segmentation(holds: Holds) -> Figure:
    """Draw specific forces, and the sd of the windows, over time.

    Holds are shaded and numbered, those that are left out hatched.
    """
    edges, low, high = _envelope(holds)
    used, threshold = holds.used, holds.windows.threshold
    ends = holds.table[["t0", "t1"]].to_numpy()
    middle = (edges[:-1] + edges[1:]) / 2
    figure = new_figure(FULL, 90)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for i, (name, colour) in enumerate(zip(AXES, _COLOURS, strict=True)):
        _band(above, middle, low[:, i], high[:, i], colour, name)
    _band(below, middle, low[:, 3], high[:, 3], INK, None)
    if holds.size is None:
        label = f"threshold {threshold:.2g} m/s²"
        below.axhline(threshold, color=_THRESHOLD, linestyle="--", label=label)
    kind = "static hold" if holds.size is None else "block"
    kept, lost = plural(int(used.sum()), kind), f"{len(holds.left_out)} left out"
    looks = [(used, kept, {"color": _SHADE}), (~used, lost, _LEFT_OUT)]
    for shaded, label, look in looks[: 1 if used.all() else 2]:
        for ax, shown in ((above, label), (below, None)):
            whole = ax.get_xaxis_transform()
            common = {"transform": whole, "linewidth": 0, "zorder": 0.5, "label": shown}
            between = np.resize([1, 0], max(0, 2 * shaded.sum() - 1))
            ax.stairs(between, ends[shaded].ravel(), fill=True, **common, **look)
    _number(above, holds)
    above.set_ylabel("specific force / (m/s²)")
    what = "time / s" if holds.size is None else "sample"
    below.set(yscale="log", xlabel=what, ylabel="window sd / (m/s²)")
    below.set_xlim(0, edges[-1])
    below.yaxis.set_major_formatter("{x:g}")  # formulas, as of powers, take a third of the time
    below.yaxis.set_minor_locator(NullLocator())
    figure.legend(loc="outside upper center", ncols=6)
    figure.align_ylabels()
    return figure


def _envelope(holds: Holds) -> tuple[Array, Array, Array]:
    """Least and largest values of a log and its windows in spans of time.

    Returns
    -------
    edges : (k + 1,) array, s, of the spans
    low, high : (k, 4) arrays, of fx, fy, fz and of the standard deviation of the windows, m/s²;
        NaN in a gap
    """
    time = holds.log.time
    count = max(1, min(_SPANS, len(time) // 4))
    edges = np.linspace(time[0], time[-1], count + 1)
    firsts = np.searchsorted(time, edges[:-1])
    filled = np.diff(firsts, append=len(time)) > 0
    low, high = np.full((2, count, 4), np.nan)
    for i, values in enumerate([*holds.log.forces.T, np.sqrt(holds.windows.variance)]):
        low[filled, i] = np.fmin.reduceat(values, firsts[filled])
        high[filled, i] = np.fmax.reduceat(values, firsts[filled])
    return edges, low, high


def _number(ax: Axes, holds: Holds) -> None:
    """Write the numbers of the holds above them."""
    every = 1 + len(holds.table) * len(str(holds.table.index[-1])) // _DIGITS
    for i, (number, t0, t1, why) in enumerate(holds.table[["t0", "t1", "left_out"]].itertuples()):
        used = not why
        if i % every == 0 or not used:
            ax.annotate(
                f"{number}",
                ((t0 + t1) / 2, 1),
                xycoords=("data", "axes fraction"),
                xytext=(0, 1),
                textcoords="offset points",
                ha="center",
                va="bottom",
                fontsize=5,
                color=INK if used else _LEFT_OUT["edgecolor"],
            )


def _band(ax: Axes, x: Array, low: Array, high: Array, colour: str, label: str | None) -> None:
    # A band without height would be invisible, so its middle is drawn, too.
    ax.fill_between(x, low, high, color=colour, alpha=0.5, linewidth=0)
    ax.plot(x, (low + high) / 2, color=colour, linewidth=0.8, label=label)
