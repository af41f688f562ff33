"""From calibrations to tables: the accuracy of the parameters, and the tilt error that is left."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from accelstudy.basics.shares import Z95, sigmas_95, wilson
from accelstudy.basics.units import GON, MGON, recorded_unit, to_recorded
from accelstudy.design import closed_forms
from accelstudy.effects import get_effect
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.distributions import PROBABILITIES, Controlled
from accelstudy.study.monte_carlo.followed import (
    ANGLES,
    ERROR,
    POSTERIORI,
    PRIORI,
    TILT,
    TILTS,
    Key,
)
from accelstudy.study.monte_carlo.statistics import Estimates, Statistics

COVERAGE = tuple(f"coverage_95{end}" for end in ("", "_se", "_gain", "_low", "_high"))
VALUE = tuple(f"value{end}" for end in ("", "_se", "_gain", "_plain"))
QUANTILES = ("quantity", "name", "unit", "probability", *VALUE)


class Result(NamedTuple):
    """What a cell came to: its calibrations and their distributions, empty if none converged."""

    cell: Cell
    statistics: Statistics
    distributions: Mapping[Key, Controlled]


def tables_of(results: Iterable[Result]) -> dict[str, pd.DataFrame]:
    """Each of `TABLES` with the rows of some cells, in order."""
    cells, summary, leveling = [], [], []
    correlations, quantiles = [], []
    for cell, statistics, distributions in results:
        cells.append(_cell_row(cell, statistics))
        summary += _summary_rows(cell, statistics)
        correlations.append(_correlation_rows(cell, statistics))
        leveling.append(_leveling_row(cell, statistics, distributions))
        quantiles.append(_quantile_rows(cell, statistics, distributions))
    table = pd.DataFrame(cells)
    return {
        "cells": table,
        "summary": pd.DataFrame(summary),
        "correlations": pd.concat(correlations, ignore_index=True),
        "leveling": pd.DataFrame(leveling)[table["estimable"]].reset_index(drop=True),
        "quantiles": pd.concat(quantiles, ignore_index=True),
    }


def _labels(cell: Cell) -> dict[str, Any]:
    """Columns by which a cell is found in every table."""
    return {
        "cell": cell.name,
        "model": cell.model,
        "scheme": cell.scheme,
        "approach": cell.approach,
        "sensor_sigma_mps2": cell.noise.sigma_force,
        "robot_sigma_mgon": cell.noise.sigma_angle / MGON,
        "gravity_sigma_mps2": cell.noise.sigma_gravity,
        "gravity_error_mps2": cell.noise.gravity_error,
    }


def _cell_row(cell: Cell, statistics: Statistics) -> dict[str, Any]:
    theory = cell.estimability
    return {
        **_labels(cell),
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
        **_columns("variance_factor", statistics.factor[0]),
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


def _summary_rows(cell: Cell, statistics: Statistics) -> list[dict[str, Any]]:
    """Statistics of each parameter, in the units shown to people; NaN where there are none."""
    theory, exact, followed = cell.estimability, _closed_forms(cell), statistics.followed
    bias, sd, priori = statistics.bias, statistics.sd, statistics.mean(PRIORI)
    posteriori = statistics.mean(POSTERIORI)
    first = {name: statistics.first(name) for name in (ERROR, POSTERIORI)}
    n = statistics.converged
    freedom = sigmas_95(n - 1) if n > 1 else np.nan
    rows = []
    for i, (name, unit) in enumerate(followed.units.items()):
        factor = float(to_recorded(1.0, unit))

        def shown(estimates: Estimates, i: int = i, factor: float = factor) -> Estimates:
            return estimates[i].scaled(factor)

        half = freedom * bias.error[i]
        in_si = {
            "bias_ci95_low": bias.value[i] - half,
            "bias_ci95_high": bias.value[i] + half,
            "sd_linear": theory.sigma[i],
            "sd_closed_form": exact.get(name, np.nan),
            "first_error": first[ERROR][i],
            "first_sd_posteriori": first[POSTERIORI][i],
        }
        rows.append(
            {
                **_labels(cell),
                "parameter": name,
                "unit": recorded_unit(unit),
                "truth": float(to_recorded(followed.truth[i], unit)),
                **_columns("bias", shown(bias), plain=True),
                **_columns("sd_empirical", shown(sd), "sd", plain=True),
                **_columns("sd_posteriori_mean", shown(posteriori), "sd_posteriori"),
                **_columns("sd_priori_mean", shown(priori), "sd_priori"),
                **{key: float(to_recorded(value, unit)) for key, value in in_si.items()},
                **_ratio(posteriori[i], sd[i]),
                **_coverage(statistics, i),
                "n_replicates": statistics.simulated,
                "n_converged": n,
                "estimable": name not in theory.not_estimable,
                "reason": theory.reason,
            }
        )
    return rows


def _ratio(posteriori: Estimates, sd: Estimates) -> dict[str, float]:
    """Mean sigma a posteriori over empirical sd, with its 95 % confidence interval."""
    ratio = float(posteriori.value / sd.value)
    spread = float(np.hypot(posteriori.error / posteriori.value, sd.error / sd.value))
    return {
        "sd_ratio": ratio,
        "sd_ratio_ci95_low": ratio * math.exp(-Z95 * spread),
        "sd_ratio_ci95_high": ratio * math.exp(Z95 * spread),
    }


def _coverage(statistics: Statistics, i: int) -> dict[str, float]:
    """Share of the nominal 95 % intervals that hold the truth, with its 95 % interval.

    Without a gain the interval is Wilson's. With one, few intervals hold the truth in simulation
    and not in linear theory, or the other way round; one more of these than there were is allowed
    for, as none may have been seen.
    """
    n, inside = statistics.converged, statistics.inside[i]
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


def _correlation_rows(cell: Cell, statistics: Statistics) -> pd.DataFrame:
    """Mean correlation from Σ_xx beside the empirical one over the calibrations."""
    names = list(statistics.followed.units) if statistics.simulated else []
    pairs = len(names) ** 2
    empirical = statistics.correlation
    return pd.DataFrame(
        {
            "cell": np.full(pairs, cell.name, object),
            "parameter_1": np.repeat(np.array(names, object), len(names)),
            "parameter_2": np.tile(np.array(names, object), len(names)),
            "adjustment": statistics.mean_correlation.ravel()[:pairs],
            "empirical": empirical.value.ravel()[:pairs],
            "empirical_se": empirical.error.ravel()[:pairs],
            "empirical_gain": empirical.gain.ravel()[:pairs],
            "empirical_plain": empirical.plain.ravel()[:pairs],
        }
    )


def _quantile_rows(
    cell: Cell, statistics: Statistics, distributions: Mapping[Key, Controlled]
) -> pd.DataFrame:
    """Quantiles of the errors and sds of each parameter and of the tilt error, in shown units."""
    units = {**statistics.followed.units, **dict.fromkeys(TILTS, "rad")}
    n = statistics.converged
    tail = np.minimum(PROBABILITIES, 1 - PROBABILITIES)
    chosen = np.flatnonzero((tail >= 0.0249) | (n * tail >= 0.999))
    names, estimates = [], []
    for (quantity, name), distribution in distributions.items():
        if name in units:  # of effects there are claims, but no quantiles
            factor = float(to_recorded(1.0, units[name]))
            at = distribution.quantile(chosen).scaled(factor)
            names.append((quantity, name, recorded_unit(units[name])))
            estimates.append([at.value, at.error, at.gain, at.plain])
    if not names:
        return pd.DataFrame(columns=[*_labels(cell), *QUANTILES]).assign(
            **_labels(cell), n_converged=n
        )
    size = len(chosen)
    each = np.repeat(np.array(names, dtype=object), size, axis=0).T
    columns = [
        *each,
        np.tile(PROBABILITIES[chosen], len(names)),
        *np.moveaxis(np.array(estimates), 1, 0).reshape(4, -1),
    ]
    quantiles = dict(zip(QUANTILES, columns, strict=True))
    return pd.DataFrame({**_labels(cell), **quantiles, "n_converged": n})


def _leveling_row(
    cell: Cell, statistics: Statistics, distributions: Mapping[Key, Controlled]
) -> dict[str, Any]:
    """Rms of the tilt error over all calibrations, and its 95 % quantiles."""
    rms = statistics.tilt_rms.scaled(1 / MGON)
    row: dict[str, Any] = _labels(cell)
    nothing = Estimates(*np.full(4, np.nan))
    bounds = {
        name: distributions[TILT, name].at(0.95).scaled(1 / MGON)
        if (TILT, name) in distributions
        else nothing
        for name in TILTS
    }
    for i, angle in enumerate(ANGLES):
        row |= _columns(f"{angle}_rms_mgon", rms[i], f"{angle}_rms", plain=True)
    for name in TILTS:
        row |= _columns(f"{name}_rms_q95_mgon", bounds[name], f"{name}_rms_q95", plain=True)
    return {**row, "n_converged": statistics.converged}
