"""From calibrations to tables: the accuracy of the parameters, and the tilt error that is left."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd

from accelstudy.basics.shares import Z95, sigmas_95, wilson
from accelstudy.basics.units import GON, MGON, recorded_unit, to_recorded
from accelstudy.design import closed_forms
from accelstudy.effects import get_effect
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import Estimates
from accelstudy.study.statistics import ANGLES, TILT, TILTS, CellStatistics

COVERAGE = tuple(f"coverage_95{end}" for end in ("", "_se", "_gain", "_low", "_high"))
VALUE = tuple(f"value{end}" for end in ("", "_se", "_gain", "_plain"))
QUANTILES = ("quantity", "name", "unit", "probability", *VALUE)


def tables_of(results: Iterable[CellStatistics]) -> dict[str, pd.DataFrame]:
    """Each of `TABLES` with the rows of some cells, in order."""
    cells, summary, leveling = [], [], []
    correlations, quantiles = [], []
    for statistics in results:
        cells.append(_cell_row(statistics))
        summary += _summary_rows(statistics)
        correlations.append(_correlation_rows(statistics))
        leveling.append(_leveling_row(statistics))
        quantiles.append(_quantile_rows(statistics))
    table = pd.DataFrame(cells)
    return {
        "cells": table,
        "summary": pd.DataFrame(summary),
        "correlations": pd.concat(correlations, ignore_index=True).infer_objects(),
        "leveling": pd.DataFrame(leveling)[table["estimable"]].reset_index(drop=True),
        "quantiles": pd.concat(quantiles, ignore_index=True).infer_objects(),
    }


def _cell_row(statistics: CellStatistics) -> dict[str, Any]:
    cell = statistics.cell
    theory = cell.estimability
    return {
        **cell.labels,
        "n_positions": cell.positions.n_positions,
        "n_parameters": len(theory.parameter_names),
        "rank": theory.rank,
        "condition": theory.condition,
        "redundancy": theory.redundancy,
        "fourth_moment": theory.fourth_moment,
        "pole_distance_gon": theory.pole_distance / GON,
        "estimable": theory.estimable,
        "not_estimable": ", ".join(theory.not_estimable),
        "reason": theory.reason,
        "n_replicates": statistics.simulated,
        "n_converged": statistics.converged,
        "control": statistics.control,
        **_columns("variance_factor", statistics.variance_factor[0]),
    }


def _columns(
    name: str, estimate: Estimates, short: str | None = None, plain: bool = False
) -> dict[str, float]:
    """Columns of an estimate: its value, its standard error, its gain, and the plain average."""
    short = short or name
    average = {f"{short}_plain": float(estimate.plain)} if plain else {}
    return {
        name: float(estimate.value),
        f"{short}_se": float(estimate.error),
        f"{short}_gain": float(estimate.gain),
        **average,
    }


def _summary_rows(statistics: CellStatistics) -> list[dict[str, Any]]:
    """Statistics of each parameter, in the units shown to people; NaN where there are none."""
    cell, n = statistics.cell, statistics.converged
    theory, exact = cell.estimability, _closed_forms(cell)
    first_error, first_sigma = statistics.first
    freedom = sigmas_95(n - 1) if n > 1 else np.nan
    rows = []
    for i, (name, unit) in enumerate(cell.parameter_units.items()):
        factor = float(to_recorded(1.0, unit))
        bias, sd, priori, posteriori = (
            each[i].scaled(factor)
            for each in (
                statistics.bias,
                statistics.sd,
                statistics.sigma_priori,
                statistics.sigma_posteriori,
            )
        )
        half = freedom * bias.error
        in_si = {
            "sd_linear": theory.sigma[i],
            "sd_closed_form": exact.get(name, np.nan),
            "first_error": first_error[i],
            "first_sd_posteriori": first_sigma[i],
        }
        rows.append(
            {
                **cell.labels,
                "parameter": name,
                "unit": recorded_unit(unit),
                "truth": float(to_recorded(cell.true_values[i], unit)),
                **_columns("bias", bias, plain=True),
                **_columns("sd_empirical", sd, "sd", plain=True),
                **_columns("sd_posteriori_mean", posteriori, "sd_posteriori"),
                **_columns("sd_priori_mean", priori, "sd_priori"),
                "bias_ci95_low": float(bias.value - half),
                "bias_ci95_high": float(bias.value + half),
                **{key: float(to_recorded(value, unit)) for key, value in in_si.items()},
                **_ratio(statistics.sd_ratio[i]),
                **_coverage(statistics, i),
                "n_replicates": statistics.simulated,
                "n_converged": n,
                "estimable": name not in theory.not_estimable,
                "reason": theory.reason,
            }
        )
    return rows


def _ratio(ratio: Estimates) -> dict[str, float]:
    """Mean sigma a posteriori over empirical sd, with its 95 % confidence interval."""
    value, spread = float(ratio.value), float(ratio.error / ratio.value)
    return {
        "sd_ratio": value,
        "sd_ratio_ci95_low": value * math.exp(-Z95 * spread),
        "sd_ratio_ci95_high": value * math.exp(Z95 * spread),
    }


def _coverage(statistics: CellStatistics, i: int) -> dict[str, float]:
    """Share of the nominal 95 % intervals that hold the truth, with its 95 % interval.

    Without a gain the interval is Wilson's. With one, few intervals hold the truth in simulation
    and not in linear theory, or the other way round; one more of these than there were is allowed
    for, as none may have been seen.
    """
    n, inside = statistics.converged, statistics.coverage[i]
    if statistics.redundancy <= 0 or n == 0:
        return dict.fromkeys(COVERAGE, np.nan)
    plain = min(max(float(inside.plain), 0.0), 1.0)  # a mean of ones may round to more than one
    low, high = wilson(round(plain * n), n)
    alone = math.sqrt(plain * (1 - plain) / n)
    error = float(np.hypot(inside.error, 1 / n))
    if inside.gain == 1 or error >= alone:
        return dict(zip(COVERAGE, (plain, alone, 1.0, low, high), strict=True))
    value, half = float(inside.value), Z95 * error
    low, high = max(value - half, 0.0), min(value + half, 1.0)
    return dict(zip(COVERAGE, (value, error, (alone / error) ** 2, low, high), strict=True))


def _closed_forms(cell: Cell) -> dict[str, float]:
    """Closed form of each parameter's sd in SI; empty where none applies."""
    directions = cell.positions.directions
    if (
        set(cell.effects) not in closed_forms.COVERED_EFFECTS
        or cell.noise.sigma_gravity > 0
        or not closed_forms.has_octahedral_moments(directions)
    ):
        return {}
    sigma = closed_forms.gravity_sigma(directions, cell.noise.sigma_force, cell.gravity)
    if cell.conditions.uses_angles:
        if cell.noise.sigma_angle > 0:
            return {}
        ratio = closed_forms.perfect_robot_ratio(directions)
        sigma = {effect: value * ratio[effect] for effect, value in sigma.items()}
    return {
        parameter.name: sigma[effect]
        for effect in cell.effects
        for parameter in get_effect(effect).parameters
        if np.isfinite(sigma[effect])
    }


def _correlation_rows(statistics: CellStatistics) -> pd.DataFrame:
    """Mean correlation from Σ_xx beside the empirical one over the calibrations."""
    cell, empirical = statistics.cell, statistics.correlation
    names = np.array(list(cell.parameter_units) if statistics.simulated else [], object)
    u = len(names)
    known = not np.isnan(empirical.plain).all()

    def whole(below: Any, diagonal: float) -> Any:
        matrix = np.full((u, u), diagonal if known else np.nan)
        if u:
            matrix[np.tril_indices(u, -1)] = below
            matrix.T[np.tril_indices(u, -1)] = below
        return matrix.ravel()

    return pd.DataFrame(
        {
            "cell": np.full(u * u, cell.name, object),
            "parameter_1": np.repeat(names, u),
            "parameter_2": np.tile(names, u),
            "adjustment": statistics.mean_correlation.ravel()[: u * u],
            "empirical": whole(empirical.value, 1.0),
            "empirical_se": whole(empirical.error, 0.0),
            "empirical_gain": whole(empirical.gain, np.nan),
            "empirical_plain": whole(empirical.plain, 1.0),
        }
    )


def _quantile_rows(statistics: CellStatistics) -> pd.DataFrame:
    """Quantiles of the errors and sds of each parameter and of the tilt error, in shown units."""
    cell, labels = statistics.cell, statistics.cell.labels
    units = {**cell.parameter_units, **dict.fromkeys(TILTS, "rad")}
    parts: list[list[Any]] = [[] for _ in QUANTILES]
    size = len(statistics.levels)
    for (quantity, name), quantiles in statistics.quantiles.items():
        shown = quantiles.scaled(float(to_recorded(1.0, units[name])))
        same = (quantity, name, recorded_unit(units[name]))
        columns: list[Any] = [[each] * size for each in same]
        columns += [statistics.levels, shown.value, shown.error, shown.gain, shown.plain]
        for part, column in zip(parts, columns, strict=True):
            part.extend(column)
    table = pd.DataFrame(dict(zip(QUANTILES, parts, strict=True)))
    return pd.DataFrame({**labels, **table, "n_converged": statistics.converged}, table.index)


def _leveling_row(statistics: CellStatistics) -> dict[str, Any]:
    """Rms of the tilt error over all calibrations, and its 95 % quantiles."""
    rms = statistics.tilt_rms.scaled(1 / MGON)
    row: dict[str, Any] = statistics.cell.labels
    for i, angle in enumerate(ANGLES):
        row |= _columns(f"{angle}_rms_mgon", rms[i], f"{angle}_rms", plain=True)
    for name in TILTS:
        bound = statistics.quantile(TILT, name, 0.95).scaled(1 / MGON)
        row |= _columns(f"{name}_rms_q95_mgon", bound, f"{name}_rms_q95", plain=True)
    return {**row, "n_converged": statistics.converged}
