"""The replicates of a cell: simulated and calibrated, and beside that by linear theory."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.adjustment.linear_theory import LinearTheory
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
same noise; NaN where there is none. Columns that repeat within a replicate hardly
need space."""


class Replicates(NamedTuple):
    """All that passes from the simulation of a cell to its statistics.

    Attributes
    ----------
    simulated : Block, the calibrations
    linear : Block, those of linear theory of the same noise; NaN if there is no linear theory, as
        the session without noise has no calibration
    """

    simulated: Block
    linear: Block

    @classmethod
    def of(
        cls, simulated: Block, theory: LinearTheory | None, estimates: Array, omega: Array
    ) -> Replicates:
        """Put estimates (R, u) and Ω (R,) of linear theory, or NaN, beside calibrations."""
        sigma = np.full(estimates.shape[1], np.nan) if theory is None else theory.sigma
        linear = replace(
            simulated,
            estimates=estimates,
            sigma_priori=np.broadcast_to(sigma, estimates.shape),
            omega=omega,
            converged=np.ones(len(omega), bool),
        )
        return cls(simulated, linear)

    @classmethod
    def plain(cls, simulated: Block) -> Replicates:
        """Calibrations without linear theory."""
        nothing = np.full_like(simulated.estimates, np.nan)
        return cls.of(simulated, None, nothing, nothing[:, 0])


def simulate(cell: Cell, seed: int) -> Replicates:
    """Simulate and calibrate all replicates of an estimable cell.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    """
    calibrate, theory = calibrator(cell), cell.linear_theory
    angles = cell.conditions.uses_angles
    drawn = cell.ideal.draw_blocks(
        cell.noise,
        cell.replicates,
        range(-(-cell.replicates // BLOCK)),
        lambda block: np.random.default_rng(cell.seed(seed, block)),
        BLOCK,
        angles=angles,
    )
    simulated, estimates, omega = [], [], []
    for errors, observed in drawn:
        simulated.append(calibrate(cell.estimated_model, cell.conditions, observed))
        if theory is not None:
            noise = errors.force
            if angles and errors.angle is not None:
                noise = np.concatenate([noise, errors.angle], axis=-1)
            shift, of_block = theory.errors(noise, errors.gravity)
            estimates.append(theory.reference + shift)
            omega.append(of_block)
    together = Block.concatenate(simulated)
    if theory is None:
        return Replicates.plain(together)
    return Replicates.of(together, theory, np.concatenate(estimates), np.concatenate(omega))


def estimates_table(cell: Cell, replicates: Replicates) -> pa.Table:
    """Rows of `ESTIMATES` of a cell."""
    simulated, linear = replicates
    count, u = simulated.estimates.shape

    def coded(names: Collection[str]) -> pa.DictionaryArray:
        different = [*dict.fromkeys(names)]
        codes = np.array([different.index(name) for name in names], np.int32)
        return pa.DictionaryArray.from_arrays(np.tile(codes, count * u // len(codes)), different)

    columns = {
        "cell": coded([cell.name]),
        "replicate": np.repeat(np.arange(count), u),
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
