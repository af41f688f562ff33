"""Table 1 of the paper as a figure: the accuracy of published calibrations."""

from __future__ import annotations

import numpy as np

from accelstudy.drawing import style
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import PRESETS, get_model
from accelstudy.study.figures.panels import FAILED, accuracies, handle, narrow, panels, points
from accelstudy.study.figures.registry import Axes, DataFrame, Figure, Study, Tables, register

ROW_MM = 9.5
CROSS_AT = 0.9
"""Place of the cross for parameters that cannot be estimated, as a share of the panel's width."""
PALE: style.Style = {"alpha": 0.3}


@register(
    *("table-1", "summary", "leveling"),
    category="Paper",
    when=lambda study: study.presets is not None,
)
def published_calibrations(tables: Tables, study: Study) -> Figure:
    """Table 1: published calibrations and what they determine.

    The calibrations of the paper's Table 1, each with its own model and positions: mean empirical
    standard deviation of each group of parameters, and the rms error of roll that the calibration
    leaves, with their numbers. A cross stands where a group cannot be estimated; it is pale where
    only other parameters of the model prevent the calibration. Where nothing stands the model lacks
    the group. Gravity alone cannot determine the cross-axis angles. The simulated sensor of a row
    has the effects of its model, unless the study says otherwise; compare tilt errors between
    models with this in mind.
    """
    titles = [
        f"{preset.source}\n{get_model(preset.model).n_parameters} parameters, "
        f"{get_scheme(preset.scheme).title}"
        for preset in PRESETS
    ]

    def draw(ax: Axes, rows: DataFrame) -> None:
        points(ax, rows, "value")
        font: style.Style = {"textcoords": "offset points", "va": "center", "fontsize": 6.5}
        for row in rows.dropna(subset="value").to_dict("records"):
            place, colour = (row["value"], row["y"]), style.approach_colour(row["approach"])
            ax.annotate(f"{row['value']:.3g}", place, (4, 0), color=colour, in_layout=False, **font)
        for estimable, failed in rows[rows["value"].isna()].groupby("estimable"):
            look = {**FAILED, **(PALE if estimable else {})}
            points(ax, failed.assign(x=CROSS_AT), transform=ax.get_yaxis_transform(), **look)
        ax.set_xscale("log")
        low, high = ax.get_xlim()
        ax.set_xlim(low / 1.2, 1.2 * high * (high / low) ** 0.6)  # room for numbers and crosses
        ax.set_ylim(len(PRESETS) - 0.5, -0.5)
        ax.set_yticks(range(len(PRESETS)), titles)
        ax.tick_params(axis="y", length=0)

    table = preset_table(tables, study)
    legend = [
        *style.approach_handles(table["approach"].unique()),
        handle("not estimable", **FAILED),
        handle("estimable, but other parameters are not", **FAILED, **PALE),
    ]
    return panels(
        table,
        draw,
        10 + ROW_MM * len(PRESETS),
        column="label",
        xlabel="{quantity} / {unit}",
        legend=legend,
    )


def preset_table(tables: Tables, study: Study) -> DataFrame:
    """Accuracies of the presets of the study: a row for each group of parameters, and for roll.

    `y` is the height: the number of the preset, and its approaches about it.
    """
    import pandas as pd

    assert study.presets is not None
    approaches = [approach.name for approach in study.presets.approaches]
    offsets = np.linspace(-0.17, 0.17, len(approaches))
    cells = [
        (f"{preset.model}/{preset.scheme}/{approach}", approach, place + offset)
        for place, preset in enumerate(PRESETS)
        for approach, offset in zip(approaches, offsets, strict=True)
    ]
    columns = ["cell", "approach", "y"]
    table = accuracies(tables).merge(pd.DataFrame(cells, columns=columns), on="cell")
    table = table[~table["group"].isin(["gravity", "pitch"])]
    return table.assign(label=table["label"].map(narrow))
