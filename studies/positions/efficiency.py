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
from accelstudy.design.criteria import get_criterion, rms_tilt
from accelstudy.design.search import Search
from accelstudy.design.spaces import Attitudes
from accelstudy.design.task import Task
from accelstudy.drawing.style import FULL, INK, approach_colour, log_ticks, new_figure
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import NINE, get_model

CRITERIA = {"D": ("#0072B2", "o"), "A": ("#009E73", "s"), "I": ("#D55E00", "D")}
"""Colour and marker of each criterion."""
TASKS = [Task(get_model(NINE), get_approach(name)) for name in ("gravity", "robot")]
SCHEMES = [get_scheme(name) for name in scheme_names()]
POSITIONS = (9, 12, 18, 24, 36)  # of the I-optimal designs beside the schemes
SEED = 1  # of the search for the designs


def efficiency_table(
    tasks: Iterable[Task] = TASKS,
    schemes: Sequence[Scheme] = SCHEMES,
    positions: Sequence[int] = POSITIONS,
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
    rows: list[dict[str, Any]] = []
    for task in tasks:
        criteria = {name: get_criterion(name, task) for name in CRITERIA}
        # For shares that sum to one position; n positions have n times the information.
        bounds = {
            name: continuous_optimum(task, criterion, Attitudes(), 1).bound
            for name, criterion in criteria.items()
        }
        shown = {scheme.title: scheme.directions for scheme in schemes}
        for n in positions:
            shown[f"{n} I-optimal"] = Search(task, criteria["I"], seed=SEED).optimum(n)
        for i, (title, directions) in enumerate(shown.items()):
            n, reason = len(directions), task.missing(directions)
            row = {
                "approach": task.approach.name, "scheme": title, "designed": i >= len(schemes),
                "n": n, "reason": reason, "least_rms": np.exp(bounds["I"] / 2) / np.sqrt(n),
            }  # fmt: skip
            if not reason:
                row["rms"] = np.sqrt(np.mean(rms_tilt(task, directions) ** 2))
                information = task.normal(directions) / n
                for name, c in criteria.items():
                    row[name] = min(1.0, c.efficiency(float(c.value(information)), bounds[name]))
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
    groups = table.groupby("approach", sort=False)
    figure = new_figure(FULL, 40 + height + 62)
    axes = figure.subplots(2, len(groups), height_ratios=[height + 14, 62], squeeze=False)
    for (approach, rows), (above, below) in zip(groups, axes.T, strict=True):
        for name, (colour, marker) in CRITERIA.items():
            above.plot(100 * rows[name], titles, marker, color=colour, label=name)
        for title in rows.loc[rows["reason"] != "", "scheme"]:
            above.text(
                2, title, "does not determine the model", va="center", color="#777777", size=7
            )
        above.set(title=f"{approach}: share of the best there can be", xlabel="efficiency, %",
                  xlim=(0, 103), ylim=(len(titles) - 0.4, -0.6))  # fmt: skip
        _over_positions(below, rows[rows["reason"] == ""], approach_colour(str(approach)))
        below.set_title(f"{approach}: expected rms")
    for ax in axes[0, 1:]:
        ax.set_yticks(range(len(titles)), [])
    axes[0, 0].legend(title="criterion", loc="center left")
    axes[1, 0].set_ylabel(f"rms of roll and pitch, {display_unit('rad')}")
    axes[1, -1].legend(loc="best")
    return figure


def _over_positions(ax: Axes, rows: pd.DataFrame, colour: str) -> None:
    n = np.geomspace(rows["n"].min(), rows["n"].max(), 60)
    one = float((rows["least_rms"] * np.sqrt(rows["n"])).iloc[0])
    ax.plot(n, to_display(one / np.sqrt(n), "rad"), color=INK, label="no positions are below")
    schemes, designs = rows[~rows["designed"]], rows[rows["designed"]]
    looks = (schemes, "schemes", "o", colour), (designs, "I-optimal designs", "D", "white")
    for part, label, marker, face in looks:
        ax.plot(part["n"], to_display(part["rms"], "rad"), marker, color=colour, label=label,
                markerfacecolor=face)  # fmt: skip
    ax.set(yscale="log", xlabel="positions")
    log_ticks(ax.yaxis, *to_display(np.array([rows["least_rms"].min(), rows["rms"].max()]), "rad"))
