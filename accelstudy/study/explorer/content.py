"""What an explorer shows of a study, from its tables: set-ups, their parameters, correlations.

A set-up is a cell of the study. Each function returns a table with numbers in the units that people
see; `packed` makes them a text that the page's script reads again.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.approaches import get_approach
from accelstudy.drawing.style import group_label, group_of, in_order, model_title, shown, symbol
from accelstudy.schemes import get_scheme
from accelstudy.study.figures.factors import NOISES, Factor, family
from accelstudy.study.figures.panels import by_cell
from accelstudy.study.figures.registry import Tables

ANGLES = ("roll", "pitch")
_ENDS = ("", "_low", "_high")
IN_UNITS = {
    **{"truth": "truth", "bias": "bias"},
    **{"bias_low": "bias_ci95_low", "bias_high": "bias_ci95_high"},
    **{"empirical": "sd_empirical", "posteriori": "sd_posteriori_mean"},
    **{"linear": "sd_linear", "closed": "sd_closed_form"},
}
"""What is shown of each parameter in its unit, and its column in the summary."""
SHARES = {
    **{f"ratio{end}": (f"sd_ratio{'_ci95' if end else ''}{end}", 1) for end in _ENDS},
    **{f"coverage{end}": (f"coverage_95{end}", 100) for end in _ENDS},
}
"""What is shown without a unit or in %, its column in the summary, and the factor."""
_PLAIN = {
    **{"alpha": "α", "delta": "δ", "varepsilon": "ε", "theta": "θ", "phi": "φ"},
    **{"perp": "⊥", "pm": "±"},
}


def plain(parameter: str) -> str:
    """Return the symbol of a parameter as text: ``α_zx``."""
    text = re.sub(r"\\([a-z]+) ?", lambda match: _PLAIN.get(match[1], match[1]), symbol(parameter))
    return re.sub(r"[${}]", "", text)


def packed(content: Mapping[str, Any]) -> str:
    """Write JSON, gzipped, in base 64; tables by their columns, their numbers with four digits."""

    def columns(value: Any) -> Any:
        if not isinstance(value, pd.DataFrame):
            raise TypeError(value)
        lists = {str(name): column.tolist() for name, column in value.items()}
        for name in value.select_dtypes("float"):
            key = str(name)
            lists[key] = [None if v != v else float(f"{v:.4g}") for v in lists[key]]
        return lists

    # Infinite is what is too large for a number of JSON.
    text = json.dumps(content, ensure_ascii=False, default=columns).replace("Infinity", "1e999")
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def noise_levels(cells: pd.DataFrame) -> dict[Factor, pd.Series]:
    """Levels of each noise as shown; NaN where there is none, as of a robot by gravity alone."""
    uses_robot = np.array([get_approach(name).uses_angles for name in cells["approach"]])
    cells = cells.assign(robot_sigma_mgon=cells["robot_sigma_mgon"].where(uses_robot))
    return {
        factor: pd.Series([float(f"{x:.6g}") for x in factor.shown(cells[factor.column])])
        for factor in NOISES
    }


def setups(cells: pd.DataFrame, tables: Tables) -> tuple[pd.DataFrame, dict[str, tuple[str, str]]]:
    """Set-ups, a row each; and what is in its columns `sd-0`, `sd-1`, ...: a title and a unit."""
    some, all_of = cells["n_converged"], cells["n_replicates"]
    failed = np.select([~cells["estimable"], some == 0], ["not estimable", "none converged"], "")
    share = some.astype(str) + " of " + all_of.astype(str) + " converged"
    state = np.where(some == all_of, "all converged", share.astype(object))
    noises = {f.name: x for f, x in noise_levels(cells).items() if len(x.dropna().unique()) > 1}
    table = pd.DataFrame(
        {
            "cell": cells["cell"].astype(str),
            "model": _titles(cells["model"], model_title),
            "scheme": _titles(cells["scheme"], lambda name: get_scheme(name).title),
            "approach": cells["approach"].astype(str),
            "family": [family(name) for name in cells["scheme"]],
            "n": cells["n_positions"],
            "failed": failed,
            "state": np.where(failed != "", failed, state),
            **cells[["reason", "redundancy"]],
            "condition": cells["condition"].astype(float),
            "replicates": all_of,
            "converged": some,
            **noises,
            **_tilt(cells, tables),
        }
    )
    ends = table[[f"{angle}_{name}" for angle in ANGLES for name in ("low", "rms", "high")]]
    table = table.assign(least=ends.min(axis=1), most=ends.max(axis=1))
    titles: dict[str, tuple[str, str]] = {}
    summary = tables["summary"].assign(group=tables["summary"]["parameter"].map(group_of))
    for group in in_order(summary["group"]):
        for unit, rows in summary[summary["group"] == group].groupby("unit", sort=False):
            key, mean = f"sd-{len(titles)}", rows.groupby("cell")["sd_empirical"].mean()
            table[key], label = shown(cells["cell"].map(mean).to_numpy(float), str(unit))
            titles[key] = f"sd of {group_label(group)}", label
    return table, titles


def _titles(names: pd.Series, title: Callable[[str], str]) -> list[str]:
    """Titles by which a reader chooses, with the name where several have the same."""
    titles = {name: title(name) for name in names.unique()}
    count = Counter(titles.values())
    return [titles[n] if count[titles[n]] == 1 else f"{titles[n]} ({n})" for n in names]


def _tilt(cells: pd.DataFrame, tables: Tables) -> dict[str, np.ndarray]:
    """Tilt error of each cell: rms, central 95 %, and what 95 % stay below, singly and in both."""
    quantiles = tables["quantiles"][tables["quantiles"]["quantity"] == "tilt"]
    columns = {"both_q95": by_cell(tables["leveling"], "both_rms_q95_mgon")}
    for angle in ANGLES:
        for name, column in (("rms", "rms"), ("q95", "rms_q95")):
            columns[f"{angle}_{name}"] = by_cell(tables["leveling"], f"{angle}_{column}_mgon")
        for name, probability in (("low", 0.025), ("high", 0.975)):
            rows = _at(quantiles[quantiles["name"] == angle], probability)
            columns[f"{angle}_{name}"] = by_cell(rows, "value")
    return {
        name: shown(cells["cell"].map(column).astype(float), "mgon")[0]
        for name, column in columns.items()
    }


def _at(quantiles: pd.DataFrame, probability: float) -> pd.DataFrame:
    """Quantiles of one probability."""
    return quantiles[np.isclose(quantiles["probability"].astype(float), probability)]


def parameters(cells: pd.DataFrame, tables: Tables) -> pd.DataFrame:
    """Parameters of cells, a row each: `i`, the number of its cell, its unit, and its numbers."""
    summary = _of(cells, tables["summary"])
    quantiles = tables["quantiles"]
    quantiles = quantiles[quantiles["quantity"] == "sd_posteriori"]
    values = summary[list(IN_UNITS.values())].astype(float).set_axis([*IN_UNITS], axis=1)
    for name, probability in (("posteriori_low", 0.025), ("posteriori_high", 0.975)):
        ends = _at(quantiles, probability).set_index(["cell", "name"])["value"].astype(float)
        ends = ends.rename_axis(["cell", "parameter"]).rename(name)
        values[name] = summary.join(ends, on=["cell", "parameter"])[name]
    units = summary["unit"].astype(str)
    for unit in units.unique():
        values.loc[units == unit] = shown(values[units == unit], unit)[0]
    shares = {name: summary[column] * factor for name, (column, factor) in SHARES.items()}
    return pd.DataFrame(
        {
            "i": summary["i"],
            "parameter": [plain(name) for name in summary["parameter"]],
            "unit": [shown([], unit)[1] for unit in units],
            "failed": np.where(summary["estimable"], "", "not estimable"),
            **values,
            **shares,
        }
    )


def correlations(cells: pd.DataFrame, tables: Tables) -> pd.DataFrame:
    """Correlations of the parameters of cells, in thousandths, a row each, row by row of a matrix.

    Below the diagonal are the means of those of the adjustment, above it the empirical ones.
    """
    table = _of(cells, tables["correlations"])
    place = table.groupby("i").cumcount()
    u = np.sqrt(table.groupby("i")["i"].transform("size")).round()
    value = table["adjustment"].where(place // u > place % u, table["empirical"])
    return pd.DataFrame(
        {
            "i": table["i"],
            "first": [plain(name) for name in table["parameter_1"]],
            "second": [plain(name) for name in table["parameter_2"]],
            "value": value.where(place // u != place % u).mul(1000).round(),
        }
    )


def _of(cells: pd.DataFrame, table: pd.DataFrame) -> pd.DataFrame:
    """Rows of a table that belong to these cells, with `i`, the number of the cell."""
    number = pd.Series(range(len(cells)), index=cells["cell"])
    table = table.assign(i=table["cell"].astype(str).map(number))
    return table[table["i"].notna()].astype({"i": int}).reset_index(drop=True)
