"""What a comparison of two calibrations writes: JSON, a figure and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from accelstudy.basics.units import GON, MGON, shown_unit, to_display
from accelstudy.basics.wording import estimate
from accelstudy.campaign.calibration.document import json_number, write_json
from accelstudy.drawing.saving import save_all
from accelstudy.drawing.style import FULL, INK, group_colour, group_of, new_figure, symbol
from accelstudy.effects import Parameter
from accelstudy.epochs.comparison import Comparison
from accelstudy.epochs.congruence import LEVEL
from accelstudy.pages import lines, write_page

STATES = {True: "unchanged", False: "changed"}
"""States by whether the calibrations are congruent, as `pages.BADGES` has them."""


def said(comparison: Comparison) -> list[str]:
    """Say whether the sensor changed, in what, and what it matters; the verdict comes first."""
    c = comparison
    worst = largest(c.parameters, c.epochs.detectable())
    changes = [_change(c, place) for place in c.changed]
    return lines(
        "epochs/wording.txt.j2", "verdict", c, changes, *c.tilt.tolist(), c.tilt_range, worst
    )


def largest(
    parameters: Sequence[Parameter], sizes: Sequence[float] | NDArray[np.float64]
) -> list[str]:
    """Name the largest of the sizes in each unit, with its parameter."""
    found: dict[str, tuple[float, str]] = {}
    for parameter, size in zip(parameters, sizes, strict=True):
        before = found.get(parameter.unit, (0.0, ""))
        found[parameter.unit] = max(before, (float(size), parameter.name))
    return [
        f"{estimate(size, size, unit)[1]} {shown_unit(unit)} in {name}".replace("  ", " ")
        for unit, (size, name) in found.items()
    ]


def _change(c: Comparison, place: int) -> str:
    """Name a parameter with its change."""
    sigma = float(np.sqrt(c.epochs.covariance[place, place]))
    return change_of(c.parameters[place], float(c.epochs.differences[place]), sigma)


def change_of(parameter: Parameter, value: float, sigma: float) -> str:
    """Name a parameter with its change, or its rate, and the sigma of that; in SI."""
    shown, uncertain = estimate(value, sigma, parameter.unit)
    sign = "" if shown.startswith("−") else "+"
    return f"{parameter.name} by {sign}{shown} ± {uncertain} {shown_unit(parameter.unit)}".strip()


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """Describe a comparison, in SI but for keys that name another unit."""
    c, sigma = comparison, np.sqrt(np.diag(comparison.epochs.covariance))
    (roll, pitch), (roll_by_chance, pitch_by_chance) = c.tilt / MGON
    return {
        "schema_version": 1,
        "first": c.first.content["campaign"],
        "second": c.second.content["campaign"],
        "state": STATES[c.test.congruent],
        "test": {
            "statistic": c.test.statistic,
            "dof": [c.test.dof[0], json_number(c.test.dof[1])],
            "p_value": c.test.p_value,
            "level": LEVEL,
        },
        "parameters": [
            {
                "name": parameter.name,
                "first": float(c.values[0, i]),
                "second": float(c.values[1, i]),
                "change": float(c.epochs.differences[i]),
                "sigma": float(sigma[i]),
                "detectable": float(detectable),
                "unit": parameter.unit,
                "changed": i in c.changed,
                "or": c.instead_of(i) if i in c.changed else [],
            }
            for i, (parameter, detectable) in enumerate(
                zip(c.parameters, c.epochs.detectable(), strict=True)
            )
        ],
        "covariance": c.epochs.covariance.tolist(),
        "only_first": c.only_in(c.first),
        "only_second": c.only_in(c.second),
        "tilt": {
            "roll_mgon": roll,
            "pitch_mgon": pitch,
            "roll_by_chance_mgon": roll_by_chance,
            "pitch_by_chance_mgon": pitch_by_chance,
            "max_tilt_gon": c.tilt_range / GON,
        },
        "verdict": " ".join(said(c)),
    }


def write_comparison(comparison: Comparison, folder: str | Path) -> dict[str, Any]:
    """Write comparison.json, report.html and the figure into a folder; returns the content."""
    folder, content = Path(folder), comparison_document(comparison)
    figures = {"changes": lambda: changes_figure(comparison)}
    drawn = save_all(figures, folder / "figures")
    sentences = said(comparison)
    write_page(
        folder / "report.html",
        "epochs/report.html.j2",
        " ".join(sentences),
        doc=content,
        c=comparison,
        lines=sentences,
        figures=drawn,
    )
    write_json(folder / "comparison.json", content)
    return content


def draw_changes(ax: Axes, comparison: Comparison) -> None:
    """Draw the change of each parameter over its sigma, with the interval that holds 95 %."""
    c = comparison
    change = c.epochs.differences / np.sqrt(np.diag(c.epochs.covariance))
    ax.axhline(0, color=INK, linewidth=0.8)
    for i, parameter in enumerate(c.parameters):
        colour = group_colour(group_of(parameter.name))
        filled = colour if i in c.changed else "white"
        ax.errorbar(i, change[i], 1.96, fmt="o", color=colour, markerfacecolor=filled, capsize=2.5)
    ax.set_xticks(range(len(c.parameters)), [symbol(p.name) for p in c.parameters])
    ax.set(ylabel="change / sigma")


def changes_figure(comparison: Comparison) -> Figure:
    """Draw the change of each parameter with its 95 % interval, an effect a panel."""
    c = comparison
    sigma = np.sqrt(np.diag(c.epochs.covariance))
    sizes = [len(effect.parameters) for effect in c.model.effects]
    figure = new_figure(FULL, 62)
    panels = figure.subplots(
        1, len(sizes), width_ratios=[size + 1 for size in sizes], squeeze=False
    )
    ends = np.cumsum([0, *sizes])
    for ax, effect, first, last in zip(panels[0], c.model.effects, ends, ends[1:], strict=False):
        each = range(first, last)
        unit = effect.parameters[0].unit
        names = [c.parameters[i].name for i in each]
        change = to_display(c.epochs.differences[first:last], unit)
        half = 1.96 * to_display(sigma[first:last], unit)
        colour = group_colour(group_of(names[0]))
        ax.axhline(0, color=INK, linewidth=0.8)
        ax.errorbar(range(len(names)), change, half, fmt="none", color=colour, capsize=2.5)
        for k, i in enumerate(each):
            filled = colour if i in c.changed else "white"
            ax.plot(k, change[k], "o", color=colour, markerfacecolor=filled)
        ax.set_xticks(range(len(names)), [symbol(name) for name in names])
        ax.set(ylabel=f"change / {shown_unit(unit)}", xlim=(-0.6, len(names) - 0.4))
        ax.set_title(effect.name.replace("_", " "))
    figure.suptitle("Change with its 95 % interval; full: changed")
    return figure
