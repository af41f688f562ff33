"""The statistics of the calibrations of a cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.basics.shares import sigmas_95
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import (
    MIN_REPLICATES,
    UNKNOWN,
    Estimates,
    Statistic,
    controlled,
    controlled_quantiles,
    correlation,
    mean,
    ratio,
    root_mean,
    sd,
    usual_levels,
)
from accelstudy.study.known import KnownValues
from accelstudy.study.replicates import Replicates, simulate

Array = NDArray[np.float64]
Key = tuple[str, str]
"""Quantity, and the name of what it is of."""

STATISTICS: dict[str, tuple[Statistic, str]] = {
    "bias": (mean, "error"),
    "sd": (sd, "error"),
    "sigma_priori": (mean, "sigma_priori"),
    "sigma_posteriori": (mean, "sigma_posteriori"),
    "sd_ratio": (ratio, "sigma_and_error"),
    "coverage": (mean, "inside"),
    "correlation": (correlation, "error"),
    "variance_factor": (mean, "variance_factor"),
    "tilt_rms": (root_mean, "tilt_squared"),
}
"""Each statistic of a cell, and the rows of `_numbers` that it is of: bias and standard
deviation of the errors, the mean standard deviations that are stated, `sd_ratio` of those a
posteriori and the sd, share of the nominal 95 % intervals that hold the truth, correlations below
the diagonal, mean of σ̂0², and the rms of roll and pitch over attitudes and calibrations."""

TILT = "tilt"
QUANTITIES = {"error": "error", "sd_posteriori": "sigma_posteriori", TILT: "tilt"}
"""Quantities that have quantiles, of each parameter, and of each of `TILTS` the rms over attitudes;
and the rows of `_numbers` that they are of."""
ANGLES = ("roll", "pitch")
TILTS = (*ANGLES, "both")
"""Names of the tilt errors that have quantiles: of each angle by itself, and of the larger of the
two, so that both angles stay below its quantile."""


@dataclass(frozen=True)
class CellStatistics:
    """Statistics of the calibrations of a cell, SI.

    Attributes
    ----------
    cell : Cell
    simulated, converged : int, number of calibrations that were simulated, and that converged
    control : str, which control variate the estimates have: `linear` or `none`
    correlation : (u, u) array, mean correlations of Σ_xx; None of a cell that is not estimable
    estimates : dict of `STATISTICS` to Estimates; empty if nothing converged
    first : errors and sigmas a posteriori of the first calibration that converged, (u,) each
    levels : (k,) array, probabilities of the quantiles
    quantiles : dict of quantity and name to Estimates, (k,); empty if nothing converged
    """

    cell: Cell
    simulated: int = 0
    converged: int = 0
    control: str = "none"
    correlation: Array | None = None
    estimates: Mapping[str, Estimates] = field(default_factory=dict)
    first: tuple[Any, Any] = (np.nan, np.nan)
    levels: Array = field(default_factory=lambda: np.zeros(0))
    quantiles: Mapping[Key, Estimates] = field(default_factory=dict)

    def __getitem__(self, statistic: str) -> Estimates:
        return self.estimates.get(statistic, UNKNOWN)

    def quantile(self, quantity: str, name: str, level: float) -> Estimates:
        """One quantile; NaN where there is none."""
        quantiles = self.quantiles.get((quantity, name))
        return UNKNOWN if quantiles is None else quantiles[np.isclose(self.levels, level)][0]


def statistics(
    cell: Cell, replicates: Replicates, levels: Sequence[float] | Array | None = None
) -> CellStatistics:
    """Take the statistics of the replicates of a cell.

    Parameters
    ----------
    cell : Cell, estimable
    replicates : Replicates
    levels : probabilities of the quantiles; by default those that so many replicates can have
    """
    converged = np.concatenate([block.converged for block in replicates.simulated])
    known = KnownValues(cell) if replicates.linear else None
    control = "linear" if known is not None and len(converged) >= MIN_REPLICATES else "none"
    count = int(converged.sum())
    total = np.sum([block.correlation_sum for block in replicates.simulated], axis=0)
    correlation = total / (count or np.nan)
    counts = len(converged), count, control, correlation
    if not count:
        return CellStatistics(cell, *counts)
    own = _numbers(cell, replicates.simulated, count)
    theory = _numbers(cell, replicates.linear, len(converged))
    expected = {} if known is None else known.statistics
    estimates = {
        name: controlled(
            statistic, own[number], theory.get(number), expected.get(name, np.nan), converged
        )
        for name, (statistic, number) in STATISTICS.items()
        if name != "correlation" or count > cell.n_unknowns
    }
    at = usual_levels(count) if levels is None else np.asarray(levels, dtype=float)
    by_theory = {} if known is None else known.quantiles(at)
    quantiles = {}
    for quantity, number in QUANTITIES.items():
        if np.isnan(own[number]).any():  # sds a posteriori need redundancy
            continue
        nothing = np.full((len(own[number]), len(at)), np.nan)
        values, errors = by_theory.get(quantity, (nothing, nothing))
        beside = theory.get(number, [None] * len(nothing))
        names = TILTS if quantity == TILT else cell.parameter_units
        for i, name in enumerate(names):
            quantiles[quantity, name] = controlled_quantiles(
                at, own[number][i], beside[i], values[i], converged, errors[i]
            )
    first = own["error"][:, 0], own["sigma_posteriori"][:, 0]
    return CellStatistics(cell, *counts, estimates, first, at, quantiles)


def _numbers(cell: Cell, blocks: Sequence[Block], count: int) -> dict[str, Array]:
    """Numbers as of `_numbers_of` of all blocks, of which so many calibrations converged."""
    numbers: dict[str, Array] = {}
    end = 0
    for block in blocks:
        start, end = end, end + int(block.converged.sum())
        for name, part in _numbers_of(cell, block).items():
            if name not in numbers:
                numbers[name] = np.empty((len(part), count), part.dtype)
            numbers[name][:, start:end] = part
    if numbers:
        numbers["sigma_posteriori"], numbers["error"] = np.split(numbers["sigma_and_error"], 2)
    return numbers


def _numbers_of(cell: Cell, block: Block) -> dict[str, Array]:
    """Numbers of the c calibrations that converged, (k, c) each, SI; NaN what needs redundancy.

    They are `sigma_priori` and `inside` of each parameter (the last says whether the nominal 95 %
    interval, estimate ± t σ a posteriori, holds the truth), `sigma_and_error`, the σ a posteriori
    and then the errors, `variance_factor`, and over the attitudes the mean `tilt_squared` of roll
    and pitch, and the rms `tilt` as in `TILTS`.
    """
    estimates, sigma, omega = (
        np.compress(block.converged, each.T, axis=-1)
        for each in (block.estimates, block.sigma_priori, block.omega)
    )
    factor = omega[None] / (block.redundancy or np.nan)
    error, posteriori = estimates - cell.true_values[:, None], np.sqrt(factor) * sigma
    squares = cell.tilt_error.squares(estimates[: cell.estimated_model.n_parameters].T).T
    tilt = np.sqrt(squares)
    return {
        "sigma_priori": sigma,
        "sigma_and_error": np.concatenate([posteriori, error]),
        "inside": np.abs(error) <= sigmas_95(block.redundancy) * posteriori,
        "variance_factor": factor,
        "tilt_squared": squares,
        "tilt": np.vstack([tilt, tilt.max(axis=0)]),
    }


def simulated_statistics(
    cell: Cell,
    seed: int,
    levels: Sequence[float] | Array | None = None,
    keep: Callable[[Cell, Replicates], object] | None = None,
) -> CellStatistics:
    """Simulate a cell and take its statistics; without calibrations if it is not estimable.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    levels : as of `statistics`
    keep : function that gets the cell with its replicates
    """
    if not cell.estimability.estimable:
        return CellStatistics(cell)
    replicates = simulate(cell, seed)
    if keep is not None:
        keep(cell, replicates)
    return statistics(cell, replicates, levels)
