"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.tables import REMEDY
from accelstudy.simulation.sessions import BLOCK
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import calibrator

Array = NDArray[np.float64]

_NAME = pa.dictionary(pa.int32(), pa.string())

ESTIMATES = pa.schema(
    {
        "cell": _NAME,
        "replicate": pa.int64(),
        "parameter": _NAME,
        "unit": _NAME,
        "truth": pa.float64(),
        "estimate": pa.float64(),
        "linear_estimate": pa.float64(),
        "sigma_priori": pa.float64(),
        "omega": pa.float64(),
        "linear_omega": pa.float64(),
        "redundancy": pa.int32(),
        "iterations": pa.int32(),
        "converged": pa.bool_(),
    }
)
"""One row per cell, replicate and parameter, SI. Columns that follow from these are not stored: the
error is estimate − truth, σ̂0² = omega / redundancy, and sigma_posteriori = σ̂0 · sigma_priori
(`read_estimates` adds them). `linear_estimate` and `linear_omega` are those of linear theory of the
same noise; null where there is none. Columns that repeat within a replicate hardly
need space."""


class Replicates(NamedTuple):
    """All that passes from the simulation of a cell to its statistics.

    Attributes
    ----------
    simulated : Block, the calibrations
    linear : Block, those of linear theory of the same noise; None if there is no linear theory, as
        the session without noise has no calibration
    """

    simulated: Block
    linear: Block | None


def simulate(cell: Cell, seed: int) -> Replicates:
    """Simulate and calibrate all replicates of an estimable cell.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    """
    calibrate, angles = calibrator(cell), cell.conditions.uses_angles
    theory = cell.linear_theory
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(cell.n_blocks),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=angles,
    )
    simulated, linear = [], []
    for errors, observed in drawn:
        simulated.append(calibrate(cell.estimated_model, cell.conditions, observed))
        if theory is not None:
            noise = errors.force
            if angles:
                assert errors.angle is not None
                noise = np.concatenate([noise, errors.angle], axis=-1)
            shift, omega = theory.errors(noise, errors.gravity)
            linear.append(_linear_block(theory, theory.reference + shift, omega))
    return Replicates(Block.joined(simulated), Block.joined(linear) if linear else None)


def _linear_block(theory: LinearTheory, estimates: Array, omega: Array) -> Block:
    """Calibrations of linear theory with given estimates (R, u) and Ω (R,)."""
    count, u = estimates.shape
    return Block(
        estimates=estimates,
        sigma_priori=np.broadcast_to(theory.sigma, (count, u)),
        omega=omega,
        redundancy=theory.redundancy,
        iterations=np.ones(count, int),
        converged=np.ones(count, bool),
        correlation_sum=np.full((u, u), np.nan),
    )


def estimates_table(cell: Cell, replicates: Replicates) -> pa.Table:
    """Rows of `ESTIMATES` of a cell."""
    units = cell.parameter_units
    simulated, linear = replicates
    n_replicates, u = simulated.estimates.shape

    def per_replicate(values: Any) -> Any:
        return np.repeat(values, u)

    def per_parameter(values: list[Any]) -> Any:
        return np.tile(values, n_replicates)

    columns = {
        "cell": _coded(np.zeros(n_replicates * u), [cell.name]),
        "replicate": per_replicate(np.arange(n_replicates)),
        "parameter": _coded(per_parameter(list(range(u))), list(units)),
        "unit": _coded(per_parameter(list(range(u))), list(units.values())),
        "truth": per_parameter([*cell.true_values]),
        "estimate": simulated.estimates.ravel(),
        "linear_estimate": None if linear is None else linear.estimates.ravel(),
        "sigma_priori": simulated.sigma_priori.ravel(),
        "omega": per_replicate(simulated.omega),
        "linear_omega": None if linear is None else per_replicate(linear.omega),
        "redundancy": np.full(n_replicates * u, simulated.redundancy),
        "iterations": per_replicate(simulated.iterations),
        "converged": per_replicate(simulated.converged),
    }
    missing = pa.nulls(n_replicates * u, pa.float64())
    whole = {name: missing if each is None else each for name, each in columns.items()}
    return pa.table(whole, schema=ESTIMATES)


def _coded(codes: Any, names: list[str]) -> pa.DictionaryArray:
    return pa.DictionaryArray.from_arrays(pa.array(codes, pa.int32()), pa.array(names))


def read_replicates(paths: Iterable[str | Path], cell: Cell) -> Replicates | None:
    """Read the stored replicates of a cell; None if the files hold none of it.

    Parameters
    ----------
    paths : files of estimates; they may hold other cells too
    cell : Cell

    Returns
    -------
    Replicates, whose `correlation_sum`, which is not stored, is NaN; or None

    Raises
    ------
    InputError
        If a file is missing or damaged.
    """
    columns = [*ESTIMATES.names[5:]]
    tables = []
    for path in paths:
        with whole_parquet(path, REMEDY) as file:
            groups = [i for i in range(file.num_row_groups) if _cell_of(file, i) == cell.name]
            tables += [file.read_row_group(i, columns) for i in groups]
    if not tables:
        return None
    rows, u = pa.concat_tables(tables), len(cell.parameter_units)

    def per_parameter(name: str) -> Any:
        return rows[name].to_numpy().reshape(-1, u)

    def per_replicate(name: str) -> Any:
        return rows[name].to_numpy()[::u]

    simulated = Block(
        estimates=per_parameter("estimate"),
        sigma_priori=per_parameter("sigma_priori"),
        omega=per_replicate("omega"),
        redundancy=int(rows["redundancy"][0].as_py()),
        iterations=per_replicate("iterations"),
        converged=per_replicate("converged"),
        correlation_sum=np.full((u, u), np.nan),
    )
    theory = cell.linear_theory
    if theory is None:
        return Replicates(simulated, None)
    linear = per_parameter("linear_estimate"), per_replicate("linear_omega")
    return Replicates(simulated, _linear_block(theory, *linear))


def _cell_of(file: pq.ParquetFile, number: int) -> str:
    """Cell of a row group; each row group holds one."""
    statistics = file.metadata.row_group(number).column(0).statistics
    if statistics is not None and statistics.has_min_max:
        return str(statistics.min)
    return str(file.read_row_group(number, ["cell"])["cell"][0])  # a name too long for statistics
