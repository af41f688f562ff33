"""Table 1 of the paper as a figure: the accuracy of published calibrations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.drawing.style import (
    Style,
    approach_colour,
    approach_handles,
    group_label,
    group_of,
    in_order,
    say_empty,
    shown,
    spread,
)
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import PRESETS, Preset, get_model
from accelstudy.study.figures.panels import DARK, Panel, by_cell, key, panels, points
from accelstudy.study.figures.registry import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

ROW_MM = 9.5
CROSS_AT = 0.9
"""Place of the cross for parameters that cannot be estimated, as a share of the panel's width."""
PALE = 0.3
TILT = "tilt"


@register(
    "table-1",
    category="Paper",
    tables=("summary", "leveling"),
    when=lambda study: study.presets is not None,
)
def published_calibrations(tables: Tables, study: Study) -> Figure:
    """Table 1: published calibrations and what they determine.

    The calibrations of the paper's Table 1, each with its own model and positions: mean empirical
    standard deviation of each group of parameters, and the rms error of roll that the calibration
    leaves, with their numbers. A cross stands where a group cannot be estimated; it is pale where
    only other parameters of the model prevent the calibration. Gravity alone cannot determine the
    cross-axis angles. The simulated sensor of a row has the effects of its model, unless the study
    says otherwise; compare tilt errors between models with this in mind.
    """
    assert study.presets is not None
    approaches = [approach.name for approach in study.presets.approaches]
    table = preset_table(tables, approaches)
    row = []
    for group in [*in_order(set(table["group"]) - {TILT}), TILT]:
        its = table[table["group"] == group]
        label, quantity = group_label(group), "sd / "
        label = label.replace("non-orthogonality", "non-orthogo-\nnality")
        if group == TILT:
            label, quantity = "tilt error\n(roll, rms)", ""
        unit = its["unit"].iloc[0] if len(its) else ""
        row.append(Panel(its, label, f"{quantity}{unit}"))
    fig, axes = panels([row], _draw_column, 30 + ROW_MM * len(PRESETS), sharey=True)
    axes[0, 0].set_ylim(len(PRESETS) - 0.5, -0.5)
    axes[0, 0].set_yticks(range(len(PRESETS)), map(_row_label, PRESETS))
    cross: Style = {**DARK, "marker": "x"}
    handles = [
        *approach_handles(approaches),
        key("not estimable", **cross),
        key("estimable, but other parameters are not", **cross, alpha=PALE),
        key("not in the model", linestyle="", marker="$–$", color="#999999"),
    ]
    spacing: Style = {"ncols": 5, "handletextpad": 0.2, "columnspacing": 1.2}
    fig.legend(handles=handles, loc="outside lower center", **spacing)
    return fig


def preset_table(tables: Tables, approaches: list[str]) -> pd.DataFrame:
    """Mean sd of each group, and the tilt error, of each preset that was run, as shown.

    `value` is NaN where there is none; `pale` then says that only other parameters prevent it.
    """
    import pandas as pd

    summary = tables["summary"].assign(group=tables["summary"]["parameter"].map(group_of))
    tilt = by_cell(tables["leveling"], "roll_rms_mgon")
    rows = []
    for place, preset in enumerate(PRESETS):
        offsets = np.linspace(-0.17, 0.17, len(approaches))
        for approach, offset in zip(approaches, offsets, strict=True):
            cell = f"{preset.model}/{preset.scheme}/{approach}"
            its = summary[(summary["cell"] == cell) & (summary["group"] != "gravity")]
            labels = {"place": place, "y": place + offset, "approach": approach}
            for group, members in its.groupby("group"):
                value, unit = shown(members["sd_empirical"], members["unit"].iloc[0])
                pale = bool(members["estimable"].all())
                labels_of = {**labels, "group": group, "unit": unit, "pale": pale}
                rows.append({**labels_of, "value": float(value.mean())})
            if len(its):
                value, unit = shown([tilt.get(cell, np.nan)], "mgon")
                labels_of = {**labels, "group": TILT, "unit": unit, "pale": False}
                rows.append({**labels_of, "value": float(value[0])})
    columns = ["place", "y", "approach", "group", "unit", "pale", "value"]
    table = pd.DataFrame(rows, columns=columns)
    return table.assign(value=table["value"].where(table["value"] > 0))


def _row_label(preset: Preset) -> str:
    n = get_model(preset.model).n_parameters
    return f"{preset.source}\n{n} parameters, {get_scheme(preset.scheme).title}"


def _draw_column(ax: Axes, rows: pd.DataFrame) -> None:
    """Markers and numbers at standard deviations, crosses where there are none."""
    across = ax.get_yaxis_transform()
    known = rows["value"].notna()
    points(ax, rows[known], "value")
    text: Style = {"textcoords": "offset points", "va": "center", "fontsize": 6.5}
    for row in rows[known].to_dict("records"):
        place, colour = (row["value"], row["y"]), approach_colour(row["approach"])
        number = _number(row["value"])
        ax.annotate(number, place, (4, 0), color=colour, in_layout=False, **text)
    for pale, failed in rows[~known].groupby("pale"):
        crosses: Style = {"marker": "x", "transform": across, "alpha": PALE if pale else 1}
        points(ax, failed.assign(x=CROSS_AT), **crosses)
    for y in set(range(len(PRESETS))) - set(rows["place"]):
        style: Style = {"color": "#999999", "ha": "center", "va": "center", "in_layout": False}
        ax.text(0.5, y, "–", transform=across, **style)
    ax.grid(False, axis="y")
    ax.tick_params(axis="y", length=0)
    between: Style = {"transform": across, "colors": "#EEEEEE", "zorder": 0, "linewidth": 0.6}
    ax.hlines(np.arange(len(PRESETS) - 1) + 0.5, 0, 1, **between)
    if known.any():
        _log_axis(ax, rows["value"].min() / 1.5, rows["value"].max() * 1.5)
    else:
        ax.set_xticks([])
        say_empty(ax)


def _number(value: float) -> str:
    """Two significant digits, three from 10 to 100 and whole numbers above."""
    decimals = 1 if value >= 10 else 1 - int(np.floor(np.log10(value)))
    return f"{value:.{decimals if value < 100 else 0}f}"


def _log_axis(ax: Axes, low: float, high: float) -> None:
    """Logarithmic axis about the values, with room for their numbers and for the crosses."""
    from matplotlib.ticker import LogLocator, NullLocator

    ax.set_xscale("log")
    ax.set_xlim(low, high * (high / low) ** 0.55)
    low, high = ax.get_xlim()
    ticks = np.asarray(LogLocator(subs=(1, 2, 5)).tick_values(low, high))
    ticks = ticks[(ticks >= low) & (ticks <= high)]
    ticks = ticks[spread(np.log(ticks) / np.log(high / low), 0.38)]
    ax.set_xticks(ticks, [f"{value:g}" for value in ticks])
    ax.xaxis.set_minor_locator(NullLocator())
