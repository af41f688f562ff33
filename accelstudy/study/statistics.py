"""The statistics of the calibrations of a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
    Statistic,
    controlled,
)
from accelstudy.study.known import KnownValues
from accelstudy.study.quantiles import controlled_quantiles, usual_levels
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
"""Each statistic of a cell, and the numbers of `calibrations` that it is of: bias and standard
deviation of the errors, the mean standard deviations that are stated, `sd_ratio` of those a
posteriori and the sd, share of the nominal 95 % intervals that hold the truth, correlations below
the diagonal, mean of σ̂0², and the rms of roll and pitch over attitudes and calibrations."""

TILT = "tilt"
QUANTITIES = {"error": "error", "sd_posteriori": "sigma_posteriori", TILT: "tilt"}
"""Quantities that have quantiles, of each parameter, and of each of `TILTS` the rms over attitudes;
and the numbers of `calibrations` that they are of."""
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
    replicates : Replicates; None of a cell that is not estimable
    estimates : dict of `STATISTICS` to Estimates; empty if nothing converged
    first : errors and sigmas a posteriori of the first calibration that converged, (u,) each
    levels : (k,) array, probabilities of the quantiles
    quantiles : dict of quantity and name to Estimates, (k,); empty if nothing converged
    """

    cell: Cell
    replicates: Replicates | None = None
    estimates: Mapping[str, Estimates] = field(default_factory=dict)
    first: tuple[Any, Any] = (np.nan, np.nan)
    levels: Array = field(default_factory=lambda: np.zeros(0))
    quantiles: Mapping[Key, Estimates] = field(default_factory=dict)

    def __getitem__(self, statistic: str) -> Estimates:
        return self.estimates.get(statistic, UNKNOWN)

    @property
    def simulated(self) -> int:
        """Number of simulated calibrations."""
        return 0 if self.replicates is None else len(self.replicates.simulated.converged)

    @property
    def converged(self) -> int:
        """Number of calibrations that converged."""
        return 0 if self.replicates is None else int(self.replicates.simulated.converged.sum())

    @property
    def control(self) -> str:
        """Which control variate the estimates have: `linear` or `none`."""
        if self.replicates is None or self.simulated < MIN_REPLICATES:
            return "none"
        return "none" if np.isnan(self.replicates.linear.omega).any() else "linear"

    def quantile(self, quantity: str, name: str, level: float) -> Estimates:
        """One quantile; NaN where there is none."""
        quantiles = self.quantiles.get((quantity, name))
        return UNKNOWN if quantiles is None else quantiles[np.isclose(self.levels, level)][0]


def statistics(
    cell: Cell,
    replicates: Replicates,
    levels: Sequence[float] | Array | None = None,
) -> CellStatistics:
    """Take the statistics of the replicates of a cell.

    Parameters
    ----------
    cell : Cell, estimable
    replicates : Replicates
    levels : probabilities of the quantiles; by default those that so many replicates can have
    """
    good, count = replicates.simulated.converged, int(replicates.simulated.converged.sum())
    if not count:
        return CellStatistics(cell, replicates)
    own, theory = (calibrations(cell, block) for block in replicates)
    at = usual_levels(count) if levels is None else np.asarray(levels, dtype=float)
    known = KnownValues.of(cell)
    expected = {} if known is None else known.statistics
    estimates = {}
    for name, (statistic, number) in STATISTICS.items():
        if name != "correlation" or count > cell.n_unknowns:
            by = expected.get(name, np.nan)
            estimates[name] = controlled(statistic, own[number], theory[number], by, good)
    quantiles = {}
    nothing = np.full((max(len(TILTS), cell.n_unknowns), len(at)), np.nan)
    by_theory = {} if known is None else known.quantiles(at)
    for quantity, number in QUANTITIES.items():
        if np.isnan(own[number]).any():  # sigmas a posteriori need redundancy
            continue
        values, errors = by_theory.get(quantity, (nothing, nothing))
        for i, name in enumerate(TILTS if quantity == TILT else cell.parameter_units):
            pair = own[number][:, i], theory[number][:, i]
            quantiles[quantity, name] = controlled_quantiles(at, *pair, values[i], good, errors[i])
    first = own["error"][0], own["sigma_posteriori"][0]
    return CellStatistics(cell, replicates, estimates, first, at, quantiles)


def calibrations(cell: Cell, block: Block) -> dict[str, Array]:
    """Numbers of the c calibrations that converged, (c, k), SI; NaN what needs redundancy.

    They are `error`, `sigma_priori`, `sigma_posteriori` and `inside` of each parameter (the last
    says whether the nominal 95 % interval, estimate ± t σ a posteriori, holds the truth),
    `sigma_and_error` of all parameters after each other, `variance_factor`, and over the attitudes
    the mean `tilt_squared` of roll and pitch, and the rms `tilt` as in `TILTS`.
    """
    good = block.converged
    freedom = block.redundancy if block.redundancy > 0 else np.nan
    factor = block.omega[good, None] / freedom
    estimates, priori = block.estimates[good], block.sigma_priori[good]
    together = np.empty((len(estimates), 2 * cell.n_unknowns))
    posteriori, error = np.hsplit(together, 2)  # parts of it, as a million of each takes long
    np.multiply(np.sqrt(factor), priori, out=posteriori)
    np.subtract(estimates, cell.true_values, out=error)
    squares = cell.tilt_error.squares(estimates[:, : cell.estimated_model.n_parameters])
    tilt = np.sqrt(squares)
    return {
        "error": error,
        "sigma_priori": priori,
        "sigma_posteriori": posteriori,
        "sigma_and_error": together,
        "inside": np.abs(error) <= sigmas_95(block.redundancy) * posteriori,
        "variance_factor": factor,
        "tilt_squared": squares,
        "tilt": np.column_stack([tilt, np.maximum(*tilt.T)]),
    }


def simulated_statistics(
    cell: Cell,
    seed: int,
    levels: Sequence[float] | Array | None = None,
) -> CellStatistics:
    """Simulate a cell and take its statistics; without calibrations if it is not estimable.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    levels : as of `statistics`
    """
    if not cell.estimability.estimable:
        return CellStatistics(cell)
    return statistics(cell, simulate(cell, seed), levels)
