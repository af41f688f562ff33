"""The Monte Carlo itself: simulate and calibrate the replicates of a cell."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.adjustment import Adjustment, calibrate
from accelstudy.design import diagnose
from accelstudy.simulation import session
from accelstudy.study.cells import Cell
from accelstudy.study.tables import parquet_writer

Array = NDArray[np.float64]

BLOCK = 500
"""Replicates that are drawn and adjusted together, from one seed; small enough for the cache."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CellResult:
    """Calibrations of one cell, R replicates; NaN where one did not converge.

    Attributes
    ----------
    parameter_names : tuple of str (gravity is the last one if it is observed)
    estimates, sigma_priori : (R, u) arrays, SI
    omega : (R,) array
    redundancy : int
    iterations : (R,) int array
    converged : (R,) bool array
    correlation : (u, u) array, of Σ_xx, mean over the converged replicates
    """

    parameter_names: tuple[str, ...]
    estimates: Array
    sigma_priori: Array
    omega: Array
    redundancy: int
    iterations: NDArray[np.int_]
    converged: NDArray[np.bool_]
    correlation: Array


def simulate_cell(cell: Cell, seed: int) -> CellResult:
    """Simulate and calibrate all replicates of an estimable cell.

    Replicates are drawn in blocks, each from its own seed and drawn in full, so that a larger
    number of replicates extends the smaller one.
    """
    simulated, estimated, approach = cell.simulated_model, cell.estimated_model, cell.conditions
    ideal = session(
        simulated,
        simulated.vector(cell.truth),
        cell.positions.directions,
        cell.gravity,
        cell.hold,
    )
    results = []
    for block, first in enumerate(range(0, cell.replicates, BLOCK)):
        rng = np.random.default_rng(cell.seed(seed, block))
        drawn = ideal.draw(cell.noise, BLOCK, rng)
        results.append(calibrate(estimated, approach, drawn.first(cell.replicates - first)))

    def joined(name: str) -> Any:
        return np.concatenate([getattr(result, name) for result in results])

    names = estimated.parameter_names
    return CellResult(
        parameter_names=(*names, "g") if cell.noise.sigma_gravity > 0 else names,
        estimates=joined("parameters"),
        sigma_priori=joined("sigma_priori"),
        omega=joined("omega"),
        redundancy=results[0].redundancy,
        iterations=joined("iterations"),
        converged=joined("converged"),
        correlation=_mean_correlation(results),
    )


def _mean_correlation(results: Iterable[Adjustment]) -> Array:
    total, count = 0.0, 0
    for result in results:
        q = result.cofactors[result.converged]
        sigma = np.sqrt(np.diagonal(q, axis1=1, axis2=2))
        total = total + (q / (sigma[:, :, None] * sigma[:, None, :])).sum(axis=0)
        count += len(q)
    return np.asarray(total) / count if count else np.full_like(result.cofactors[0], np.nan)


_NAME = pa.dictionary(pa.int32(), pa.string())

ESTIMATES = pa.schema(
    {
        "cell": _NAME,
        "replicate": pa.int32(),
        "parameter": _NAME,
        "unit": _NAME,
        "truth": pa.float64(),
        "estimate": pa.float64(),
        "sigma_priori": pa.float64(),
        "omega": pa.float64(),
        "redundancy": pa.int32(),
        "iterations": pa.int32(),
        "converged": pa.bool_(),
    }
)
"""One row per cell, replicate and parameter, SI. What follows in one step is not stored: the error
is estimate − truth, σ̂0² = omega / redundancy, and sigma_posteriori = σ̂0 · sigma_priori
(`read_estimates` adds them). Columns that repeat within a replicate cost next to nothing."""

CORRELATIONS = pa.schema(
    {"cell": _NAME, "parameter_1": _NAME, "parameter_2": _NAME, "adjustment": pa.float64()}
)
"""Mean over the replicates of the correlations from Σ_xx."""


def simulate_batch(
    spec: Mapping[str, Any],
    estimates: str | Path,
    correlations: str | Path,
    provenance: Mapping[str, Any],
) -> None:
    """Simulate the cells of a batch and write two Parquet files, cell by cell.

    Cells that are not estimable leave no rows; the table of cells says why.

    Parameters
    ----------
    spec : mapping with `seed` and `cells` (plain data of `Cell`)
    estimates, correlations : paths of the files to write
    provenance : see `accelstudy.study.tables.origin`
    """
    cells = [Cell.from_dict(data) for data in spec["cells"]]
    with (
        parquet_writer(
            estimates, ESTIMATES, provenance, measured=("estimate", "sigma_priori")
        ) as write_estimates,
        parquet_writer(correlations, CORRELATIONS, provenance) as write_correlations,
    ):
        for number, cell in enumerate(cells, 1):
            design = diagnose(
                cell.positions,
                cell.estimated_model,
                cell.conditions,
                cell.noise,
                gravity=cell.gravity,
                hold=cell.hold,
            )
            if not design.estimable:
                log.info("%d/%d %s: %s", number, len(cells), cell.name, design.reason)
                continue
            result = simulate_cell(cell, spec["seed"])
            failed = int(np.count_nonzero(~result.converged))
            log.info(
                "%d/%d %s: %d replicates, %d not converged",
                number,
                len(cells),
                cell.name,
                cell.replicates,
                failed,
            )
            write_estimates(_estimates_table(cell, result))
            write_correlations(_correlations_table(cell, result))


def parameter_units(cell: Cell) -> dict[str, str]:
    """SI unit of each parameter that the cell estimates."""
    units = {p.name: p.unit for p in cell.estimated_model.parameters}
    return {**units, "g": "m/s^2"} if cell.noise.sigma_gravity > 0 else units


def _estimates_table(cell: Cell, result: CellResult) -> pa.Table:
    names = result.parameter_names
    n_replicates, u = result.estimates.shape
    units = parameter_units(cell)
    truth = {**cell.truth, "g": cell.gravity}

    def per_replicate(values: Any) -> Any:
        return np.repeat(values, u)

    def per_parameter(values: list[Any]) -> Any:
        return np.tile(values, n_replicates)

    columns = {
        "cell": _coded(np.zeros(n_replicates * u), [cell.name]),
        "replicate": per_replicate(np.arange(n_replicates)),
        "parameter": _coded(per_parameter(list(range(u))), list(names)),
        "unit": _coded(per_parameter(list(range(u))), [units[name] for name in names]),
        "truth": per_parameter([truth.get(name, 0.0) for name in names]),
        "estimate": result.estimates.ravel(),
        "sigma_priori": result.sigma_priori.ravel(),
        "omega": per_replicate(result.omega),
        "redundancy": np.full(n_replicates * u, result.redundancy),
        "iterations": per_replicate(result.iterations),
        "converged": per_replicate(result.converged),
    }
    return pa.table(columns, schema=ESTIMATES)


def _correlations_table(cell: Cell, result: CellResult) -> pa.Table:
    names = list(result.parameter_names)
    u = len(names)
    columns = {
        "cell": _coded(np.zeros(u * u), [cell.name]),
        "parameter_1": _coded(np.repeat(np.arange(u), u), names),
        "parameter_2": _coded(np.tile(np.arange(u), u), names),
        "adjustment": result.correlation.ravel(),
    }
    return pa.table(columns, schema=CORRELATIONS)


def _coded(codes: Any, names: list[str]) -> pa.DictionaryArray:
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(names))
