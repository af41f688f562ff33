"""The Monte Carlo itself: simulate and calibrate the replicates of a cell."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.adjustment.block import Block, joined
from accelstudy.design import diagnose
from accelstudy.simulation import session
from accelstudy.study.cells import Cell
from accelstudy.study.compiling import calibrator
from accelstudy.study.tables import parquet_writer

Array = NDArray[np.float64]

BLOCK = 500
"""Replicates that are drawn and adjusted together, from one seed; small enough for the cache."""
BLOCKS_PER_CHUNK = 20
"""Blocks that are held and written together, as one row group: memory follows it, not the count."""

log = logging.getLogger(__name__)


def n_blocks(cell: Cell) -> int:
    """Number of blocks of a cell; the last one may have fewer replicates."""
    return -(-cell.replicates // BLOCK)


def blocks(cell: Cell, seed: int, first: int, count: int) -> Iterator[Block]:
    """Simulate and calibrate blocks of an estimable cell, one after another.

    Each block is drawn from its own seed, and in full, so that a larger number of replicates
    extends the smaller one, and no block depends on which others are asked for.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    first, count : int, number of the first block, from 0 on, and how many are asked for; there are
        no more than `n_blocks`
    """
    simulated, estimated = cell.simulated_model, cell.estimated_model
    calibrate = calibrator(cell)
    ideal = session(
        simulated,
        simulated.vector(cell.truth),
        cell.positions.directions,
        cell.gravity,
        cell.hold,
    )
    for block in range(first, min(first + count, n_blocks(cell))):
        rng = np.random.default_rng(cell.seed(seed, block))
        drawn = ideal.draw(cell.noise, BLOCK, rng, angles=cell.conditions.uses_angles)
        yield calibrate(estimated, cell.conditions, drawn.first(cell.replicates - block * BLOCK))


_NAME = pa.dictionary(pa.int32(), pa.string())

ESTIMATES = pa.schema(
    {
        "cell": _NAME,
        "replicate": pa.int64(),
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
            failed, correlation = 0, np.zeros(())
            drawn = blocks(cell, spec["seed"], 0, n_blocks(cell))
            for first in range(0, n_blocks(cell), BLOCKS_PER_CHUNK):
                chunk = joined(islice(drawn, BLOCKS_PER_CHUNK))
                write_estimates(_estimates_table(cell, chunk, first * BLOCK))
                failed += int(np.count_nonzero(~chunk.converged))
                correlation = correlation + chunk.correlation_sum
            if failed < cell.replicates:
                correlation /= cell.replicates - failed
            else:
                correlation[:] = np.nan
            write_correlations(_correlations_table(cell, correlation))
            log.info(
                "%d/%d %s: %d replicates, %d not converged",
                number,
                len(cells),
                cell.name,
                cell.replicates,
                failed,
            )


def parameter_units(cell: Cell) -> dict[str, str]:
    """SI unit of each parameter that the cell estimates."""
    units = {p.name: p.unit for p in cell.estimated_model.parameters}
    return {**units, "g": "m/s^2"} if cell.noise.sigma_gravity > 0 else units


def _estimates_table(cell: Cell, chunk: Block, first: int) -> pa.Table:
    """Rows of a chunk whose first replicate has the number `first`."""
    units = parameter_units(cell)
    n_replicates, u = chunk.estimates.shape
    truth = {**cell.truth, "g": cell.gravity}

    def per_replicate(values: Any) -> Any:
        return np.repeat(values, u)

    def per_parameter(values: list[Any]) -> Any:
        return np.tile(values, n_replicates)

    columns = {
        "cell": _coded(np.zeros(n_replicates * u), [cell.name]),
        "replicate": per_replicate(np.arange(first, first + n_replicates)),
        "parameter": _coded(per_parameter(list(range(u))), list(units)),
        "unit": _coded(per_parameter(list(range(u))), list(units.values())),
        "truth": per_parameter([truth.get(name, 0.0) for name in units]),
        "estimate": chunk.estimates.ravel(),
        "sigma_priori": chunk.sigma_priori.ravel(),
        "omega": per_replicate(chunk.omega),
        "redundancy": np.full(n_replicates * u, chunk.redundancy),
        "iterations": per_replicate(chunk.iterations),
        "converged": per_replicate(chunk.converged),
    }
    return pa.table(columns, schema=ESTIMATES)


def _correlations_table(cell: Cell, correlation: Array) -> pa.Table:
    names = list(parameter_units(cell))
    u = len(names)
    columns = {
        "cell": _coded(np.zeros(u * u), [cell.name]),
        "parameter_1": _coded(np.repeat(np.arange(u), u), names),
        "parameter_2": _coded(np.tile(np.arange(u), u), names),
        "adjustment": correlation.ravel(),
    }
    return pa.table(columns, schema=CORRELATIONS)


def _coded(codes: Any, names: list[str]) -> pa.DictionaryArray:
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(names))
