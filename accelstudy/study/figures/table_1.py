"""Table 1 of the paper as a figure: the accuracy of published calibrations."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.approaches import approach_names
from accelstudy.drawing.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_handles,
    approach_marker,
    group_label,
    group_of,
    in_order,
    new_figure,
    say_empty,
    shown,
    spread,
)
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import PRESETS, Preset, get_model
from accelstudy.study.figures.base import Tables, register

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

ROW_MM = 9.5
CROSS_AT = 0.9
"""Place of the cross for parameters that cannot be estimated, as a share of the panel's width."""
PALE = 0.3


@register(
    "table-1",
    "Table 1: published calibrations and what they determine",
    """
    The calibrations of the paper's Table 1, each with its own model and positions: mean empirical
    standard deviation of each group of parameters, and the rms error of roll that the calibration
    leaves, with their numbers. A cross stands where a group cannot be estimated; it is pale where
    only other parameters of the model prevent the calibration. Gravity alone cannot determine the
    cross-axis angles. The simulated sensor of a row has the effects of its model, unless the study
    says otherwise; compare tilt errors between models with this in mind.
    """,
    category="Paper",
    tables=("summary", "leveling"),
    when=lambda study: study.presets is not None,
)
def published_calibrations(tables: Tables, study: StudyConfig) -> Figure:
    """A row for each preset, a column for each group of parameters and one for the tilt error."""
    from matplotlib.lines import Line2D

    assert study.presets is not None
    approaches = _spelled_out(study.presets.approaches)
    summary = tables["summary"]
    summary = summary.assign(group=[group_of(name) for name in summary["parameter"]])
    cells = {_cell(preset, approach) for preset in PRESETS for approach in approaches}
    summary = summary[summary["cell"].isin(cells) & (summary["group"] != "gravity")]
    groups = in_order(summary["group"])
    fig = new_figure(FULL, 30 + ROW_MM * len(PRESETS))
    axes = fig.subplots(1, len(groups) + 1, sharey=True, squeeze=False)[0]
    for ax, group in zip(axes, groups, strict=False):
        rows = summary[summary["group"] == group]
        _draw_group(ax, rows, approaches)
        ax.set_title(group_label(group).replace("non-orthogonality", "non-orthogo-\nnality"))
        ax.set_xlabel(f"sd / {shown([], rows['unit'].iloc[0])[1]}")
    _draw_tilt(axes[-1], tables["leveling"], summary, approaches)
    for ax in axes:
        _finish(ax)
    axes[0].set_ylim(len(PRESETS) - 0.5, -0.5)
    axes[0].set_yticks(range(len(PRESETS)), [_row_label(preset) for preset in PRESETS])
    cross: Style = {"linestyle": "", "marker": "x", "color": INK}
    fig.legend(
        handles=[
            *approach_handles(approaches),
            Line2D([], [], **cross, label="not estimable"),
            Line2D([], [], **cross, alpha=PALE, label="estimable, but other parameters are not"),
            Line2D([], [], linestyle="", marker="$–$", color="#999999", label="not in the model"),
        ],
        loc="outside lower center",
        ncols=5,
        handletextpad=0.2,
        columnspacing=1.2,
    )
    return fig


def _spelled_out(approaches: list[str]) -> list[str]:
    return list(approach_names()) if approaches == ["all"] else approaches


def _cell(preset: Preset, approach: str) -> str:
    return f"{preset.model}/{preset.scheme}/{approach}"


def _row_label(preset: Preset) -> str:
    n = get_model(preset.model).n_parameters
    return f"{preset.source}\n{n} parameters, {get_scheme(preset.scheme).title}"


def _places(approaches: list[str]) -> dict[str, float]:
    """Vertical offset of each approach within a row."""
    return dict(zip(approaches, np.linspace(-0.17, 0.17, len(approaches)), strict=True))


def _draw_group(ax: Axes, rows: pd.DataFrame, approaches: list[str]) -> None:
    marks = []
    for y, preset in enumerate(PRESETS):
        drawn = False
        for approach, offset in _places(approaches).items():
            parameters = rows[rows["cell"] == _cell(preset, approach)]
            if parameters.empty:
                continue
            drawn = True
            values, _ = shown(parameters["sd_empirical"], parameters["unit"].iloc[0])
            pale = bool(parameters["estimable"].all())
            marks.append(_Mark(approach, y + offset, values.mean(), pale))
        if not drawn:
            _dash(ax, y)
    _draw_marks(ax, marks)


def _draw_tilt(
    ax: Axes, leveling: pd.DataFrame, summary: pd.DataFrame, approaches: list[str]
) -> None:
    ax.set_title("tilt error\n(roll, rms)")
    ax.set_xlabel(shown([], "mgon")[1])
    errors = {} if leveling.empty else leveling.set_index("cell")["roll_rms_mgon"].to_dict()
    rms = dict(zip(errors, shown(list(errors.values()), "mgon")[0], strict=True))
    run = set(summary["cell"])
    marks = []
    for y, preset in enumerate(PRESETS):
        for approach, offset in _places(approaches).items():
            cell = _cell(preset, approach)
            if cell in run:
                marks.append(_Mark(approach, y + offset, rms.get(cell, np.nan)))
    _draw_marks(ax, marks)


@dataclass(frozen=True)
class _Mark:
    """A standard deviation in a row; NaN or 0 where there is none, then pale or not."""

    approach: str
    y: float
    value: float
    pale: bool = False

    @property
    def known(self) -> bool:
        return bool(np.isfinite(self.value) and self.value > 0)


def _draw_marks(ax: Axes, marks: list[_Mark]) -> None:
    """Markers and numbers at standard deviations, or crosses where there are none."""
    for (approach, known, pale), group in groupby(sorted(marks, key=_alike), key=_alike):
        members = list(group)
        colour, y = approach_colour(approach), [mark.y for mark in members]
        if not known:
            ax.plot(
                np.full(len(members), CROSS_AT),
                y,
                "x",
                color=colour,
                transform=ax.get_yaxis_transform(),
                alpha=PALE if pale else 1,
            )
            continue
        ax.plot([mark.value for mark in members], y, approach_marker(approach), color=colour)
        for mark in members:
            ax.annotate(
                _number(mark.value),
                (mark.value, mark.y),
                (4, 0),
                textcoords="offset points",
                color=colour,
                va="center",
                fontsize=6.5,
                in_layout=False,
            )


def _alike(mark: _Mark) -> tuple[str, bool, bool]:
    """Marks that are alike are one artist, which is faster to draw."""
    return mark.approach, mark.known, mark.pale and not mark.known


def _number(value: float) -> str:
    """Two significant digits, three from 10 to 100 and whole numbers above."""
    decimals = 1 if value >= 10 else 1 - int(np.floor(np.log10(value)))
    return f"{value:.{decimals if value < 100 else 0}f}"


def _dash(ax: Axes, y: int) -> None:
    ax.text(
        0.5,
        y,
        "–",
        transform=ax.get_yaxis_transform(),
        color="#999999",
        ha="center",
        va="center",
        in_layout=False,
    )


def _finish(ax: Axes) -> None:
    """Logarithmic axis about the values, with room for their numbers and for the crosses."""
    from matplotlib.ticker import LogLocator, NullLocator

    values = np.concatenate(
        [np.asarray(line.get_xdata(), float) for line in ax.get_lines() if line.get_marker() != "x"]
        or [np.empty(0)]
    )
    ax.grid(False, axis="y")
    ax.tick_params(axis="y", length=0)
    between: Style = {"transform": ax.get_yaxis_transform(), "colors": "#EEEEEE", "zorder": 0}
    ax.hlines(np.arange(len(PRESETS) - 1) + 0.5, 0, 1, linewidth=0.6, **between)
    if len(values) == 0:
        ax.set_xticks([])
        say_empty(ax)
        return
    low, high = values.min() / 1.5, values.max() * 1.5
    ax.set_xscale("log")
    ax.set_xlim(low, high * (high / low) ** 0.55)
    low, high = ax.get_xlim()
    ticks = np.asarray(LogLocator(subs=(1, 2, 5)).tick_values(low, high))
    shown = ticks[(ticks >= low) & (ticks <= high)]
    shown = shown[spread(np.log(shown) / np.log(high / low), 0.38)]
    ax.set_xticks(shown, [f"{value:g}" for value in shown])
    ax.xaxis.set_minor_locator(NullLocator())
