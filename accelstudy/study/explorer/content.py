"""What an explorer shows of a study, from its tables: set-ups, their parameters, correlations.

A set-up is a cell of the study. Each is a table with numbers in the units that people see; `packed`
makes it a text that the page's script reads again.
"""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.approaches import get_approach
from accelstudy.drawing.style import group_label, group_of, in_order, shown, symbol
from accelstudy.study.figures.factors import NOISES, Factor
from accelstudy.study.figures.registry import Tables

ANGLES = ("roll", "pitch")
QUANTITIES = {
    "truth": "truth",
    "bias": "bias",
    "bias_low": "bias_ci95_low",
    "bias_high": "bias_ci95_high",
    "empirical": "sd_empirical",
    "posteriori": "sd_posteriori_mean",
    "posteriori_low": "posteriori_low",
    "posteriori_high": "posteriori_high",
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


def packed(table: pd.DataFrame) -> str:
    """Write the columns of a table as JSON, gzipped, in base 64; numbers with four digits."""
    columns = {name: column.tolist() for name, column in table.items()}
    for name in table.select_dtypes("float"):
        columns[name] = [None if v != v else float(f"{v:.4g}") for v in columns[name]]
    # Infinite is what is too large for a number of JSON.
    text = json.dumps(columns, ensure_ascii=False).replace("Infinity", "1e999")
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


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
) -> tuple[pd.DataFrame, list[dict[str, str]]]:
    """Set-ups, a row each.

    Parameters
    ----------
    cells : DataFrame, of `without_robot`
    tables : mapping of name to DataFrame
    figures : for each cell the names of figures that show it

    Returns
    -------
    DataFrame : model, scheme and approach by their number, in the order in which they come
    list of dict : label and unit of each group of parameters, whose sds are in `sd-0`, `sd-1`, ...
    """
    some, all_of = cells["n_converged"], cells["n_replicates"]
    failed = np.select([~cells["estimable"], some == 0], ["not estimable", "none converged"], "")
    share = some.astype(str) + " of " + all_of.astype(str) + " converged"
    table = {
        **{key: pd.factorize(cells[key])[0] for key in ("model", "scheme", "approach")},
        "n": cells["n_positions"],
        "failed": failed,
        "state": np.select(
            [failed != "", some == all_of], [failed, "all converged"], share.astype(object)
        ),
        "reason": cells["reason"],
        "figures": [" ".join(names) for names in figures],
        "redundancy": cells["redundancy"],
        "condition": cells["condition"].astype(float),
        "replicates": all_of,
        "converged": some,
        **{factor.name: levels(cells, factor) for factor in varied(cells)},
    }
    tilt = pd.DataFrame(_tilt(cells, tables))
    ends = tilt[[f"{angle}_{name}" for angle in ANGLES for name in ("low", "rms", "high")]]
    sds = _sds_of_groups(cells, tables["summary"])
    table |= {**tilt, "least": ends.min(axis=1), "most": ends.max(axis=1)}
    table |= {f"sd-{i}": values for i, (_, _, values) in enumerate(sds)}
    return pd.DataFrame(table), [{"label": label, "unit": unit} for label, unit, _ in sds]


def _tilt(cells: pd.DataFrame, tables: Tables) -> dict[str, NDArray[np.float64]]:
    """Tilt error of each cell: rms, central 95 %, and what 95 % stay below, singly and in both."""
    leveling, quantiles = tables["leveling"].set_index("cell"), tables["quantiles"]
    quantiles = quantiles[quantiles["quantity"] == "tilt"]
    errors = {}
    for angle in ANGLES:
        for name, column in (("rms", "rms"), ("q95", "rms_q95")):
            errors[f"{angle}_{name}"] = cells["cell"].map(leveling[f"{angle}_{column}_mgon"])
        for name, probability in (("low", 0.025), ("high", 0.975)):
            rows = _at(quantiles[quantiles["name"] == angle], probability)
            errors[f"{angle}_{name}"] = cells["cell"].map(rows.set_index("cell")["value"])
    errors["both_q95"] = cells["cell"].map(leveling["both_rms_q95_mgon"])
    return {name: shown(values.to_numpy(float), "mgon")[0] for name, values in errors.items()}


def _at(quantiles: pd.DataFrame, probability: float) -> pd.DataFrame:
    """Quantiles of one probability."""
    return quantiles[np.isclose(quantiles["probability"].astype(float), probability)]


def _sds_of_groups(
    cells: pd.DataFrame, summary: pd.DataFrame
) -> list[tuple[str, str, NDArray[np.float64]]]:
    """Label, unit and mean empirical sd of each group of parameters, in each cell."""
    table = summary.assign(group=summary["parameter"].map(group_of))
    sds = []
    for group in in_order(table["group"]):
        members = table[table["group"] == group]
        for unit, rows in members.groupby("unit", sort=False):
            mean = rows.groupby("cell")["sd_empirical"].mean()
            values, shown_unit = shown(cells["cell"].map(mean).to_numpy(float), str(unit))
            sds.append((group_label(group), shown_unit, values))
    return sds


def parameters(cells: pd.DataFrame, tables: Tables) -> pd.DataFrame:
    """Parameters of cells, a row each: `i`, the number of its cell, and all of `QUANTITIES`."""
    quantiles = tables["quantiles"]
    quantiles = quantiles[quantiles["quantity"] == "sd_posteriori"]
    keys = ["cell", "parameter"]
    summary = _of(cells, tables["summary"])
    for name, probability in (("posteriori_low", 0.025), ("posteriori_high", 0.975)):
        ends = _at(quantiles, probability).set_index(["cell", "name"])["value"].astype(float)
        summary = summary.join(ends.rename_axis(keys).rename(name), on=keys)
    values = summary[list(QUANTITIES.values())].astype(float)
    values.columns = pd.Index(QUANTITIES)
    values.loc[:, [name for name in QUANTITIES if name.startswith("coverage")]] *= 100
    in_units = [name for name in QUANTITIES if not name.startswith(("ratio", "coverage"))]
    shown_unit = {}
    for unit in summary["unit"].unique():
        rows = summary["unit"] == unit
        values.loc[rows, in_units], shown_unit[unit] = shown(values.loc[rows, in_units], unit)
    return pd.DataFrame(
        {
            "i": summary["i"],
            "parameter": [plain(name) for name in summary["parameter"]],
            "unit": [shown_unit[unit] for unit in summary["unit"]],
            "failed": np.where(summary["estimable"], "", "not estimable"),
            **values,
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
