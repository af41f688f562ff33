"""The efficiency of schemes, compared with the best possible set of as many positions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

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
    tasks: Iterable[Task], schemes: Iterable[Scheme], positions: Sequence[int], seed: int = SEED
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
    rows: list[Mapping[str, object]] = []
    schemes = list(schemes)
    for task in tasks:
        criteria = {name: get_criterion(name, task) for name in CRITERIA}
        # For shares that sum to one position; n positions have n times the information.
        bounds = {
            name: continuous_optimum(task, criterion, Sphere(), Constraints(), 1).bound
            for name, criterion in criteria.items()
        }
        designs = [
            Scheme(
                f"I-optimal {n}", f"{n} I-optimal",
                optimal_design(task, criteria["I"], n, seed=seed, bounded=False).directions,
                "generated", "accelstudy design",
            )
            for n in positions
        ]  # fmt: skip
        for scheme in [*schemes, *designs]:
            n, reason = scheme.n_positions, task.missing(scheme.directions)
            roll, pitch = (np.nan, np.nan) if reason else task.rms_tilt(scheme.directions)
            of_scheme = {
                **{"model": task.model.name, "approach": task.approach.name},
                **{name: getattr(scheme, name) for name in ("name", "title", "status")},
                **{"n": n, "rms_roll": roll, "rms_pitch": pitch, "reason": reason},
                "least_rms": float(np.exp(bounds["I"] / 2) / np.sqrt(n)),
            }
            for name, criterion in criteria.items():
                share = 0.0
                if not reason:
                    value = float(criterion.value(task.normal(scheme.directions) / n))
                    share = min(1.0, criterion.efficiency(value, bounds[name]))
                rows.append({**of_scheme, "criterion": name, "efficiency": share})
    return pd.DataFrame(rows).rename(columns={"name": "scheme"})


MARKS = {"D": ("#0072B2", "o"), "A": ("#009E73", "s"), "I": ("#D55E00", "D")}
"""Colour and marker of each criterion."""


def efficiency_figure(table: pd.DataFrame) -> Figure:
    """Efficiency by the three criteria, one panel for each approach, and rms over positions.

    Parameters
    ----------
    table : DataFrame, of `efficiency_table`
    """
    titles = table.drop_duplicates("scheme").set_index("scheme")["title"]
    height = 5.2 * len(titles)
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        groups = [*table.groupby("approach", sort=False)]
        figure = new_figure(FULL, 40 + height + 62)
        grid = figure.add_gridspec(2, len(groups), height_ratios=[height + 14, 62])
        for column, (approach, part) in enumerate(groups):
            above, below = (figure.add_subplot(grid[row, column]) for row in (0, 1))
            _efficiencies(above, part, [*titles.index])
            above.set_title(f"{approach}: share of the best there can be")
            above.set_yticks(range(len(titles)), titles if column == 0 else [])
            _over_positions(below, part, approach_colour(str(approach)))
            below.set_title(f"{approach}: expected rms")
            if column == 0:
                above.legend(title="criterion", loc="center left")
                below.set_ylabel(f"rms of roll and pitch, {display_unit('rad')}")
        below.legend(loc="best")
        return figure


def _efficiencies(ax: Axes, table: pd.DataFrame, schemes: list[str]) -> None:
    for name, (colour, marker) in MARKS.items():
        part = table[(table["criterion"] == name) & (table["reason"] == "")]
        y = [schemes.index(scheme) for scheme in part["scheme"]]
        ax.plot(100 * part["efficiency"], y, marker, color=colour, label=name)
    for scheme in table.loc[table["reason"] != "", "scheme"].unique():
        ax.text(2, schemes.index(scheme), "does not determine the model", va="center",
                color="#777777", size=7)  # fmt: skip
    ax.set(xlim=(0, 103), ylim=(len(schemes) - 0.4, -0.6), xlabel="efficiency, %")


def _over_positions(ax: Axes, table: pd.DataFrame, colour: str) -> None:
    rows = table[(table["criterion"] == "I") & (table["reason"] == "")]
    rms = np.sqrt((rows["rms_roll"] ** 2 + rows["rms_pitch"] ** 2) / 2)
    n = np.geomspace(rows["n"].min(), rows["n"].max(), 60)
    one = float((rows["least_rms"] * np.sqrt(rows["n"])).iloc[0])
    ax.plot(n, to_display(one / np.sqrt(n), "rad"), color=INK, label="no positions are below")
    designed = rows["scheme"].str.startswith("I-optimal ")
    looks: dict[str, tuple[pd.Series, Style]] = {
        "schemes": (~designed, {"marker": "o"}),
        "I-optimal designs": (designed, {"marker": "D", "markerfacecolor": "white"}),
    }
    for label, (chosen, look) in looks.items():
        ax.plot(rows["n"][chosen], to_display(rms[chosen], "rad"), color=colour, linestyle="",
                label=label, **look)  # fmt: skip
    ends = (float(to_display(end, "rad")) for end in (rows["least_rms"].min(), rms.max()))
    ax.set(yscale="log", xlabel="positions")
    log_ticks(ax.yaxis, *ends)
