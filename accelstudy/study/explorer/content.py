"""What an explorer shows of a study, from its tables: set-ups, and their parameters.

A set-up is a cell of the study. Numbers are in the units that people see.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.approaches import get_approach
from accelstudy.basics.units import display_unit
from accelstudy.drawing.style import in_shown_unit, model_title
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import NOISES
from accelstudy.study.figures.panels import ANGLES, by_cell, group_sds, in_shown_units
from accelstudy.study.figures.registry import Tables
from accelstudy.study.statistics import TILTS

ENDS = {"low": 0.025, "q95": 0.95, "high": 0.975}
"""Probabilities at the ends of the central 95 %, and of what 95 % stay below."""
IN_UNITS = ("truth", "bias", "sd_empirical", "sd_posteriori_mean", "sd_linear")
SHARES = ("sd_ratio", "coverage_95")
"""Columns of the summary in the unit of a parameter, and without one."""


def setups(cells: pd.DataFrame, tables: Tables) -> tuple[pd.DataFrame, dict[str, str]]:
    """Set-ups, a row each; and titles of the columns that a reader sees, in their order."""
    unit, tilt = display_unit("rad"), _tilt(cells, tables)
    columns: dict[str, tuple[str, Any]] = {
        "model": ("model", _titles(cells["model"], model_title)),
        "scheme": ("scheme", _titles(cells["scheme"], lambda name: get_scheme(name).title)),
        "approach": ("approach", cells["approach"].astype(str)),
        "n": ("positions", cells["n_positions"]),
    }
    uses_robot = np.array([get_approach(name).uses_angles for name in cells["approach"]])
    noises = cells.assign(robot_sigma_mgon=cells["robot_sigma_mgon"].where(uses_robot))
    for factor in NOISES:
        if noises[factor.column].any():
            levels = pd.Series(factor.shown(noises[factor.column]))
            title = f"{factor.title} / {factor.shown_unit}"
            columns[factor.name] = title, levels.map(lambda level: float(f"{level:.6g}"))
    for name in ("roll_rms", "roll_q95", "pitch_rms", "pitch_q95", "both_q95"):
        title = name.replace("_q95", " 95 % below").replace("_", " ")
        columns[name] = f"{title} / {unit}", tilt.pop(name)
    groups = group_sds(tables["summary"]).groupby(["label", "unit"], sort=False)
    for number, (_, rows) in enumerate(groups):
        title = "sd of {label} / {unit}".format_map(rows.iloc[0])
        columns[f"sd-{number}"] = title, cells["cell"].map(by_cell(rows, "value"))
    counts = zip(cells["reason"], cells["n_converged"], cells["n_replicates"], strict=True)
    states = [
        f"not estimable: {reason}" if reason else f"{some} of {all_of} converged"
        for reason, some, all_of in counts
    ]
    columns["redundancy"] = "redundancy", cells["redundancy"]
    columns["condition"] = "condition", cells["condition"].astype(float)
    columns["state"] = "state", states
    table = pd.DataFrame({"i": range(len(cells)), "cell": cells["cell"].astype(str)})
    table = table.assign(**{name: each for name, (_, each) in columns.items()}, **tilt)
    return table, {name: title for name, (title, _) in columns.items()}


def _titles(names: pd.Series, title: Callable[[str], str]) -> list[str]:
    """Titles by which a reader chooses, with the name where several have the same."""
    titles = {name: title(name) for name in names.unique()}
    count = Counter(titles.values())
    return [titles[n] if count[titles[n]] == 1 else f"{titles[n]} ({n})" for n in names]


def _tilt(cells: pd.DataFrame, tables: Tables) -> dict[str, np.ndarray]:
    """Tilt error of each cell: rms, central 95 %, and what 95 % stay below, singly and in both."""
    all_ends = pd.MultiIndex.from_product([ENDS, TILTS])
    ends = _ends(tables, "tilt", ["cell"], ["end", "name"]).reindex(columns=all_ends)
    columns: dict[str, Any] = {f"{name}_{end}": ends[end, name] for end, name in all_ends}
    for angle in ANGLES:
        columns[f"{angle}_rms"] = by_cell(tables["leveling"], f"{angle}_rms_mgon")
    return {
        name: in_shown_unit(cells["cell"].map(column).astype(float), "mgon")[0]
        for name, column in columns.items()
    }


def _ends(tables: Tables, quantity: str, by: list[str], columns: list[str]) -> pd.DataFrame:
    """Quantiles of a quantity at `ENDS`, the column `end` of the table before it is pivoted."""
    rows = tables["quantiles"][tables["quantiles"]["quantity"] == quantity]
    end = rows["probability"].astype(float).round(6).map({p: name for name, p in ENDS.items()})
    return rows.assign(end=end).pivot_table("value", by, columns)


def parameters(cells: pd.DataFrame, tables: Tables, setups: pd.DataFrame) -> pd.DataFrame:
    """Parameters of set-ups, a row each: their numbers, unit, and the fields of the set-up."""
    ends = _ends(tables, "sd_posteriori", ["cell", "name"], ["end"])
    ends = ends.reindex(columns=[*ENDS]).add_prefix("sd_posteriori_mean_")
    summary = tables["summary"].join(ends, on=["cell", "parameter"])
    numbers = [*IN_UNITS, "sd_posteriori_mean_low", "sd_posteriori_mean_high"]
    table = in_shown_units(summary, *numbers)[["cell", "parameter", "unit", *numbers, *SHARES]]
    fields = ["cell", "approach", "model", "scheme"]
    fields += [factor.name for factor in NOISES if factor.name in setups]
    return table.merge(setups[fields], on="cell").drop(columns="cell")
