"""From estimates to tables: what each cell determines how well, and what tilt error it leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy import stats

from accelstudy import closed_forms
from accelstudy.design import Design, diagnose
from accelstudy.effects import get_effect
from accelstudy.leveling_error import cap_forces, leveling_error
from accelstudy.study.cells import Cell
from accelstudy.study.simulate import parameter_units
from accelstudy.study.tables import TABLES, read_table, write_table
from accelstudy.units import GON, MGON, recorded_unit, to_recorded

Array = NDArray[np.float64]

Z95 = float(stats.norm.ppf(0.975))


def summarise_batch(
    spec: Mapping[str, Any],
    estimates: str | Path,
    correlations: str | Path,
    leveling: Mapping[str, Any],
    outputs: Mapping[str, str],
    provenance: Mapping[str, Any],
) -> None:
    """Summarise the cells of a batch.

    Parameters
    ----------
    spec : as in `simulate_batch`
    estimates, correlations : paths that `simulate_batch` wrote
    leveling : mapping with max_tilt_gon and attitudes
    outputs : path of each of `TABLES`
    provenance : see `accelstudy.study.tables.origin`
    """
    found: dict[Any, pd.DataFrame] = dict(
        iter(read_table(estimates).groupby("cell", observed=True))
    )
    from_adjustment = read_table(correlations)
    rows: dict[str, list[pd.DataFrame]] = {name: [] for name in TABLES}
    for data in spec["cells"]:
        cell = Cell.from_dict(data)
        design = diagnose(
            cell.positions,
            cell.estimated_model,
            cell.conditions,
            cell.noise,
            cell.estimated_model.vector(cell.truth),
            cell.gravity,
            cell.hold,
        )
        fits = Fits.of(cell, found.get(cell.name))
        rows["cells"].append(_cell_row(cell, design, fits))
        rows["summary"].append(_summary_rows(cell, design, fits))
        row = _leveling_row(cell, fits, leveling)
        rows["leveling"].append(row if design.estimable else row[:0])
        adjusted = from_adjustment[from_adjustment["cell"] == cell.name]
        rows["correlations"].append(_correlation_rows(adjusted, fits))
    for name, path in outputs.items():
        write_table(path, pd.concat(rows[name], ignore_index=True), provenance)


@dataclass(frozen=True)
class Fits:
    """The converged calibrations of a cell as arrays.

    Attributes
    ----------
    names : tuple of str; units : tuple of str, SI; truth : (u,) array
    estimates, sigma_priori : (R, u) arrays
    variance : (R,) array, σ̂0²; NaN without redundancy
    redundancy : int
    simulated : int, number of calibrations, those that did not converge included
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    truth: Array
    estimates: Array
    sigma_priori: Array
    variance: Array
    redundancy: int
    simulated: int

    @classmethod
    def of(cls, cell: Cell, rows: pd.DataFrame | None) -> Fits:
        """Take the rows of one cell of the table of estimates; None if it was not simulated."""
        units = parameter_units(cell)
        u = len(units)
        truth = {**cell.truth, "g": cell.gravity}

        def column(name: str) -> Any:
            return np.empty(0) if rows is None else rows[name].to_numpy()

        converged = column("converged")[::u].astype(bool)
        redundancy = 0 if rows is None else int(rows["redundancy"].iloc[0])
        omega = column("omega")[::u][converged]
        return cls(
            names=tuple(units),
            units=tuple(units.values()),
            truth=np.array([truth[name] for name in units]),
            estimates=column("estimate").reshape(-1, u)[converged],
            sigma_priori=column("sigma_priori").reshape(-1, u)[converged],
            variance=omega / redundancy if redundancy > 0 else np.full(len(omega), np.nan),
            redundancy=redundancy,
            simulated=len(converged),
        )

    @property
    def errors(self) -> Array:
        """Estimation errors, (R, u), SI."""
        return self.estimates - self.truth

    @property
    def sigma_posteriori(self) -> Array:
        """Standard deviations a posteriori, (R, u), SI."""
        return np.sqrt(self.variance)[:, None] * self.sigma_priori


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


def _cell_row(cell: Cell, design: Design, fits: Fits) -> pd.DataFrame:
    return pd.DataFrame(
        {
            **_labels(cell),
            "n_positions": cell.positions.n_positions,
            "n_parameters": len(design.parameter_names),
            "rank": design.rank,
            "condition": design.condition,
            "redundancy": design.redundancy,
            "fourth_moment": design.fourth_moment,
            "pole_distance_gon": design.pole_distance / GON,
            "estimable": design.estimable,
            "not_estimable": ", ".join(design.not_estimable),
            "reason": design.reason,
            "n_replicates": fits.simulated,
            "n_converged": len(fits.estimates),
        },
        index=[0],
    )


def _summary_rows(cell: Cell, design: Design, fits: Fits) -> pd.DataFrame:
    """Statistics of each parameter, in the units shown to people; NaN where there are none."""
    exact = _closed_forms(cell)
    rows = []
    for i, (name, unit) in enumerate(zip(fits.names, fits.units, strict=True)):
        in_si = {
            "truth": fits.truth[i],
            **_bias(fits.errors[:, i]),
            "sd_empirical": _sd(fits.errors[:, i]),
            "sd_posteriori_mean": _mean(fits.sigma_posteriori[:, i]),
            "sd_priori_mean": _mean(fits.sigma_priori[:, i]),
            "sd_linear": design.sigma[i],
            "sd_closed_form": exact.get(name, np.nan),
        }
        rows.append(
            {
                **_labels(cell),
                "parameter": name,
                "unit": recorded_unit(unit),
                **{key: float(to_recorded(value, unit)) for key, value in in_si.items()},
                **_ratio(fits.sigma_posteriori[:, i], fits.errors[:, i]),
                **_coverage(fits, i),
                "n_replicates": fits.simulated,
                "n_converged": len(fits.estimates),
                "estimable": name not in design.not_estimable,
                "reason": design.reason,
            }
        )
    return pd.DataFrame(rows)


def _mean(values: Array) -> float:
    return float(np.mean(values)) if len(values) else np.nan


def _sd(values: Array) -> float:
    return float(np.std(values, ddof=1)) if len(values) > 1 else np.nan


def _bias(errors: Array) -> dict[str, float]:
    """Mean error with its 95 % confidence interval."""
    n = len(errors)
    mean = _mean(errors)
    half = stats.t.ppf(0.975, n - 1) * _sd(errors) / np.sqrt(n) if n > 1 else np.nan
    return {"bias": mean, "bias_ci95_low": mean - half, "bias_ci95_high": mean + half}


def _ratio(sigma: Array, errors: Array) -> dict[str, float]:
    """Mean sigma a posteriori over empirical sd, with its 95 % confidence interval.

    The relative error of an empirical sd of n values is 1/√(2(n − 1)).
    """
    n = len(errors)
    ratio = _mean(sigma) / _sd(errors)
    spread = np.nan
    if n > 1:
        spread = np.sqrt(1 / (2 * (n - 1)) + (_sd(sigma) / _mean(sigma)) ** 2 / n)
    return {
        "sd_ratio": ratio,
        "sd_ratio_ci95_low": ratio * np.exp(-Z95 * spread),
        "sd_ratio_ci95_high": ratio * np.exp(Z95 * spread),
    }


def _coverage(fits: Fits, i: int) -> dict[str, float]:
    """Share of the nominal 95 % intervals that hold the truth, with its 95 % (Wilson) interval.

    The intervals are estimate ± t σ a posteriori, t of Student's distribution with r degrees of
    freedom; without redundancy there are none.
    """
    n = len(fits.estimates)
    if fits.redundancy <= 0 or n == 0:
        return dict.fromkeys(("coverage_95", "coverage_95_low", "coverage_95_high"), np.nan)
    half = stats.t.ppf(0.975, fits.redundancy) * fits.sigma_posteriori[:, i]
    inside = int(np.count_nonzero(np.abs(fits.errors[:, i]) <= half))
    interval = stats.binomtest(inside, n).proportion_ci(method="wilson")
    return {
        "coverage_95": inside / n,
        "coverage_95_low": float(interval.low),
        "coverage_95_high": float(interval.high),
    }


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


def _correlation_rows(from_adjustment: pd.DataFrame, fits: Fits) -> pd.DataFrame:
    """Mean correlation from Σ_xx beside the empirical one over the calibrations."""
    rows = from_adjustment.astype({"cell": str, "parameter_1": str, "parameter_2": str})
    enough = len(fits.errors) > len(fits.names)
    rows["empirical"] = np.corrcoef(fits.errors.T).ravel() if enough else np.nan
    return rows


def _leveling_row(cell: Cell, fits: Fits, settings: Mapping[str, Any]) -> pd.DataFrame:
    rms = q95 = np.full(2, np.nan)
    if len(fits.estimates):
        simulated, estimated = cell.simulated_model, cell.estimated_model
        forces = cap_forces(settings["max_tilt_gon"] * GON, settings["attitudes"], cell.gravity)
        error = leveling_error(
            simulated,
            simulated.vector(cell.truth),
            estimated,
            fits.estimates[:, : estimated.n_parameters],
            forces,
            cell.gravity,
            cell.holds.use(forces, cell.positions.n_positions),
        )
        rms, q95 = error.rms, error.quantile(0.95)
    row = _labels(cell)
    for i, angle in enumerate(("roll", "pitch")):
        row[f"{angle}_rms_mgon"] = rms[i] / MGON
        row[f"{angle}_rms_q95_mgon"] = q95[i] / MGON
    return pd.DataFrame({**row, "n_converged": len(fits.estimates)}, index=[0])
