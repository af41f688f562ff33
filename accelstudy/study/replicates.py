"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, NamedTuple

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
"""Replicates that are calibrated and stored together; few enough for the cache."""
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
    """The replicates of a cell: all that statistics and files are made of.

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
    calibrate, theory = calibrator(cell), cell.linear_theory
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(-(-cell.replicates // BLOCK)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=cell.conditions.uses_angles,
    )
    simulated, linear = [], []
    while chunk := [*islice(drawn, CHUNK // BLOCK)]:
        together = Observations.concatenate([observed for _, observed in chunk])
        simulated.append(calibrate(cell.estimated_model, cell.conditions, together))
        if theory is not None:
            linear += [_by_theory(theory, cell, errors) for errors, _ in chunk]
    whole = _joined(simulated)
    if theory is None:
        return Replicates(whole, None)
    estimates, omegas = map(np.concatenate, zip(*linear, strict=True))
    by_theory = replace(
        whole,
        estimates=estimates,
        sigma_priori=np.broadcast_to(theory.sigma, estimates.shape),
        omega=omegas,
        converged=np.ones(len(omegas), bool),
    )
    return Replicates(whole, by_theory)


def _joined(blocks: Sequence[Block]) -> Block:
    """Blocks of replicates that follow each other as one."""
    names = ("estimates", "sigma_priori", "omega", "iterations", "converged")
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(block, name) for block in blocks]) for name in names
    }
    total = np.sum([block.correlation_sum for block in blocks], axis=0)
    return replace(blocks[0], **arrays, correlation_sum=total)


def _by_theory(theory: LinearTheory, cell: Cell, errors: Errors) -> tuple[Array, Array]:
    """Estimates (R, u) and Ω (R,) of calibrations by linear theory of the errors of a block."""
    noise = [errors.force]
    if cell.conditions.uses_angles and errors.angle is not None:
        noise.append(errors.angle)
    shift, omega = theory.errors(np.concatenate(noise, axis=-1), errors.gravity)
    return theory.reference + shift, omega


def estimates_tables(cell: Cell, replicates: Replicates) -> Iterator[pa.Table]:
    """Rows of `ESTIMATES` of a cell, `CHUNK` replicates at a time."""
    simulated, linear = replicates
    beside = linear or replace(
        simulated,
        estimates=np.full_like(simulated.estimates, np.nan),
        omega=np.full_like(simulated.omega, np.nan),
    )
    for first in range(0, cell.replicates, CHUNK):
        part = slice(first, first + CHUNK)
        count, u = simulated.estimates[part].shape

        def coded(names: Collection[str], rows: int = count * u) -> pa.DictionaryArray:
            different = [*dict.fromkeys(names)]
            codes = np.array([different.index(name) for name in names], np.int32)
            return pa.DictionaryArray.from_arrays(np.tile(codes, rows // len(codes)), different)

        columns = {
            "cell": coded([cell.name]),
            "replicate": np.repeat(np.arange(first, first + count), u),
            "parameter": coded(cell.parameter_units.keys()),
            "unit": coded(cell.parameter_units.values()),
            "truth": np.tile(cell.true_values, count),
            "estimate": simulated.estimates[part].ravel(),
            "linear_estimate": beside.estimates[part].ravel(),
            "sigma_priori": simulated.sigma_priori[part].ravel(),
            "omega": np.repeat(simulated.omega[part], u),
            "linear_omega": np.repeat(beside.omega[part], u),
            "redundancy": np.full(count * u, simulated.redundancy),
            "iterations": np.repeat(simulated.iterations[part], u),
            "converged": np.repeat(simulated.converged[part], u),
        }
        yield pa.table(columns, schema=ESTIMATES)
