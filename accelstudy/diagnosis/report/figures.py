"""The figures of a diagnosis."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import shown_unit, to_display
from accelstudy.basics.wording import probability, words
from accelstudy.diagnosis.decision.functions import LearnedShape
from accelstudy.diagnosis.decision.posterior import Explanation
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.report.words import TARGETS, coordinate_of
from accelstudy.diagnosis.result import CampaignDiagnosis
from accelstudy.diagnosis.space.shapes import coordinate_in_holds
from accelstudy.drawing.style import (
    ANGLE_COLOURS,
    COLUMN,
    FULL,
    INK,
    new_figure,
    say_empty,
)


def diagnosis_figures(
    diagnosis: CampaignDiagnosis, positions: pd.DataFrame
) -> dict[str, Callable[[], Figure]]:
    """Return a function that draws each figure; figures that would show nothing are left out.

    Parameters
    ----------
    diagnosis : CampaignDiagnosis
    positions : DataFrame, of `Diagnosis.positions`
    """
    d = diagnosis
    figures: dict[str, Callable[[], Figure]] = {"residuals": lambda: residual_figure(d, positions)}
    if d.probabilities:
        figures["evidence"] = lambda: evidence_figure(d)
    if (shape := d.shape) is not None:
        figures["shape"] = lambda: shape_figure(shape)
    return figures


BEFORE, AFTER, NOISE = "#D55E00", "#0072B2", "#E6E6E6"
OTHER_COLOUR = "#999999"


AXES = {"x": ("#0072B2", "o"), "y": ("#E69F00", "s"), "z": ("#009E73", "^"), "norm": (INK, "o")}
"""Colour and marker of the components of a residual."""
MAX_DISTINCT = 4
"""Number of different values up to which the components of a residual stand side by side."""
ABREAST = 0.03
"""Distance of the components there, as a part of the range."""


def residual_figure(diagnosis: CampaignDiagnosis, positions: pd.DataFrame) -> Figure:
    """Residuals before and after against direction, time and temperature."""
    d, names = diagnosis, _components(positions)
    panels = _panels(d, positions, len(names))
    rows = ("before",) if d.final is d.frame else ("before", "after")
    figure = new_figure(FULL, 12 + 46 * len(rows))
    # The scale of an outlier position would hide all others.
    sharey: Literal["all", "row"] = "row" if d.extended_model is d.model else "all"
    grid = figure.subplots(len(rows), len(panels), sharey=sharey, sharex="col", squeeze=False)
    # Labels of narrow panels must not meet.
    ticks = 3 if len(panels) > 2 else 5
    # Residuals that exceed the stated noise must look too large.
    sigma = np.sqrt(d.noise_variance) * d.frame.residuals.sigma
    for when, line in zip(rows, grid, strict=True):
        for (label, abscissa), ax in zip(panels.items(), line, strict=True):
            ax.axhspan(-2e3 * sigma, 2e3 * sigma, color=NOISE)
            _draw_residuals(ax, positions, when, abscissa)
            ax.xaxis.set_major_locator(MaxNLocator(ticks, steps=[1, 2, 5, 10]))
            if when == rows[-1]:
                ax.set_xlabel(label)
        title = "base model" if when == "before" else "with what was found"
        line[0].set_ylabel(f"{title}\nresidual / (mm/s²)")
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper left", ncols=7)
    return figure


def _components(positions: pd.DataFrame) -> list[str]:
    """Names of the components of a residual."""
    return [name for name in AXES if f"residual_{name}_before_mps2" in positions]


def _panels(diagnosis: CampaignDiagnosis, positions: pd.DataFrame, count: int) -> dict[str, Array]:
    """Abscissas (n, count) of the components in each panel, by its label."""
    frame = diagnosis.frame
    unit = frame.forces / frame.solution.gravity
    panels = {"$f/g$ of the same axis": unit}
    if count == 1:
        panels = {f"$f_{axis}/g$": unit[:, [k]] for k, axis in enumerate("xyz")}
    recorded = {"time": positions["time_s"], "temperature": positions["temperature_degC"]}
    varying = {name: one for name, one in recorded.items() if one.notna().all() and np.ptp(one) > 0}
    columns = {name: one.to_numpy()[:, None] for name, one in varying.items()}
    # What is missing shows over the coordinate that has it.
    coordinate = diagnosis.like[0].coordinate if diagnosis.like else "force"
    shown = frame.course if coordinate == "time" else coordinate
    if shown not in ("force", *recorded):
        columns[shown] = coordinate_in_holds(coordinate, frame)
    for name, values in columns.items():
        of = coordinate_of(name)
        words, arguments = _axis(of.place), values.shape[1]
        if arguments == count:  # each component has its own
            panels[_per_unit(words, of.unit)] = _abreast(values / of.size)
            continue
        parts = {1: [words], 2: ["roll", "pitch"], 3: [f"{words}, {axis}" for axis in "xyz"]}
        for part, x in zip(parts[arguments], values.T / of.size, strict=True):
            panels[_per_unit(part, of.unit)] = _abreast(np.repeat(x[:, None], count, axis=1))
    return panels


def _abreast(values: Array) -> Array:
    """Abscissas (n, count) of components, aside of each other where few values would hide them."""
    count = values.shape[1]
    aside = ABREAST * np.ptp(values) * (np.arange(count) - (count - 1) / 2)
    return values + aside * (len(np.unique(values)) <= MAX_DISTINCT)


def _draw_residuals(ax: Axes, positions: pd.DataFrame, when: str, abscissa: Array) -> None:
    """Draw all components over abscissas (n, components)."""
    ax.axhline(0, color=INK, linewidth=0.6)
    left_out = positions["split"] == "left out"
    for name, x in zip(_components(positions), abscissa.T, strict=True):
        colour, marker = AXES[name]
        label = "|f| − g" if name == "norm" else f"${name}$"
        values = 1e3 * positions[f"residual_{name}_{when}_mps2"]
        ax.plot(x, values, marker, color=colour, markersize=3.2, label=label)
        if when == "before" and left_out.any():
            ax.plot(x[left_out], values[left_out], "o", color=BEFORE, markersize=9,
                    markerfacecolor="none")  # fmt: skip
    ax.margins(y=0.08)


MIN_DRAWN = 1e-3
"""Least probability of a name that the figure has."""


def evidence_figure(diagnosis: CampaignDiagnosis) -> Figure:
    """Posterior probability of each name, alone or with others."""
    drawn = {n: p for n, p in diagnosis.probabilities.items() if p >= MIN_DRAWN}
    found = {one.name for one in diagnosis.found} | ({UNKNOWN} if diagnosis.shape else set())
    figure = new_figure(FULL, 22 + 4.4 * len(drawn))
    ax = figure.subplots()
    draw_shares(
        ax,
        {words(name): p for name, p in drawn.items()},
        [AFTER if name in found else OTHER_COLOUR for name in drawn],
    )
    ax.set_xlabel("posterior probability, alone or with others")
    return figure


def draw_shares(ax: Axes, shares: Mapping[str, float], colour: str | Sequence[str]) -> None:
    """Draw probabilities as bars, the first on top, with their names and numbers."""
    drawn = ax.barh([*shares], [*shares.values()], color=colour, height=0.6)
    ax.bar_label(drawn, [*map(probability, shares.values())], padding=2, fontsize=7.5)
    ax.set(xlim=(0, 1.18), xlabel="posterior probability")
    ax.grid(axis="y", visible=False)
    ax.invert_yaxis()


def draw_explanations(ax: Axes, explanations: tuple[Explanation, ...]) -> None:
    """Draw the posterior of each explanation; nothing is missing if there are none."""
    if not explanations:
        say_empty(ax, "nothing is missing")
        return
    draw_shares(ax, {"\nwith ".join(map(words, e.names)): e.posterior for e in explanations}, AFTER)


COMPONENTS = {
    **{name: colour for name, (colour, _) in AXES.items()},
    **ANGLE_COLOURS,
    **{"a": "#332288", "b": "#CC79A7"},
}
"""Colour of what depends on the coordinate of a learned function."""
BAND = 1.96
"""Half of a band of 95 %, in sigmas."""


def shape_figure(shape: LearnedShape) -> Figure:
    """Draw a learned function with its band over its coordinate."""
    figure = new_figure(COLUMN, 10 + 36 * len(shape.components))
    panels = figure.subplots(len(shape.components), 1, sharex=True, sharey=True)
    of, (label, *_) = coordinate_of(shape.effect.coordinate), TARGETS[shape.effect.target]
    unit, grid = shown_unit(shape.unit), shape.grid / of.size
    for i, (name, ax) in enumerate(zip(shape.components, panels, strict=True)):
        colour = COMPONENTS[name]
        h, sigma = (to_display(v[:, i], shape.unit) for v in (shape.values, shape.sigmas))
        ax.axhline(0, color=INK, linewidth=0.6)
        ax.fill_between(grid, h - BAND * sigma, h + BAND * sigma, color=colour, alpha=0.25, lw=0)
        ax.plot(grid, h, color=colour)
        ax.set_ylabel(f"{label.format(name)}\n{_per_unit('h', unit)}")
        ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
        if name not in shape.axes:
            ax.set_title("no part of it shows", loc="right")
    panels[-1].set_xlabel(_per_unit(_axis(of.words), of.unit))
    return figure


def _axis(words: str) -> str:
    """Words of a coordinate, as an axis has them."""
    return words.removeprefix("the ")


def _per_unit(what: str, unit: str) -> str:
    """Label an axis: h / (mm/s²)."""
    return f"{what} / {f'({unit})' if '/' in unit else unit}".removesuffix(" / ")
