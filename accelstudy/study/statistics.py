"""The statistics of the calibrations of a cell."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.basics.shares import sigmas_95
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import (
    CORRELATION,
    MEAN,
    MIN_REPLICATES,
    RATIO,
    ROOT_MEAN,
    SD,
    UNKNOWN,
    Estimates,
    Sample,
    Statistic,
    controlled,
    controlled_quantiles,
    usual_levels,
)
from accelstudy.study.known import KnownValues
from accelstudy.study.replicates import Replicates, simulate

Array = NDArray[np.float64]
Key = tuple[str, str]
"""Quantity, and the name of what it is of."""

STATISTICS: dict[str, tuple[Statistic, str]] = {
    "bias": (MEAN, "error"),
    "sd": (SD, "error"),
    "sigma_priori": (MEAN, "sigma_priori"),
    "sigma_posteriori": (MEAN, "sigma_posteriori"),
    "sd_ratio": (RATIO, "sigma_and_error"),
    "coverage": (MEAN, "inside"),
    "correlation": (CORRELATION, "error"),
    "variance_factor": (MEAN, "variance_factor"),
    "tilt_rms": (ROOT_MEAN, "tilt_squared"),
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
    cell: Cell,
    replicates: Iterable[Replicates],
    levels: Sequence[float] | Array | None = None,
) -> CellStatistics:
    """Take the statistics of the replicates of a cell.

    Parameters
    ----------
    cell : Cell, estimable
    replicates : Replicates that follow each other, all of the cell together
    levels : probabilities of the quantiles; by default those that so many replicates can have
    """
    rows = _rows(cell)
    own, theory = _Numbers(rows), _Numbers(rows)
    good, correlations = [], np.zeros((cell.n_unknowns, cell.n_unknowns))
    for part in replicates:
        own.add(_numbers(cell, part.simulated, rows))
        if part.linear is not None:
            theory.add(_numbers(cell, part.linear, rows))
        good.append(part.simulated.converged)
        correlations += part.simulated.correlation_sum
    converged = np.concatenate(good)
    count = own.sample.count
    known = KnownValues.of(cell) if theory.parts else None
    control = "linear" if known is not None and len(converged) >= MIN_REPLICATES else "none"
    counts = len(converged), count, control, correlations / (count or np.nan)
    if not count:
        return CellStatistics(cell, *counts)
    at = usual_levels(count) if levels is None else np.asarray(levels, dtype=float)
    expected = {} if known is None else known.statistics
    estimates = {}
    for name, (statistic, number) in STATISTICS.items():
        if name != "correlation" or count > cell.n_unknowns:
            chosen, by = rows[number], expected.get(name, np.nan)
            control_sample = None if known is None else theory.sample[chosen]
            estimates[name] = controlled(
                statistic, own.sample[chosen], control_sample, by, converged
            )
    quantiles = {}
    nothing = np.full((max(len(TILTS), cell.n_unknowns), len(at)), np.nan)
    by_theory = {} if known is None else known.quantiles(at)
    for quantity, number in QUANTITIES.items():
        if np.isnan(own.sample.mean[rows[number]]).any():  # sds a posteriori need redundancy
            continue
        values, errors = by_theory.get(quantity, (nothing, nothing))
        for i, name in enumerate(TILTS if quantity == TILT else cell.parameter_units):
            beside = None if known is None else theory.all_of(number, i)
            quantiles[quantity, name] = controlled_quantiles(
                at, own.all_of(number, i), beside, values[i], converged, errors[i]
            )
    one = own.sample.first[:, 0]
    first = one[rows["error"]], one[rows["sigma_posteriori"]]
    return CellStatistics(cell, *counts, estimates, first, at, quantiles)


def _rows(cell: Cell) -> dict[str, slice]:
    """Rows of `_numbers` by their names; from "sigma_posteriori" on they have quantiles."""
    u = cell.n_unknowns
    counts = {"sigma_priori": u, "inside": u, "variance_factor": 1, "tilt_squared": len(ANGLES)}
    counts |= {"sigma_posteriori": u, "error": u, "tilt": len(TILTS)}
    ends = dict(zip(counts, np.cumsum([*counts.values()]), strict=True))
    rows = {name: slice(end - counts[name], end) for name, end in ends.items()}
    return rows | {"sigma_and_error": slice(rows["sigma_posteriori"].start, ends["error"])}


def _numbers(cell: Cell, block: Block, rows: Mapping[str, slice]) -> Array:
    """Numbers of the c calibrations that converged, (k, c), SI; NaN what needs redundancy.

    They are `error`, `sigma_priori`, `sigma_posteriori` and `inside` of each parameter (the last
    says whether the nominal 95 % interval, estimate ± t σ a posteriori, holds the truth),
    `variance_factor`, and over the attitudes the mean `tilt_squared` of roll and pitch, and the rms
    `tilt` as in `TILTS`.
    """
    good = block.converged
    numbers = np.empty((rows["tilt"].stop, int(good.sum())))
    of = {name: numbers[chosen] for name, chosen in rows.items()}  # views of it
    estimates = block.estimates[good].T
    of["sigma_priori"][:] = block.sigma_priori[good].T
    of["variance_factor"][:] = block.omega[good] / (block.redundancy or np.nan)
    np.multiply(np.sqrt(of["variance_factor"]), of["sigma_priori"], out=of["sigma_posteriori"])
    np.subtract(estimates, cell.true_values[:, None], out=of["error"])
    of["inside"][:] = np.abs(of["error"]) <= sigmas_95(block.redundancy) * of["sigma_posteriori"]
    tilted = estimates[: cell.estimated_model.n_parameters].T
    of["tilt_squared"][:] = cell.tilt_error.squares(tilted).T
    np.sqrt(of["tilt_squared"], out=of["tilt"][: len(ANGLES)])
    of["tilt"][-1] = of["tilt"][: len(ANGLES)].max(axis=0)
    return numbers


class _Numbers:
    """Numbers of replicates: a sample of all, and those that have quantiles themselves."""

    def __init__(self, rows: Mapping[str, slice]) -> None:
        self.rows, self.start = rows, rows["sigma_posteriori"].start
        self.sample = Sample.of(np.empty((rows["tilt"].stop, 0)))
        self.parts: list[Array] = []

    def add(self, numbers: Array) -> None:
        """Add the numbers of replicates that follow."""
        sample = Sample.of(numbers)
        self.sample = self.sample + sample if self.sample.count else sample
        self.parts.append(numbers[self.start :].copy())

    def all_of(self, name: str, i: int) -> Array:
        """One of the numbers of a name, of all replicates."""
        row = self.rows[name].start + i - self.start
        return np.concatenate([part[row] for part in self.parts])


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
    keep : function that gets the cell with its replicates as they are simulated
    """
    if not cell.estimability.estimable:
        return CellStatistics(cell)

    def kept() -> Iterator[Replicates]:
        for replicates in simulate(cell, seed):
            if keep is not None:
                keep(cell, replicates)
            yield replicates

    return statistics(cell, kept(), levels)
