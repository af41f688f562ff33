"""The efficiency of schemes, compared with the best possible set of as many positions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from accelstudy.approaches import get_approach
from accelstudy.basics.units import display_unit, to_display
from accelstudy.design.continuous import continuous_optimum
from accelstudy.design.criteria import get_criterion
from accelstudy.design.search import optimal_design
from accelstudy.design.spaces import Constraints, Sphere
from accelstudy.design.task import Task
from accelstudy.drawing.style import FULL, INK, approach_colour, log_ticks, new_figure
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import NINE, get_model

CRITERIA = {"D": ("#0072B2", "o"), "A": ("#009E73", "s"), "I": ("#D55E00", "D")}
"""Colour and marker of each criterion."""
TASKS = [Task(get_model(NINE), get_approach(name)) for name in ("gravity", "robot")]
SCHEMES = [get_scheme(name) for name in scheme_names()]
POSITIONS = (9, 12, 18, 24, 36)
"""Numbers of positions of the I-optimal designs beside the schemes."""
SEED = 1
"""Of the search for the designs."""


def efficiency_table(
    tasks: Iterable[Task], schemes: Sequence[Scheme], positions: Sequence[int]
) -> pd.DataFrame:
    """Efficiency of schemes and of I-optimal designs by each criterion.

    Parameters
    ----------
    tasks : calibrations for which all of them are judged
    schemes : Schemes
    positions : numbers of positions of the designs

    Returns
    -------
    DataFrame
        For each task and scheme: approach, scheme, whether it is one of the designs, n, the
        efficiency by each criterion and the rms of roll and pitch together (rad), or the reason
        why it does not determine the model; and least_rms, the lower bound for any n positions.
    """
    rows = []
    for task in tasks:
        criteria = {name: get_criterion(name, task) for name in CRITERIA}
        # For shares that sum to one position; n positions have n times the information.
        bounds = {
            name: continuous_optimum(task, criterion, Sphere(), Constraints(), 1).bound
            for name, criterion in criteria.items()
        }
        candidates = [(scheme.title, False, scheme.directions) for scheme in schemes]
        for n in positions:
            best = optimal_design(task, criteria["I"], n, seed=SEED, bounded=False)
            candidates.append((f"{n} I-optimal", True, best.directions))
        for title, designed, directions in candidates:
            n, reason = len(directions), task.missing(directions)
            row: dict[str, Any] = {
                "approach": task.approach.name, "scheme": title, "designed": designed, "n": n,
                "reason": reason, "least_rms": float(np.exp(bounds["I"] / 2) / np.sqrt(n)),
            }  # fmt: skip
            if not reason:
                row["rms"] = float(np.sqrt(np.mean(task.rms_tilt(directions) ** 2)))
                information = task.normal(directions) / n
                for name, one in criteria.items():
                    value = float(one.value(information))
                    row[name] = min(1.0, one.efficiency(value, bounds[name]))
            rows.append(row)
    return pd.DataFrame(rows)


def efficiency_figure(table: pd.DataFrame) -> Figure:
    """Efficiency by the three criteria, one panel for each approach, and rms over positions.

    Parameters
    ----------
    table : DataFrame, of `efficiency_table`
    """
    titles = [*table["scheme"].unique()]
    height = 5.2 * len(titles)
    groups = [*table.groupby("approach", sort=False)]
    figure = new_figure(FULL, 40 + height + 62)
    grid = figure.add_gridspec(2, len(groups), height_ratios=[height + 14, 62])
    for column, (approach, part) in enumerate(groups):
        above, below = (figure.add_subplot(grid[row, column]) for row in (0, 1))
        _efficiencies(above, part)
        above.set_title(f"{approach}: share of the best there can be")
        above.set_yticks(range(len(titles)), titles if column == 0 else [])
        _over_positions(below, part[part["reason"] == ""], approach_colour(str(approach)))
        below.set_title(f"{approach}: expected rms")
        if column == 0:
            above.legend(title="criterion", loc="center left")
            below.set_ylabel(f"rms of roll and pitch, {display_unit('rad')}")
    below.legend(loc="best")
    return figure


def _efficiencies(ax: Axes, rows: pd.DataFrame) -> None:
    y = np.arange(len(rows))
    for name, (colour, marker) in CRITERIA.items():
        ax.plot(100 * rows[name], y, marker, color=colour, label=name)
    for i in y[rows["reason"] != ""]:
        ax.text(2, i, "does not determine the model", va="center", color="#777777", size=7)
    ax.set(xlim=(0, 103), ylim=(len(rows) - 0.4, -0.6), xlabel="efficiency, %")


def _over_positions(ax: Axes, rows: pd.DataFrame, colour: str) -> None:
    n = np.geomspace(rows["n"].min(), rows["n"].max(), 60)
    one = float((rows["least_rms"] * np.sqrt(rows["n"])).iloc[0])
    ax.plot(n, to_display(one / np.sqrt(n), "rad"), color=INK, label="no positions are below")
    looks: Any = {"schemes": {"marker": "o"},
                  "I-optimal designs": {"marker": "D", "markerfacecolor": "white"}}  # fmt: skip
    for (_, part), (label, look) in zip(rows.groupby("designed"), looks.items(), strict=True):
        ax.plot(part["n"], to_display(part["rms"], "rad"), color=colour, linestyle="", label=label,
                **look)  # fmt: skip
    ends = (float(to_display(end, "rad")) for end in (rows["least_rms"].min(), rows["rms"].max()))
    ax.set(yscale="log", xlabel="positions")
    log_ticks(ax.yaxis, *ends)
