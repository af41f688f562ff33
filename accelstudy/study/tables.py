"""The tables of a study: cells are simulated, and what came of them is tabled and stored."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.shares import Z95, sigmas_95, wilson
from accelstudy.basics.units import GON, MGON, recorded_unit, to_recorded
from accelstudy.files.tables import read_table, table_writer, write_table
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import UNKNOWN, Estimates
from accelstudy.study.replicates import ESTIMATES, estimates_tables, simulate
from accelstudy.study.statistics import (
    ANGLES,
    TILT,
    TILTS,
    CellStatistics,
    statistics,
)

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa


log = logging.getLogger(__name__)

TABLES = ("cells", "summary", "correlations", "leveling", "quantiles")
"""Tables that each cell contributes to."""


def simulated_tables(
    cells: Sequence[Cell],
    seed: int,
    write: Callable[[pa.Table], None] | None = None,
) -> dict[str, pd.DataFrame]:
    """Simulate cells one after the other; return each of `TABLES`.

    Parameters
    ----------
    cells : sequence of Cell
    seed : int, of the study
    write : function that gets the rows of the estimates, table by table
    """

    def results() -> Iterator[CellStatistics]:
        for number, cell in enumerate(cells, 1):
            replicates = simulate(cell, seed)
            if write is not None:
                for table in estimates_tables(cell, replicates):
                    write(table)
            found = statistics(cell, replicates)
            counts = f"{found.converged} of {found.simulated} replicates converged"
            said = cell.estimability.reason or counts
            log.info("%d/%d %s: %s", number, len(cells), cell.name, said)
            yield found

    return tables_of(results())


def simulate_cells(
    cells: Sequence[Cell],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Simulate cells, and write their estimates and what came of them.

    Cells that are not estimable leave no estimates; the table of cells says why.

    Parameters
    ----------
    cells : sequence of Cell
    outputs : paths of `estimates` and of each of `TABLES`
    provenance : see `accelstudy.files.tables.origin`; its seed is that of the study
    """
    with table_writer(outputs["estimates"], ESTIMATES, provenance) as write:
        tables = simulated_tables(cells, provenance["seed"], write)
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)


def tables_of(results: Iterable[CellStatistics]) -> dict[str, pd.DataFrame]:
    """Each of `TABLES` with the rows of some cells, in order and in the units shown to people."""
    makers = (_cell, _summary, _correlations, _leveling, _quantiles)
    parts = zip(*([make(one) for make in makers] for one in results), strict=True)
    return {name: _joined(part) for name, part in zip(TABLES, parts, strict=True)}


def _joined(parts: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """Join the columns of cells; what is a single value holds in every row of its cell."""
    import pandas as pd

    counts = [next((len(each) for each in part.values() if np.ndim(each)), 1) for part in parts]
    columns = {
        name: [np.broadcast_to(part[name], n) for part, n in zip(parts, counts, strict=True)]
        for name in parts[0]
    }
    return pd.DataFrame({name: np.concatenate(each) for name, each in columns.items()})


def _cell(statistics: CellStatistics) -> dict[str, Any]:
    """What its positions determine, and how many calibrations there are."""
    theory, positions = statistics.cell.estimability, statistics.cell.positions
    return {
        **statistics.cell.labels,
        "n_positions": positions.n_positions,
        "n_parameters": len(theory.parameter_names),
        "rank": theory.rank,
        "condition": theory.condition,
        "redundancy": theory.redundancy,
        "fourth_moment": positions.fourth_moment,
        "pole_distance_gon": positions.pole_distance / GON,
        "estimable": theory.estimable,
        "not_estimable": ", ".join(theory.not_estimable),
        "reason": theory.reason,
        "n_replicates": statistics.simulated,
        "n_converged": statistics.converged,
        "control": statistics.control,
        **_columns("variance_factor", statistics["variance_factor"]),
    }


def _columns(
    name: str, estimates: Estimates, short: str | None = None, plain: bool = False
) -> dict[str, Any]:
    """Columns of estimates: values, standard errors, gains, and the plain averages."""
    short = short or name
    columns = {name: estimates.value, f"{short}_se": estimates.error}
    columns[f"{short}_gain"] = estimates.gain
    return {**columns, f"{short}_plain": estimates.plain} if plain else columns


def _summary(statistics: CellStatistics) -> dict[str, Any]:
    """Statistics of each parameter; NaN where there are none."""
    cell, n, theory = statistics.cell, statistics.converged, statistics.cell.estimability
    units = cell.parameter_units.values()
    factors = np.array([float(to_recorded(1.0, unit)) for unit in units])
    bias, sd, priori, posteriori = (
        statistics[name].scaled(factors)
        for name in ("bias", "sd", "sigma_priori", "sigma_posteriori")
    )
    linear = cell.linear_theory if theory.estimable else None
    half = sigmas_95(n - 1) * bias.error if n > 1 else np.nan
    ratio = statistics["sd_ratio"]
    spread = np.exp(Z95 * ratio.error / ratio.value)
    first_error, first_sigma = statistics.first
    return {
        **cell.labels,
        "parameter": [*cell.parameter_units],
        "unit": [recorded_unit(unit) for unit in units],
        "truth": cell.true_values * factors,
        **_columns("bias", bias, plain=True),
        **_columns("sd_empirical", sd, "sd", plain=True),
        **_columns("sd_posteriori_mean", posteriori, "sd_posteriori"),
        **_columns("sd_priori_mean", priori, "sd_priori"),
        "bias_ci95_low": bias.value - half,
        "bias_ci95_high": bias.value + half,
        "sd_linear": np.nan * factors if linear is None else linear.sigma * factors,
        "first_error": first_error * factors,
        "first_sd_posteriori": first_sigma * factors,
        "sd_ratio": ratio.value,
        "sd_ratio_ci95_low": ratio.value / spread,
        "sd_ratio_ci95_high": ratio.value * spread,
        **coverage_columns(statistics["coverage"], n if theory.redundancy > 0 else 0),
        "n_replicates": statistics.simulated,
        "n_converged": n,
        "estimable": [name not in theory.not_estimable for name in cell.parameter_units],
        "reason": theory.reason,
    }


def coverage_columns(inside: Estimates, n: int) -> dict[str, Any]:
    """Shares of the nominal 95 % intervals that hold the truth, with their 95 % intervals.

    Without a gain the interval is Wilson's. With one, few intervals hold the truth in simulation
    and not in linear theory, or the other way round; one more of these than there were is allowed
    for, as none may have been seen.

    Parameters
    ----------
    inside : Estimates of the shares
    n : int, calibrations that have such intervals
    """
    if not n:
        nothing = dict.fromkeys(("coverage_95_low", "coverage_95_high"), np.nan)
        return {**_columns("coverage_95", UNKNOWN), **nothing}
    # A mean of ones may round to more than one.
    plain, value = (np.clip(share, 0.0, 1.0) for share in (inside.plain, inside.value))
    # By the better share: of few intervals all may hold the truth, and would seem to be exact.
    alone, error = np.sqrt(value * (1 - value) / n), np.hypot(inside.error, 1 / n)
    better = (inside.gain != 1) & (error < alone)
    gain = np.where(better, (alone / error) ** 2, 1.0)
    value = np.where(better, value, plain)
    low, high = np.array([wilson(round(share * n), n) for share in plain]).T
    return {
        **_columns("coverage_95", Estimates(value, np.where(better, error, alone), gain, plain)),
        "coverage_95_low": np.where(better, np.maximum(value - Z95 * error, 0.0), low),
        "coverage_95_high": np.where(better, np.minimum(value + Z95 * error, 1.0), high),
    }


def _correlations(statistics: CellStatistics) -> dict[str, Any]:
    """Mean correlation from Σ_xx beside the empirical one over the calibrations."""
    names = [] if statistics.correlation is None else [*statistics.cell.parameter_units]
    u, empirical = len(names), statistics["correlation"]
    i, j = np.tril_indices(u, -1)
    one = 1.0 if np.isfinite(empirical.plain).any() else np.nan

    def whole(below: Array, diagonal: float) -> Array:
        matrix = np.full((u, u), diagonal)
        matrix[i, j] = matrix[j, i] = below
        return matrix.ravel()

    return {
        "cell": statistics.cell.name,
        "parameter_1": np.repeat(np.array(names, str), u),
        "parameter_2": np.tile(np.array(names, str), u),
        "adjustment": [] if statistics.correlation is None else statistics.correlation.ravel(),
        "empirical": whole(np.clip(empirical.value, -1, 1), one),
        "empirical_se": whole(empirical.error, 0.0 * one),
        "empirical_gain": whole(empirical.gain, np.nan),
        "empirical_plain": whole(np.clip(empirical.plain, -1, 1), one),
    }


def _leveling(statistics: CellStatistics) -> dict[str, Any]:
    """Rms of the tilt error over all calibrations, and its 95 % quantiles."""
    columns = statistics.cell.labels
    rms = statistics["tilt_rms"].scaled(np.ones(len(ANGLES)) / MGON)
    for i, angle in enumerate(ANGLES):
        columns |= _columns(f"{angle}_rms_mgon", rms[i], f"{angle}_rms", plain=True)
    for name in TILTS:
        bound = statistics.quantile(TILT, name, 0.95).scaled(1 / MGON)
        columns |= _columns(f"{name}_rms_q95_mgon", bound, f"{name}_rms_q95", plain=True)
    rows = 0 if statistics.correlation is None else 1
    return {**columns, "n_converged": np.full(rows, statistics.converged)}


def _quantiles(statistics: CellStatistics) -> dict[str, Any]:
    """Quantiles of the errors and sds of each parameter and of the tilt error."""
    units = {**statistics.cell.parameter_units, **dict.fromkeys(TILTS, "rad")}
    each, levels = statistics.quantiles.items(), statistics.levels
    shown = [found.scaled(float(to_recorded(1.0, units[name]))) for (_, name), found in each]
    texts = [(quantity, name, recorded_unit(units[name])) for (quantity, name), _ in each]
    repeated = np.repeat(np.array(texts, str).reshape(-1, 3), len(levels), axis=0)
    numbers = {
        end: np.concatenate([np.zeros(0), *(getattr(one, name) for one in shown)])
        for end, name in {"": "value", "_se": "error", "_gain": "gain", "_plain": "plain"}.items()
    }
    return {
        **statistics.cell.labels,
        **dict(zip(("quantity", "name", "unit"), repeated.T, strict=True)),
        "probability": np.tile(levels, len(each)),
        **{f"value{end}": each for end, each in numbers.items()},
        "n_converged": statistics.converged,
    }


def collect(parts: str | Path | Sequence[str | Path], cells: Sequence[str]) -> pd.DataFrame:
    """Join the parts of a table, with the rows of each cell in the order of the cells."""
    table = read_table(parts)
    at = table["cell"].astype(str).map({name: i for i, name in enumerate(cells)})
    return table.iloc[at.argsort(kind="stable")].reset_index(drop=True)


def read_estimates(
    path: str | Path | Sequence[str | Path], cells: str | Sequence[str] | None = None
) -> pd.DataFrame:
    """Estimates, with what follows from the stored columns.

    Parameters
    ----------
    path : file, folder of files, or several files
    cells : str or several, optional
        Only these cells.

    Returns
    -------
    DataFrame
        The stored columns, and those of `with_derived`, all in SI.

    Raises
    ------
    InputError
        As `accelstudy.files.tables.read_table`; if a cell stands in two files, as an earlier
        configuration may have left them.
    """
    table = read_table(path)
    if cells is not None:
        table = table[table["cell"].isin([cells] if isinstance(cells, str) else cells)]
    if (twice := table.duplicated(["cell", "replicate", "parameter"])).any():
        cell = table.loc[twice, "cell"].iloc[0]
        raise InputError(
            f"{path}: two files hold the cell {cell}; delete what is not of your study"
        )
    return with_derived(table)


def with_derived(estimates: pd.DataFrame) -> pd.DataFrame:
    """Add error, sigma0_squared and sigma_posteriori (NaN without redundancy) to estimates, SI."""
    freedom = estimates["redundancy"].where(estimates["redundancy"] > 0)
    factor = estimates["omega"] / freedom
    return estimates.assign(
        error=estimates["estimate"] - estimates["truth"],
        sigma0_squared=factor,
        sigma_posteriori=factor**0.5 * estimates["sigma_priori"],
    )
