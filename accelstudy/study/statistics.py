"""The statistics of the calibrations of a cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from accelstudy.adjustment.calibration import Block
from accelstudy.basics.arrays import Array
from accelstudy.basics.shares import sigmas_95
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import (
    MIN_REPLICATES,
    UNKNOWN,
    Estimates,
    Value,
    controlled,
    controlled_quantiles,
    correlation,
    mean,
    ratio,
    rms,
    sd,
    usual_levels,
)
from accelstudy.study.known import KnownValues
from accelstudy.study.replicates import Replicates, simulate

Key = tuple[str, str]
"""Quantity, and the name of what it is of."""

TILT = "tilt"
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
    estimates : dict of statistics as in `NUMBERS`, to Estimates; empty if nothing converged
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
    cell : Cell
    replicates : Replicates; none of a cell that is not estimable
    levels : probabilities of the quantiles; by default those that so many replicates can have
    """
    if not replicates.simulated:
        return CellStatistics(cell)
    converged = np.concatenate([block.converged for block in replicates.simulated])
    theory = cell.linear_theory if replicates.linear else None
    known = None if theory is None else KnownValues(cell, theory)
    control = "linear" if known is not None and len(converged) >= MIN_REPLICATES else "none"
    count = int(converged.sum())
    total = np.sum([block.correlation_sum for block in replicates.simulated], axis=0)
    correlation = total / (count or np.nan)
    counts = len(converged), count, control, correlation
    if not count:
        return CellStatistics(cell, *counts)
    expected = {} if known is None else known.statistics
    at = usual_levels(count) if levels is None else np.asarray(levels, dtype=float)
    by_theory = {} if known is None else known.quantiles(at)
    sides = [blocks for blocks in replicates if blocks]
    # One place for the numbers of each side: with new memory for each, all takes a quarter longer.
    places = [np.empty((max(cell.n_unknowns, len(TILTS)), len(converged))) for _ in sides]
    values: dict[str, list[Value]] = {}
    quantiles: dict[Key, Estimates] = {}
    for number in NUMBERS:
        rows = [_rows(number, cell, *side) for side in zip(sides, places, strict=True)]
        for name, statistic in number.statistics.items():
            values[name] = [statistic(each) for each in rows]
        if number.quantity and not np.isnan(rows[0]).any():  # sds a posteriori need redundancy
            exact = by_theory.get(number.quantity, (UNKNOWN.value, UNKNOWN.value))
            found = controlled_quantiles(at, converged, *exact, *rows)
            names = TILTS if number.quantity == TILT else cell.parameter_units
            quantiles |= {(number.quantity, name): found[i] for i, name in enumerate(names)}
    sds = zip(values["sigma_posteriori"], values["sd"], strict=True)
    values["sd_ratio"] = [ratio(*each) for each in sds]
    estimates = {
        name: controlled(converged, expected.get(name, np.nan), *each)
        for name, each in values.items()
        if name != "correlation" or count > cell.n_unknowns
    }
    block = next(block for block in replicates.simulated if block.converged.any())
    numbers = _errors(cell, block), _posteriori(cell, block)
    error, sigma = (each[:, block.converged.argmax()] for each in numbers)
    return CellStatistics(cell, *counts, estimates, (error, sigma), at, quantiles)


# --- numbers of each calibration (k, R), SI -------------------------------------------------------


class Number(NamedTuple):
    """Numbers of each calibration of a block, (k, R), and what a study says of them.

    Attributes
    ----------
    of_block : function of a cell and a block
    statistics : dict of name to Statistic
    quantity : str, name of what has quantiles; empty if nothing
    """

    of_block: Callable[[Cell, Block], Array]
    statistics: Mapping[str, Callable[[Array], Value]]
    quantity: str = ""


def _errors(cell: Cell, block: Block) -> Array:
    return (block.estimates - cell.true_values).T


def _factor(cell: Cell, block: Block) -> Array:
    """Variance of unit weight σ̂0²; NaN without redundancy, as all that follows from it."""
    return block.omega[None] / (block.redundancy or np.nan)


def _posteriori(cell: Cell, block: Block) -> Array:
    return np.asarray(np.sqrt(_factor(cell, block)) * block.sigma_priori.T)


def _inside(cell: Cell, block: Block) -> Array:
    """Whether the nominal 95 % intervals, estimate ± t σ a posteriori, hold the truth."""
    half = sigmas_95(block.redundancy) * _posteriori(cell, block)
    return np.asarray(np.abs(_errors(cell, block)) <= half)


def _tilts(cell: Cell, block: Block) -> Array:
    """Rms over attitudes of the tilt errors, as in `TILTS`."""
    tilt = cell.tilt_error.rms(block.estimates[:, : cell.estimated_model.n_parameters]).T
    return np.vstack([tilt, tilt.max(axis=0)])


NUMBERS = (
    Number(_errors, {"bias": mean, "sd": sd, "correlation": correlation}, "error"),
    Number(_posteriori, {"sigma_posteriori": mean}, "sd_posteriori"),
    Number(_tilts, {"tilt_rms": lambda tilts: rms(tilts[: len(ANGLES)])}, TILT),
    Number(lambda cell, block: block.sigma_priori.T, {"sigma_priori": mean}),
    Number(_inside, {"coverage": mean}),
    Number(_factor, {"variance_factor": mean}),
)
"""What statistics are of. `sd_ratio`, of the mean sigma a posteriori and the sd, follows from two;
`correlation` is below the diagonal; quantiles of the tilt are over calibrations."""


def _rows(number: Number, cell: Cell, blocks: Sequence[Block], place: Array) -> Array:
    """Numbers of the c calibrations of all blocks that converged, (k, c), in some place."""
    end = 0
    for block in blocks:
        values, start = number.of_block(cell, block), end
        if not block.converged.all():
            values = np.compress(block.converged, values, axis=1)
        end += values.shape[1]
        place[: len(values), start:end] = values
    return place[: len(values), :end]


def simulated_statistics(
    cell: Cell, seed: int, levels: Sequence[float] | Array | None = None
) -> CellStatistics:
    """Simulate a cell, with the seed of a study, and take its `statistics`."""
    return statistics(cell, simulate(cell, seed), levels)
