"""The figure of shares in the field: over the time since the calibration, and the temperature."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics.units import MGON, display_unit, to_display
from accelstudy.data_sheets import DataSheet
from accelstudy.drawing.style import FULL, INK, STYLE, legend_columns, log_ticks, new_figure
from accelstudy.field.shares import RESTART, Use, parts_of_variance
from accelstudy.pole.sources import sources

Array = NDArray[np.float64]

MOST = 1e4
"""Largest ratio of contributions that is shown."""
LINE = 100
"""Characters in a line of the title."""
MATTERS = {
    "bias_instability": "bias instability",
    "acceleration_random_walk": "random walk of the bias",
    "repeatability": "repeatability",
    "bias_per_kelvin": "bias over temperature",
    "scale_per_kelvin": "scale over temperature",
}
"""Quantities of a data sheet by which a calibration ages, in words."""


@dataclass(frozen=True)
class Look:
    """How a source is drawn."""

    title: str
    colour: str
    hatch: str


def looks() -> dict[str, Look]:
    """All sources by name, in order; sources of a pole look as in the figure of a pole."""
    of_pole = {each.name: Look(each.title, each.colour, each.hatch) for each in sources()}
    restart = Look("switching off and on", "#882255", "xxxx")
    names = ("calibration", "noise", "drift", RESTART, "temperature")
    return {name: of_pole.get(name, restart) for name in names}


def field_figure(table: pd.DataFrame, sheet: DataSheet, use: Use) -> Figure:
    """Draw contributions in angles above, and shares of the variance below.

    Parameters
    ----------
    table : DataFrame of `accelstudy.field.shares.field_shares`
    sheet : DataSheet
    use : Use
    """
    parts = parts_of_variance(table)
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        fig = new_figure(FULL, 132)
        axes = fig.subplots(2, 2, sharex="col", sharey="row")
        for column, over in zip(axes.T, ("time", "temperature"), strict=True):
            variance = parts[parts.index.get_level_values("over") == over]
            x = variance.index.get_level_values("hours" if over == "time" else "kelvin")
            _contributions(column[0], x.to_numpy(float), variance)
            _shares(column[1], x.to_numpy(float), variance)
        top = 1.5 * np.sqrt(float(parts.sum(axis=1).max()))
        bottom = 0.7 * np.sqrt(np.nanmin(parts.where(parts > 0).to_numpy(float)))
        ends = to_display(np.array([max(bottom, top / MOST), top]) * MGON, "rad").tolist()
        axes[0, 0].set(yscale="log", ylim=ends)
        log_ticks(axes[0, 0].yaxis, *ends)
        axes[0, 0].set_ylabel(f"sd of roll and pitch, rms / {display_unit('rad')}")
        axes[1, 0].set_ylabel("share of the variance / %")
        axes[0, 0].set_title("at the temperature of the calibration")
        axes[0, 1].set_title(f"{use.age / 3600:g} h after the calibration")
        axes[1, 0].set_xlabel("time since the calibration / h")
        axes[1, 1].set_xlabel("difference in temperature / K")
        handles, labels = axes[0, 1].get_legend_handles_labels()
        fig.legend(handles, labels, loc="outside lower center", ncols=legend_columns(labels))
        unknown = [words for name, words in MATTERS.items() if name in sheet.unknown]
        note = f"Not in the data sheet, and taken as zero: {', '.join(unknown)}"
        title = sheet.title or sheet.name
        fig.suptitle("\n".join([title, *(textwrap.wrap(note, LINE) if unknown else [])]))
    return fig


def _contributions(ax: Axes, x: Array, variance: pd.DataFrame) -> None:
    whole = to_display(np.sqrt(variance.sum(axis=1)) * MGON, "rad")
    ax.plot(x, whole, color=INK, linewidth=4, alpha=0.25, label="all together")
    for name, look in looks().items():
        sd = to_display(np.sqrt(variance[name]) * MGON, "rad")
        if np.any(sd > 0):
            ax.plot(x, sd, color=look.colour, label=look.title)


def _shares(ax: Axes, x: Array, variance: pd.DataFrame) -> None:
    shares = 100 * variance.div(variance.sum(axis=1), axis=0)
    drawn = {name: look for name, look in looks().items() if shares[name].max() > 0}
    areas = ax.stackplot(
        x,
        [shares[name] for name in drawn],
        colors=[look.colour for look in drawn.values()],
        linewidth=0.4,
        edgecolor="white",
    )
    for area, look in zip(areas, drawn.values(), strict=True):
        area.set_hatch(look.hatch)
    ax.set(xscale="log", xlim=(x[0], x[-1]), ylim=(0, 100))
    log_ticks(ax.xaxis, x[0], x[-1])
