"""The figure of the residuals: against direction, time and temperature."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from accelstudy.diagnosis.report.document.positions import condition_sigma
from accelstudy.diagnosis.report.figures.colours import BEFORE, NOISE
from accelstudy.diagnosis.result import Diagnosis
from accelstudy.drawing.style import FULL, INK, new_figure

Array = NDArray[np.float64]
AXES = {"x": ("#0072B2", "o"), "y": ("#E69F00", "s"), "z": ("#009E73", "^"), "norm": (INK, "o")}
"""Colour and marker of the components of a residual."""
FEW = 4
"""Number of different values up to which the components of a residual stand side by side."""
ABREAST = 0.03
"""Distance of the components there, as a part of the range."""


def residual_figure(diagnosis: Diagnosis, positions: pd.DataFrame) -> Figure:
    """Residuals before and after against direction, time and temperature."""
    names = [name for name in AXES if f"residual_{name}_before_mps2" in positions]
    panels = _panels(diagnosis, positions, len(names))
    refitted = diagnosis.final is not diagnosis.examined
    explained = diagnosis.extended is not diagnosis.model
    rows = ("before", "after") if refitted else ("before",)
    figure = new_figure(FULL, 12 + 46 * len(rows))
    # The scale of a bumped position would hide all others.
    sharey: Literal["all", "row"] = "all" if explained else "row"
    grid = figure.subplots(len(rows), len(panels), sharey=sharey, sharex="col", squeeze=False)
    # Labels of narrow panels must not meet.
    ticks = 3 if len(panels) > 2 else 5
    # Residuals that exceed the stated noise must look too large.
    gap = diagnosis.gap
    posteriori = gap.before if gap.after is None else gap.after
    sigma = 1e3 * condition_sigma(diagnosis.base, 1.0 if diagnosis.sigma_known else posteriori)
    for when, line in zip(rows, grid, strict=True):
        for (label, abscissa), ax in zip(panels.items(), line, strict=True):
            ax.axhspan(-2 * sigma, 2 * sigma, color=NOISE)
            ax.axhline(0, color=INK, linewidth=0.6)
            for i, name in enumerate(names):
                _draw_component(ax, positions, name, when, abscissa(i), explained)
            ax.margins(y=0.08)
            ax.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
            if when == rows[-1]:
                ax.set_xlabel(label)
        title = "base model" if when == "before" else "with what was found"
        line[0].set_ylabel(f"{title}\nresidual / (mm/s²)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    figure.legend(once.values(), once.keys(), loc="outside upper left", ncols=7)
    return figure


def _panels(
    diagnosis: Diagnosis, positions: pd.DataFrame, count: int
) -> dict[str, Callable[[int], Array]]:
    """Abscissa of each panel by its label, as a function of the component; there are `count`."""
    frame = diagnosis.examined.frame
    unit = frame.forces / frame.solution.gravity
    panels: dict[str, Callable[[int], Array]] = {}
    if count == 1:
        for k, axis in enumerate("xyz"):
            panels[f"$f_{axis}/g$"] = lambda _, k=k: unit[:, k]  # type: ignore[misc]
    else:
        panels["$f/g$ of the same axis"] = lambda i: unit[:, i]
    for column, label, scale in (
        ("time_s", "time / min", 60),
        ("temperature_degC", "temperature / °C", 1),
    ):
        values = positions[column].to_numpy() / scale
        if np.isfinite(values).all() and np.ptp(values) > 0:
            panels[label] = lambda i, v=values: _abreast(v, i, count)  # type: ignore[misc]
    return panels


def _abreast(values: Array, i: int, count: int) -> Array:
    """Move component i of `count` aside where few values would let components hide each other."""
    if len(np.unique(values)) > FEW:
        return values
    return values + ABREAST * np.ptp(values) * (i - (count - 1) / 2)


def _draw_component(
    ax: Axes, positions: pd.DataFrame, name: str, when: str, x: Array, explained: bool
) -> None:
    colour, marker = AXES[name]
    label = "|f| − g" if name == "norm" else f"${name}$"
    values = 1e3 * positions[f"residual_{name}_{when}_mps2"]
    ax.plot(x, values, marker, color=colour, markersize=3.2, label=label)
    if when == "before" and explained:
        part = values - 1e3 * positions[f"residual_{name}_after_mps2"]
        dash = BEFORE if name == "norm" else colour
        ax.plot(x, part, "_", color=dash, markersize=8, markeredgewidth=1.3,
                label=f"{label}, explained")  # fmt: skip
    left_out = positions["split"] == "left out"
    if when == "before" and left_out.any():
        ax.plot(x[left_out], values[left_out], "o", color=BEFORE, markersize=9,
                markerfacecolor="none", label="left out")  # fmt: skip
