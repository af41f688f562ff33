"""What an explorer shows of a study, from its tables: set-ups, their parameters, correlations.

A set-up is a cell of the study. Numbers are in the units that people see, with four digits, as text
that JSON takes: so they are counted before the page is made.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.approaches import get_approach
from accelstudy.drawing.style import group_label, group_of, in_order, model_title, shown, symbol
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.base import Tables
from accelstudy.study.figures.factors import NOISES, Factor, family

ANGLES = ("roll", "pitch")
QUANTITIES = {
    "truth": "truth",
    "bias": "bias",
    "bias_low": "bias_ci95_low",
    "bias_high": "bias_ci95_high",
    "empirical": "sd_empirical",
    "posteriori": "sd_posteriori_mean",
    "posteriori_low": "",
    "posteriori_high": "",
    "linear": "sd_linear",
    "closed": "sd_closed_form",
    "ratio": "sd_ratio",
    "ratio_low": "sd_ratio_ci95_low",
    "ratio_high": "sd_ratio_ci95_high",
    "coverage": "coverage_95",
    "coverage_low": "coverage_95_low",
    "coverage_high": "coverage_95_high",
}
"""What is shown of each parameter, and its column in the summary; the central 95 % of the sds a
posteriori are in the quantiles."""
_PLAIN = {
    "alpha": "α",
    "delta": "δ",
    "varepsilon": "ε",
    "theta": "θ",
    "phi": "φ",
    "perp": "⊥",
    "pm": "±",
}


def plain(parameter: str) -> str:
    """Return the symbol of a parameter as text: ``α_zx``."""
    text = re.sub(r"\\([a-z]+) ?", lambda match: _PLAIN.get(match[1], match[1]), symbol(parameter))
    return re.sub(r"[${}]", "", text)


def number(value: float) -> str:
    """Write a number as JSON takes it, with four digits; what is too large for it is infinite."""
    if np.isnan(value):
        return "null"
    return f"{value:.4g}".replace("inf", "1e999")


class Codes(dict[Any, int]):
    """Numbers of different things, in the order in which they came."""

    def __missing__(self, thing: Any) -> int:
        self[thing] = len(self)
        return self[thing]


def varied(cells: pd.DataFrame) -> list[Factor]:
    """Noises of which a study has more than one level."""
    return [factor for factor in NOISES if len(cells[factor.column].dropna().unique()) > 1]


def levels(cells: pd.DataFrame, factor: Factor) -> NDArray[np.float64]:
    """Levels of a factor as shown; NaN where a set-up does without, as gravity without a robot."""
    values = factor.shown(cells[factor.column])
    return np.array([float(f"{value:.6g}") for value in values])


def without_robot(cells: pd.DataFrame) -> pd.DataFrame:
    """Cells with NaN for the noise of a robot where none is used, not 0."""
    used = np.array([get_approach(name).uses_angles for name in cells["approach"]])
    return cells.assign(robot_sigma_mgon=cells["robot_sigma_mgon"].where(used))


def setups(
    cells: pd.DataFrame, tables: Tables, figures: Sequence[Sequence[str]]
) -> tuple[dict[str, Any], Iterator[str]]:
    """Set-ups, a row each.

    Parameters
    ----------
    cells : DataFrame, of `without_robot`
    tables : mapping of name to DataFrame
    figures : for each cell the names of figures that show it

    Returns
    -------
    heads : what the rows refer to: fields, models, schemes, approaches, reasons, figures, groups
    rows : JSON, one text each
    """
    factors = varied(cells)
    codes = {name: Codes() for name in ("model", "scheme", "approach", "reason", "figures")}
    columns: dict[str, list[str]] = {}
    for name in ("model", "scheme", "approach", "reason"):
        columns[name] = [str(codes[name][value]) for value in cells[name]]
    columns["figures"] = [str(codes["figures"][tuple(names)]) for names in figures]
    for name, column in {
        "n": "n_positions",
        "estimable": "estimable",
        "redundancy": "redundancy",
        "replicates": "n_replicates",
        "converged": "n_converged",
    }.items():
        columns[name] = [str(int(value)) for value in cells[column]]
    measured = {factor.name: levels(cells, factor) for factor in factors}
    measured["condition"] = cells["condition"].to_numpy(float)
    measured |= _tilt(cells, tables)
    sds = _sds_of_groups(cells, tables["summary"])
    measured |= {f"sd-{i}": values for i, (_, _, values) in enumerate(sds)}
    for name, values in measured.items():
        columns[name] = [number(value) for value in values]
    heads = {
        "fields": list(columns),
        "models": [{"name": name, "title": model_title(name)} for name in codes["model"]],
        "schemes": [
            {"name": name, "title": get_scheme(name).title, "family": family(name)}
            for name in codes["scheme"]
        ],
        "approaches": list(codes["approach"]),
        "reasons": list(codes["reason"]),
        "figures": [list(names) for names in codes["figures"]],
        "groups": [{"label": label, "unit": unit} for label, unit, _ in sds],
    }
    return heads, (f"[{','.join(row)}]" for row in zip(*columns.values(), strict=True))


def _tilt(cells: pd.DataFrame, tables: Tables) -> dict[str, NDArray[np.float64]]:
    """Tilt error of each cell: rms, central 95 %, and what 95 % stay below, singly and in both."""
    leveling, quantiles = tables["leveling"].set_index("cell"), tables["quantiles"]
    quantiles = quantiles[quantiles["quantity"] == "tilt"]
    found = {}
    for angle in ANGLES:
        for name, column in (("rms", "rms"), ("q95", "rms_q95")):
            found[f"{angle}_{name}"] = cells["cell"].map(leveling[f"{angle}_{column}_mgon"])
        for name, probability in (("low", 0.025), ("high", 0.975)):
            its = quantiles[quantiles["name"] == angle]
            found[f"{angle}_{name}"] = cells["cell"].map(
                _at(its, probability).set_index("cell")["value"]
            )
    found["both_q95"] = cells["cell"].map(leveling["both_rms_q95_mgon"])
    return {name: shown(values.to_numpy(float), "mgon")[0] for name, values in found.items()}


def _at(quantiles: pd.DataFrame, probability: float) -> pd.DataFrame:
    """Quantiles of one probability."""
    return quantiles[np.isclose(quantiles["probability"].astype(float), probability)]


def _sds_of_groups(
    cells: pd.DataFrame, summary: pd.DataFrame
) -> list[tuple[str, str, NDArray[np.float64]]]:
    """Label, unit and mean empirical sd of each group of parameters, in each cell."""
    table = summary.assign(group=summary["parameter"].map(group_of))
    found = []
    for group in in_order(table["group"]):
        its = table[table["group"] == group]
        for unit, rows in its.groupby("unit", sort=False):
            mean = rows.groupby("cell")["sd_empirical"].mean()
            values, shown_unit = shown(cells["cell"].map(mean).to_numpy(float), str(unit))
            found.append((group_label(group), shown_unit, values))
    return found


def parameters(cells: pd.DataFrame, tables: Tables) -> tuple[dict[str, Any], Iterator[str]]:
    """Parameters of each cell.

    Returns
    -------
    heads : what the texts refer to: units; lists of parameters, each with its symbol and the number
        of its unit; and quantities
    texts : JSON, a list for each cell: the number of its list of parameters, 1 or 0 for each that
        can be estimated or not, and a list for each of `QUANTITIES`
    """
    summary = _with_quantiles(tables)
    values = _as_shown(summary)
    lists, units = Codes(), Codes()
    of_rows = [
        (plain(name), units[shown([], unit)[1]])
        for name, unit in zip(summary["parameter"], summary["unit"], strict=True)
    ]
    places = summary.groupby("cell", sort=False).indices
    at = [places.get(cell, ()) for cell in cells["cell"]]
    list_of = [lists[tuple(of_rows[i] for i in its)] for its in at]
    estimable = summary["estimable"].to_numpy(bool)

    def texts() -> Iterator[str]:
        for number_of_list, its in zip(list_of, at, strict=True):
            parts = [",".join(str(int(estimable[i])) for i in its)]
            parts += [",".join(number(column[i]) for i in its) for column in values.values()]
            yield f"[{number_of_list},{','.join(f'[{part}]' for part in parts)}]"

    heads = {"units": list(units), "parameters": list(lists), "quantities": list(QUANTITIES)}
    return heads, texts()


def _with_quantiles(tables: Tables) -> pd.DataFrame:
    """The summary, with the central 95 % of the sds a posteriori."""
    quantiles = tables["quantiles"]
    quantiles = quantiles[quantiles["quantity"] == "sd_posteriori"]
    ends = pd.DataFrame(
        {
            name: _at(quantiles, probability).set_index(["cell", "name"])["value"].astype(float)
            for name, probability in (("posteriori_low", 0.025), ("posteriori_high", 0.975))
        }
    )
    keys = ["cell", "parameter"]
    return tables["summary"].merge(ends.rename_axis(keys), "left", left_on=keys, right_index=True)


def _as_shown(summary: pd.DataFrame) -> dict[str, NDArray[np.float64]]:
    """Values of `QUANTITIES` in the units that people see, shares in %."""
    found = {}
    for key, column in QUANTITIES.items():
        values = summary[column or key].to_numpy(float, copy=True)
        if key.startswith("coverage"):
            values *= 100
        elif not key.startswith("ratio"):
            for unit in summary["unit"].unique():
                its = (summary["unit"] == unit).to_numpy()
                values[its] = shown(values[its], unit)[0]
        found[key] = values
    return found


def correlations(cells: pd.DataFrame, table: pd.DataFrame) -> Iterator[str]:
    """Correlations of each cell in thousandths, JSON, one text each.

    A text is a list, row by row: below the diagonal the mean of those of the adjustment, above it
    the empirical ones. It is empty where there are none.
    """
    places = table.groupby("cell", sort=False).indices
    adjustment, empirical = (table[name].to_numpy() for name in ("adjustment", "empirical"))
    for cell in cells["cell"]:
        at = places.get(cell, np.array([], int))
        u = int(np.sqrt(len(at)))
        lower = np.tril(np.ones((u, u), bool)).ravel()
        both = np.where(lower, adjustment[at], empirical[at]) * 1000
        yield f"[{','.join('null' if np.isnan(v) else str(round(v)) for v in both)}]"


def fitting(texts: Iterable[str], room: int) -> tuple[list[str], int]:
    """Take texts, from the first on, as long as they fit into some room (bytes).

    Returns
    -------
    list of str
    int, the room that is left
    """
    found = []
    for text in texts:
        size = len(text.encode()) + 1
        if size > room:
            break
        found.append(text)
        room -= size
    return found, room
