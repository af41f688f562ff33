"""The efficiency of schemes, compared with the best possible set of as many positions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import matplotlib as mpl
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
from accelstudy.drawing.style import FULL, INK, STYLE, Style, approach_colour, log_ticks, new_figure
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import NINE, get_model

CRITERIA = ("D", "A", "I")
TASKS = [Task(get_model(NINE), get_approach(name)) for name in ("gravity", "robot")]
SCHEMES = [get_scheme(name) for name in scheme_names()]
POSITIONS = (9, 12, 18, 24, 36)
"""Numbers of positions of the I-optimal designs beside the schemes."""
SEED = 1


def efficiency_table(
    tasks: Iterable[Task], schemes: Iterable[Scheme], positions: Iterable[int], seed: int = SEED
) -> pd.DataFrame:
    """Efficiency of schemes and of I-optimal designs by each criterion.

    Parameters
    ----------
    tasks : calibrations for which all of them are judged
    schemes : Schemes
    positions : numbers of positions of the designs
    seed : int, of the search for the designs

    Returns
    -------
    DataFrame
        For each task, scheme and criterion: approach, model, scheme, title, status, n, criterion,
        efficiency (0 where the scheme does not determine the model; `reason` says why), rms_roll
        and rms_pitch (rad, NaN likewise), and least_rms, the lower bound for any n positions
        of the rms of roll and pitch together (I only).
    """
    schemes = list(schemes)
    tables = [_of_task(task, schemes, positions, seed) for task in tasks]
    return pd.concat(tables, ignore_index=True)


def _of_task(
    task: Task, schemes: list[Scheme], positions: Iterable[int], seed: int
) -> pd.DataFrame:
    criteria = {name: get_criterion(name, task) for name in CRITERIA}
    # For shares that sum to one position; n positions have n times the information.
    bounds = {
        name: continuous_optimum(task, criterion, Sphere(), Constraints(), 1).bound
        for name, criterion in criteria.items()
    }
    designs = [
        Scheme(
            f"I-optimal {n}",
            f"{n} I-optimal",
            optimal_design(task, criteria["I"], n, seed=seed, bounded=False).directions,
            "generated",
            "accelstudy design",
        )
        for n in positions
    ]
    rows: list[Mapping[str, object]] = []
    for scheme in [*schemes, *designs]:
        n, reason = scheme.n_positions, task.missing(scheme.directions)
        roll, pitch = (np.nan, np.nan) if reason else task.rms_tilt(scheme.directions)
        for name, criterion in criteria.items():
            share = 0.0
            if not reason:
                value = float(criterion.value(task.normal(scheme.directions) / n))
                share = min(1.0, criterion.efficiency(value, bounds[name]))
            rows.append(
                {
                    "model": task.model.name,
                    "approach": task.approach.name,
                    "scheme": scheme.name,
                    "title": scheme.title,
                    "status": scheme.status,
                    "n": n,
                    "criterion": name,
                    "efficiency": share,
                    "rms_roll": roll,
                    "rms_pitch": pitch,
                    "least_rms": float(np.exp(bounds["I"] / 2) / np.sqrt(n)),
                    "reason": reason,
                }
            )
    return pd.DataFrame(rows)


MARKS = {"D": ("#0072B2", "o"), "A": ("#009E73", "s"), "I": ("#D55E00", "D")}
"""Colour and marker of each criterion."""


def efficiency_figure(table: pd.DataFrame) -> Figure:
    """Efficiency by the three criteria, one panel for each approach, and rms over positions.

    Parameters
    ----------
    table : DataFrame, of `efficiency_table`
    """
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        approaches = list(dict.fromkeys(table["approach"]))
        schemes = list(dict.fromkeys(table["scheme"]))
        figure = new_figure(FULL, 40 + 5.2 * len(schemes) + 62)
        grid = figure.add_gridspec(2, len(approaches), height_ratios=[5.2 * len(schemes) + 14, 62])
        for column, approach in enumerate(approaches):
            part = table[table["approach"] == approach]
            above = figure.add_subplot(grid[0, column])
            _efficiencies(above, part, schemes, approach, column == 0)
            below = figure.add_subplot(grid[1, column])
            _over_positions(below, part, approach, column == 0, column == len(approaches) - 1)
        return figure


def _efficiencies(
    ax: Axes, table: pd.DataFrame, schemes: list[str], approach: str, labelled: bool
) -> None:
    titles = table.drop_duplicates("scheme").set_index("scheme")["title"]
    for name, (colour, marker) in MARKS.items():
        part = table[table["criterion"] == name].set_index("scheme")
        determined = [s for s in schemes if not part.loc[s, "reason"]]
        y = [schemes.index(s) for s in determined]
        ax.plot(100 * part.loc[determined, "efficiency"], y, marker, color=colour, label=name)
    for place, scheme in enumerate(schemes):
        if table.loc[table["scheme"] == scheme, "reason"].iloc[0]:
            ax.text(2, place, "does not determine the model", va="center", color="#777777", size=7)
    ax.set_xlim(0, 103)
    ax.set_ylim(len(schemes) - 0.4, -0.6)
    ax.set_yticks(range(len(schemes)), [titles[s] for s in schemes] if labelled else [])
    ax.set_title(f"{approach}: share of the best there can be")
    ax.set_xlabel("efficiency, %")
    if labelled:
        ax.legend(title="criterion", loc="center left")


def _over_positions(
    ax: Axes, table: pd.DataFrame, approach: str, labelled: bool, last: bool
) -> None:
    rows = table[(table["criterion"] == "I") & (table["reason"] == "")].copy()
    rows["rms"] = np.sqrt((rows["rms_roll"] ** 2 + rows["rms_pitch"] ** 2) / 2)
    n = np.geomspace(rows["n"].min(), rows["n"].max(), 60)
    one = float((rows["least_rms"] * np.sqrt(rows["n"])).iloc[0])
    ax.plot(n, to_display(one / np.sqrt(n), "rad"), color=INK, label="no positions are below")
    designed = rows["scheme"].str.startswith("I-optimal ")
    style: Style = {"color": approach_colour(approach), "linestyle": ""}
    ax.plot(rows["n"][~designed], to_display(rows["rms"][~designed], "rad"), marker="o", **style,
            label="schemes")  # fmt: skip
    ax.plot(rows["n"][designed], to_display(rows["rms"][designed], "rad"), marker="D", **style,
            markerfacecolor="white", label="I-optimal designs")  # fmt: skip
    least, most = (
        float(to_display(value, "rad")) for value in (rows["least_rms"].min(), rows["rms"].max())
    )
    ax.set_yscale("log")
    log_ticks(ax.yaxis, least, most)
    ax.set_xlabel("positions")
    ax.set_title(f"{approach}: expected rms")
    if labelled:
        ax.set_ylabel(f"rms of roll and pitch, {display_unit('rad')}")
    if last:
        ax.legend(loc="best")
