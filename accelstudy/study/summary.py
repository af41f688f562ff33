"""From calibrations to tables: the accuracy of the parameters, and the tilt error that is left."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.shares import Z95, sigmas_95, wilson
from accelstudy.basics.units import GON, MGON, recorded_unit, to_recorded
from accelstudy.design import closed_forms
from accelstudy.design.estimability import Estimability, estimability
from accelstudy.effects import get_effect
from accelstudy.files.tables import parquet_writer, write_table
from accelstudy.leveling.error import TiltError
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.distributions import Distribution, cell_distributions
from accelstudy.study.monte_carlo.followed import (
    ANGLES,
    ERROR,
    POSTERIORI,
    PRIORI,
    TILT,
    TILTS,
    cell_tilt_error,
)
from accelstudy.study.monte_carlo.moments import MOMENTS, moments_table
from accelstudy.study.monte_carlo.sketch import RELATIVE_ERROR, SKETCHES, Key, Sketch, sketch_table
from accelstudy.study.monte_carlo.statistics import Statistics, read_statistics
from accelstudy.study.tables import TABLES

Array = NDArray[np.float64]


LOWER = (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.025, 0.05, 0.25)
PROBABILITIES = np.array([*LOWER, 0.5, *(1 - p for p in reversed(LOWER))])
"""Probabilities of the quantiles; the outermost only where there are enough calibrations."""


def summarise_batch(
    spec: Mapping[str, Any],
    parts: Mapping[str, Sequence[str | Path]],
    leveling: Mapping[str, Any],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Summarise the cells of a batch.

    Parameters
    ----------
    spec : mapping with `cells` (plain data of `Cell`)
    parts : files of the jobs of the batch, in order: `moments`, and `estimates` or `sketches`
    leveling : mapping with max_tilt_gon and attitudes
    outputs : path of each of `TABLES`, and of `moments` and `sketches` of whole cells
    provenance : see `accelstudy.files.tables.origin`
    """
    cells = [Cell.from_dict(data) for data in spec["cells"]]
    by_cell = read_statistics(parts["moments"], cells)
    rows: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
    with ExitStack() as files:
        write_moments, write_sketches = (
            files.enter_context(parquet_writer(outputs[name], schema, provenance))
            for name, schema in (("moments", MOMENTS), ("sketches", SKETCHES))
        )
        for cell in cells:
            theory = estimability(
                cell.positions,
                cell.estimated_model,
                cell.conditions,
                cell.noise,
                cell.estimated_model.vector(cell.truth),
                cell.gravity,
                cell.hold,
            )
            statistics, tree = by_cell.get(cell.name, (Statistics.of_none(cell), None))
            tilt: TiltError | None = None
            distributions: Mapping[Key, Distribution] = {}
            if tree is not None and statistics.converged:
                mean = statistics.followed.truth + statistics.mean(ERROR)
                tilt = cell_tilt_error(cell, mean, leveling)
                distributions = cell_distributions(cell, parts, statistics, tilt)
            if tree is not None:
                write_moments(moments_table(cell.name, tree))
                sketches = {
                    key: distribution
                    for key, distribution in distributions.items()
                    if isinstance(distribution, Sketch)
                }
                write_sketches(sketch_table(cell.name, sketches))
            rows["cells"].append(_cell_row(cell, theory, statistics))
            rows["summary"].append(_summary_rows(cell, theory, statistics))
            rows["correlations"].append(_correlation_rows(cell, statistics))
            rows["quantiles"].append(_quantile_rows(cell, statistics, distributions))
            row = _leveling_row(cell, statistics, tilt, distributions)
            rows["leveling"].append(row if theory.estimable else row[:0])
    for name in TABLES:
        write_table(outputs[name], pd.concat(rows[name], ignore_index=True), provenance)


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


def _cell_row(cell: Cell, theory: Estimability, statistics: Statistics) -> pd.DataFrame:
    return pd.DataFrame(
        {
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
            "n_replicates": statistics.moments.simulated,
            "n_converged": statistics.converged,
        },
        index=[0],
    )


def _summary_rows(cell: Cell, theory: Estimability, statistics: Statistics) -> pd.DataFrame:
    """Statistics of each parameter, in the units shown to people; NaN where there are none."""
    exact = _closed_forms(cell)
    followed = statistics.followed
    mean = {name: statistics.mean(name) for name in (ERROR, PRIORI, POSTERIORI)}
    first = {name: statistics.first(name) for name in (ERROR, POSTERIORI)}
    sd = {name: statistics.sd(name) for name in (ERROR, POSTERIORI)}
    n = statistics.converged
    rows = []
    for i, (name, unit) in enumerate(followed.units.items()):
        in_si = {
            "truth": followed.truth[i],
            **_bias(n, mean[ERROR][i], sd[ERROR][i]),
            "sd_empirical": sd[ERROR][i],
            "sd_posteriori_mean": mean[POSTERIORI][i],
            "sd_priori_mean": mean[PRIORI][i],
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
                **{key: float(to_recorded(value, unit)) for key, value in in_si.items()},
                **_ratio(n, mean[POSTERIORI][i], sd[POSTERIORI][i], sd[ERROR][i]),
                **_coverage(statistics, i),
                "n_replicates": statistics.moments.simulated,
                "n_converged": n,
                "estimable": name not in theory.not_estimable,
                "reason": theory.reason,
            }
        )
    return pd.DataFrame(rows)


def _bias(n: int, mean: float, sd: float) -> dict[str, float]:
    """Mean error with its 95 % confidence interval."""
    half = sigmas_95(n - 1) * sd / np.sqrt(n) if n > 1 else np.nan
    return {"bias": mean, "bias_ci95_low": mean - half, "bias_ci95_high": mean + half}


def _ratio(n: int, mean: float, sd: float, sd_of_errors: float) -> dict[str, float]:
    """Mean sigma a posteriori over empirical sd, with its 95 % confidence interval.

    The relative error of an empirical sd of n values is 1/√(2(n − 1)).
    """
    ratio = mean / sd_of_errors
    spread = np.nan
    if n > 1:
        spread = np.sqrt(1 / (2 * (n - 1)) + (sd / mean) ** 2 / n)
    return {
        "sd_ratio": ratio,
        "sd_ratio_ci95_low": ratio * np.exp(-Z95 * spread),
        "sd_ratio_ci95_high": ratio * np.exp(Z95 * spread),
    }


def _coverage(statistics: Statistics, i: int) -> dict[str, float]:
    """Share of the nominal 95 % intervals that hold the truth, with its 95 % (Wilson) interval.

    The intervals are estimate ± t σ a posteriori, t of Student's distribution with r degrees of
    freedom; without redundancy there are none.
    """
    n, moments = statistics.converged, statistics.moments
    if moments.redundancy <= 0 or n == 0:
        return dict.fromkeys(("coverage_95", "coverage_95_low", "coverage_95_high"), np.nan)
    inside = int(moments.inside[i])
    low, high = wilson(inside, n)
    return {"coverage_95": inside / n, "coverage_95_low": low, "coverage_95_high": high}


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
    names = list(statistics.followed.units) if statistics.moments.simulated else []
    mean, empirical = statistics.correlations()
    pairs = len(names) ** 2
    return pd.DataFrame(
        {
            "cell": np.full(pairs, cell.name, object),
            "parameter_1": np.repeat(np.array(names, object), len(names)),
            "parameter_2": np.tile(np.array(names, object), len(names)),
            "adjustment": mean.ravel()[:pairs],
            "empirical": empirical.ravel()[:pairs],
        }
    )


def _quantile_rows(
    cell: Cell, statistics: Statistics, distributions: Mapping[Key, Distribution]
) -> pd.DataFrame:
    """Quantiles of the errors and sds of each parameter and of the tilt error, in shown units."""
    units = {**statistics.followed.units, **dict.fromkeys(TILTS, "rad")}
    n = statistics.converged
    tail = np.minimum(PROBABILITIES, 1 - PROBABILITIES)
    shown = PROBABILITIES[(tail >= 0.0249) | (n * tail >= 0.999)]
    with_unit = {
        key: distribution for key, distribution in distributions.items() if key[1] in units
    }
    values = [
        to_recorded(distribution.quantile(shown), units[name])
        for (_, name), distribution in with_unit.items()
    ]
    errors = [RELATIVE_ERROR if isinstance(each, Sketch) else 0.0 for each in with_unit.values()]

    def each(items: Iterable[Any]) -> NDArray[Any]:
        return np.repeat(np.array([*items]), len(shown))

    rows = {
        "quantity": each(quantity for quantity, _ in with_unit),
        "name": each(name for _, name in with_unit),
        "unit": each(recorded_unit(units[name]) for _, name in with_unit),
        "probability": np.tile(shown, len(with_unit)),
        "value": np.ravel(values),
        "relative_error": each(errors),
    }
    labels = _labels(cell)
    if not with_unit:
        return pd.DataFrame(columns=[*labels, *rows]).assign(**labels, n_converged=n)
    return pd.DataFrame({**labels, **rows, "n_converged": n})


def _leveling_row(
    cell: Cell,
    statistics: Statistics,
    tilt: TiltError | None,
    distributions: Mapping[Key, Distribution],
) -> pd.DataFrame:
    """Rms of the tilt error over all calibrations, and its 95 % quantiles."""
    rms, q95 = np.full(len(ANGLES), np.nan), np.full(len(TILTS), np.nan)
    n = statistics.converged
    if tilt is not None:
        u = len(tilt.reference)
        columns = statistics.followed.columns(ERROR)
        rms = tilt.rms_of_all(statistics.moments.comoment[columns, columns][:u, :u] / n)
    if (TILT, TILTS[0]) in distributions:
        q95 = np.array([float(distributions[TILT, name].quantile(0.95)) for name in TILTS])
    row = _labels(cell)
    for i, angle in enumerate(ANGLES):
        row[f"{angle}_rms_mgon"] = rms[i] / MGON
        row[f"{angle}_rms_q95_mgon"] = q95[i] / MGON
    row["both_rms_q95_mgon"] = q95[-1] / MGON
    return pd.DataFrame({**row, "n_converged": n}, index=[0])
