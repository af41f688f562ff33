"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import islice, zip_longest
from typing import NamedTuple

import numpy as np
import pyarrow as pa

from accelstudy.adjustment.calibration import Block
from accelstudy.adjustment.linear_theory import LinearTheory
from accelstudy.adjustment.observations import Observations
from accelstudy.basics.arrays import Array
from accelstudy.simulation.sessions import BLOCK, Errors
from accelstudy.study.cell import Cell
from accelstudy.study.compiling import calibrator

CHUNK = 20_000
"""Replicates that are calibrated and stored together; more would only take memory."""
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
    simulated : list of Block, the calibrations, `CHUNK` in each; they follow each other
    linear : list of Block, those of linear theory of the same noise; empty if there is no linear
        theory, as the session without noise has no calibration
    """

    simulated: list[Block]
    linear: list[Block]


def simulate(cell: Cell, seed: int) -> Replicates:
    """Simulate and calibrate all replicates of a cell; none if it is not estimable.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    """
    if not cell.estimability.estimable:
        return Replicates([], [])
    calibrate, theory = calibrator(cell), cell.linear_theory
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(-(-cell.replicates // BLOCK)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=cell.conditions.uses_angles,
    )
    replicates = Replicates([], [])
    while chunk := [*islice(drawn, CHUNK // BLOCK)]:
        together = Observations.concatenate([observed for _, observed in chunk])
        block = calibrate(cell.estimated_model, cell.conditions, together)
        replicates.simulated.append(block)
        if theory is not None:
            each = [_by_theory(theory, cell, errors) for errors, _ in chunk]
            estimates, omega = map(np.concatenate, zip(*each, strict=True))
            by_theory = replace(
                block,
                estimates=estimates,
                sigma_priori=np.broadcast_to(theory.sigma, estimates.shape),
                omega=omega,
                converged=np.ones(len(omega), bool),
            )
            replicates.linear.append(by_theory)
    return replicates


def _by_theory(theory: LinearTheory, cell: Cell, errors: Errors) -> tuple[Array, Array]:
    """Estimates (R, u) and Ω (R,) of calibrations by linear theory of the errors of a block."""
    noise = [errors.force]
    if cell.conditions.uses_angles and errors.angle is not None:
        noise.append(errors.angle)
    shift, omega = theory.errors(np.concatenate(noise, axis=-1), errors.gravity)
    return theory.reference + shift, omega


def estimates_tables(cell: Cell, replicates: Replicates) -> Iterator[pa.Table]:
    """Rows of `ESTIMATES` of a cell, `CHUNK` replicates at a time."""
    first = 0
    for block, linear in zip_longest(*replicates):
        count, u = block.estimates.shape
        nothing = np.full(count, np.nan)

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
            "estimate": block.estimates.ravel(),
            "linear_estimate": linear.estimates.ravel() if linear else np.repeat(nothing, u),
            "sigma_priori": block.sigma_priori.ravel(),
            "omega": np.repeat(block.omega, u),
            "linear_omega": np.repeat(linear.omega if linear else nothing, u),
            "redundancy": np.full(count * u, block.redundancy),
            "iterations": np.repeat(block.iterations, u),
            "converged": np.repeat(block.converged, u),
        }
        yield pa.table(columns, schema=ESTIMATES)
        first += count
