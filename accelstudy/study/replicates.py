"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Collection, Iterator
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
    linear : Block, those of linear theory of the same noise; NaN if there is no linear theory, as
        the session without noise has no calibration
    """

    first: int
    simulated: Block
    linear: Block

    @classmethod
    def of(cls, first: int, simulated: Block, sigma: Array, linear: Array) -> Replicates:
        """Put beside calibrations the sigmas (u,), and estimates and Ω (R, u + 1), of theory."""
        beside = replace(
            simulated,
            estimates=linear[:, :-1],
            sigma_priori=np.broadcast_to(sigma, simulated.estimates.shape),
            omega=linear[:, -1],
            converged=np.ones(len(linear), bool),
        )
        return cls(first, simulated, beside)

    def without_theory(self) -> Replicates:
        """Return the same calibrations without linear theory."""
        count, u = self.simulated.estimates.shape
        return self.of(
            self.first, self.simulated, np.full(u, np.nan), np.full((count, u + 1), np.nan)
        )


def simulate(cell: Cell, seed: int) -> Iterator[Replicates]:
    """Simulate and calibrate all replicates of an estimable cell, `CHUNK` by `CHUNK`.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    """
    calibrate, theory = calibrator(cell), cell.linear_theory
    sigma = np.full(cell.n_unknowns, np.nan) if theory is None else theory.sigma
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(-(-cell.replicates // BLOCK)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=cell.conditions.uses_angles,
    )
    for first in range(0, cell.replicates, CHUNK):
        observed, linear = [], []
        for errors, block in islice(drawn, CHUNK // BLOCK):
            observed.append(block)
            linear.append(_by_theory(cell, theory, errors))
        together = Observations.concatenate(observed)
        simulated = calibrate(cell.estimated_model, cell.conditions, together)
        yield Replicates.of(first, simulated, sigma, np.concatenate(linear))


def _by_theory(cell: Cell, theory: LinearTheory | None, errors: Errors) -> Array:
    """Estimates and Ω of linear theory, (R, u + 1); NaN without one."""
    if theory is None:
        return np.full((len(errors.force), cell.n_unknowns + 1), np.nan)
    noise = errors.force
    if cell.conditions.uses_angles and errors.angle is not None:
        noise = np.concatenate([noise, errors.angle], axis=-1)
    shift, omega = theory.errors(noise, errors.gravity)
    return np.column_stack([theory.reference + shift, omega])


def estimates_table(cell: Cell, replicates: Replicates) -> pa.Table:
    """Rows of `ESTIMATES` of some replicates of a cell."""
    first, simulated, linear = replicates
    count, u = simulated.estimates.shape

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
        "linear_estimate": linear.estimates.ravel(),
        "sigma_priori": simulated.sigma_priori.ravel(),
        "omega": np.repeat(simulated.omega, u),
        "linear_omega": np.repeat(linear.omega, u),
        "redundancy": np.full(count * u, simulated.redundancy),
        "iterations": np.repeat(simulated.iterations, u),
        "converged": np.repeat(simulated.converged, u),
    }
    return pa.table(columns, schema=ESTIMATES)
