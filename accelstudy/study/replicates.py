"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from itertools import islice
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.adjustment.observations import Observations
from accelstudy.simulation.sessions import BLOCK, Errors
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import calibrator

Array = NDArray[np.float64]

CHUNK = 10_000
"""Replicates that are simulated, stored and summed up together; few enough for the cache."""
_NAME = pa.dictionary(pa.int32(), pa.string())
ESTIMATES = pa.schema(
    [
        pa.field(name, kind, nullable=False)
        for name, kind in {
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
        }.items()
    ]
)
"""One row per cell, replicate and parameter, SI. Columns that follow from these are not stored: the
error is estimate − truth, σ̂0² = omega / redundancy, and sigma_posteriori = σ̂0 · sigma_priori
(`read_estimates` adds them). `linear_estimate` and `linear_omega` are those of linear theory of the
same noise; NaN where there is none. Columns that repeat within a replicate hardly need space."""


class Replicates(NamedTuple):
    """Replicates of a cell that follow each other: all that statistics and files are made of.

    Attributes
    ----------
    first : int, number of the first one
    simulated : Block, the calibrations
    linear : Block, those of linear theory of the same noise; None if there is no linear theory, as
        the session without noise has no calibration
    """

    first: int
    simulated: Block
    linear: Block | None


def simulate(cell: Cell, seed: int) -> Iterator[Replicates]:
    """Simulate and calibrate all replicates of an estimable cell, `CHUNK` by `CHUNK`.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    """
    calibrate, theory = calibrator(cell), cell.linear_theory
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(-(-cell.replicates // BLOCK)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=cell.conditions.uses_angles,
    )
    for first in range(0, cell.replicates, CHUNK):
        errors, observed = zip(*islice(drawn, CHUNK // BLOCK), strict=True)
        together = Observations.concatenate(observed)
        simulated = calibrate(cell.estimated_model, cell.conditions, together)
        linear = None if theory is None else _by_theory(theory, cell, errors, simulated)
        yield Replicates(first, simulated, linear)


def _by_theory(
    theory: LinearTheory, cell: Cell, errors: Iterable[Errors], simulated: Block
) -> Block:
    """Calibrations by linear theory of the errors of blocks."""
    estimates, omegas = [], []
    for block in errors:
        noise = [block.force]
        if cell.conditions.uses_angles and block.angle is not None:
            noise.append(block.angle)
        shift, omega = theory.errors(np.concatenate(noise, axis=-1), block.gravity)
        estimates.append(theory.reference + shift)
        omegas.append(omega)
    return replace(
        simulated,
        estimates=np.concatenate(estimates),
        sigma_priori=np.broadcast_to(theory.sigma, simulated.estimates.shape),
        omega=np.concatenate(omegas),
        converged=np.ones(len(simulated.omega), bool),
    )


def estimates_table(cell: Cell, replicates: Replicates) -> pa.Table:
    """Rows of `ESTIMATES` of some replicates of a cell."""
    first, simulated, linear = replicates
    count, u = simulated.estimates.shape
    estimates, omega = (
        (np.full((count, u), np.nan), np.full(count, np.nan))
        if linear is None
        else (linear.estimates, linear.omega)
    )

    def coded(names: Collection[str]) -> pa.DictionaryArray:
        different = [*dict.fromkeys(names)]
        codes = np.array([different.index(name) for name in names], np.int32)
        return pa.DictionaryArray.from_arrays(np.tile(codes, count * u // len(codes)), different)

    columns = {
        "cell": coded([cell.name]),
        "replicate": np.repeat(np.arange(first, first + count), u),
        "parameter": coded(cell.parameter_units.keys()),
        "unit": coded(cell.parameter_units.values()),
        "truth": np.tile(cell.true_values, count),
        "estimate": simulated.estimates.ravel(),
        "linear_estimate": estimates.ravel(),
        "sigma_priori": simulated.sigma_priori.ravel(),
        "omega": np.repeat(simulated.omega, u),
        "linear_omega": np.repeat(omega, u),
        "redundancy": np.full(count * u, simulated.redundancy),
        "iterations": np.repeat(simulated.iterations, u),
        "converged": np.repeat(simulated.converged, u),
    }
    return pa.table(columns, schema=ESTIMATES)
