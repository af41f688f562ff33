"""The statistics of the calibrations of a cell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.units import GON
from accelstudy.leveling.error import TiltError, cap_forces, tilt_error
from accelstudy.study.cell import Cell
from accelstudy.study.estimate import (
    CORRELATION,
    LEAST,
    MEAN,
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

STATISTICS: dict[str, tuple[Statistic, tuple[str, ...]]] = {
    "bias": (MEAN, ("error",)),
    "sd": (SD, ("error",)),
    "sigma_priori": (MEAN, ("sigma_priori",)),
    "sigma_posteriori": (MEAN, ("sigma_posteriori",)),
    "sd_ratio": (RATIO, ("sigma_posteriori", "error")),
    "coverage": (MEAN, ("inside",)),
    "correlation": (CORRELATION, ("error",)),
    "variance_factor": (MEAN, ("variance_factor",)),
    "tilt_rms": (ROOT_MEAN, ("tilt_squared",)),
}
"""Each statistic of a cell, and the numbers of `calibrations` that it is of: bias and standard
deviation of the errors, the mean standard deviations that are stated, `sd_ratio` of those a
posteriori and the sd, share of the nominal 95 % intervals that hold the truth, correlations below
the diagonal, mean of σ̂0², and the rms of roll and pitch over attitudes and calibrations."""

ERROR, POSTERIORI, TILT = "error", "sd_posteriori", "tilt"
"""Quantities that have quantiles: of each parameter, and the rms over attitudes of tilt errors."""
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
        linear = self.replicates is not None and self.replicates.linear is not None
        return "linear" if linear and self.simulated >= LEAST else "none"

    def quantile(self, quantity: str, name: str, level: float) -> Estimates:
        """One quantile; NaN where there is none."""
        quantiles = self.quantiles.get((quantity, name))
        return UNKNOWN if quantiles is None else quantiles[np.isclose(self.levels, level)][0]


def statistics(
    cell: Cell,
    replicates: Replicates,
    leveling: Mapping[str, Any],
    levels: Sequence[float] | Array | None = None,
) -> CellStatistics:
    """Take the statistics of the replicates of a cell.

    Parameters
    ----------
    cell : Cell, estimable
    replicates : Replicates
    leveling : mapping with max_tilt_gon and attitudes
    levels : probabilities of the quantiles; by default those that so many replicates can have
    """
    simulated, linear = replicates
    good, count = simulated.converged, int(simulated.converged.sum())
    if not count:
        return CellStatistics(cell, replicates)
    tilt = cell_tilt_error(cell, leveling)
    own = calibrations(cell, simulated, tilt)
    at = usual_levels(count) if levels is None else np.asarray(levels, dtype=float)
    theory, known, known_quantiles = None, {}, {}
    inexact = np.zeros((len(TILTS), len(at)))
    if linear is not None and cell.linear_theory is not None:
        theory, by_theory = calibrations(cell, linear, tilt), KnownValues(cell, cell.linear_theory)
        tilts = by_theory.tilts(tilt)
        known = by_theory.statistics(tilts)
        if len(good) >= LEAST:
            known_quantiles[ERROR] = by_theory.error_quantiles(at)
            known_quantiles[POSTERIORI] = by_theory.sigma_quantiles(at)
            known_quantiles[TILT], inexact = tilts.quantile(at), tilts.relative_error(at)

    def numbers(of: dict[str, Array] | None, names: Sequence[str]) -> Any:
        return None if of is None else np.hstack([of[name] for name in names])

    def quantiles(quantity: str, column: str, i: int) -> Estimates:
        beside = None if theory is None else theory[column][:, i]
        expected = known_quantiles[quantity][i] if known_quantiles else None
        error = inexact[i] if quantity == TILT else 0.0
        return controlled_quantiles(at, own[column][:, i], beside, expected, good, error)

    estimates = {
        name: controlled(
            statistic, numbers(own, of), numbers(theory, of), known.get(name, np.nan), good
        )
        for name, (statistic, of) in STATISTICS.items()
        if name != "correlation" or count > cell.n_unknowns
    }
    columns = {ERROR: "error", POSTERIORI: "sigma_posteriori", TILT: "tilt"}
    if simulated.redundancy <= 0:
        del columns[POSTERIORI]
    return CellStatistics(
        cell,
        replicates,
        estimates,
        (own["error"][0], own["sigma_posteriori"][0]),
        at,
        {
            (quantity, name): quantiles(quantity, column, i)
            for quantity, column in columns.items()
            for i, name in enumerate(TILTS if quantity == TILT else cell.parameter_units)
        },
    )


def calibrations(cell: Cell, block: Block, tilt: TiltError | None = None) -> dict[str, Array]:
    """Numbers of the c calibrations that converged, (c, k), SI; NaN what needs redundancy.

    They are `error`, `sigma_priori`, `sigma_posteriori` and `inside` of each parameter (the last
    says whether the nominal 95 % interval, estimate ± t σ a posteriori, holds the truth),
    `effect_sigma` of each effect, and `variance_factor`. With a `tilt` there are `tilt_squared` of
    roll and pitch, and `tilt` as in `TILTS`, rms over attitudes.
    """
    good = block.converged
    freedom = block.redundancy if block.redundancy > 0 else np.nan
    factor = block.omega[good, None] / freedom
    error = block.estimates[good] - cell.true_values
    priori = block.sigma_priori[good]
    posteriori = np.sqrt(factor) * priori
    effects = [posteriori[:, at].mean(axis=1) for at in cell.effect_columns]
    numbers = {
        "error": error,
        "sigma_priori": priori,
        "sigma_posteriori": posteriori,
        "inside": (np.abs(error) <= sigmas_95(block.redundancy) * posteriori).astype(float),
        "effect_sigma": np.array(effects).reshape(len(effects), -1).T,
        "variance_factor": factor,
    }
    if tilt is not None:
        squares = tilt.squares(block.estimates[good][:, : len(tilt.reference)])
        each = np.sqrt(squares)
        numbers["tilt_squared"] = squares
        numbers["tilt"] = np.column_stack([each, each.max(axis=1)])
    return numbers


def cell_tilt_error(cell: Cell, leveling: Mapping[str, Any]) -> TiltError:
    """Tilt error that the calibrations of a cell leave, about the calibration without noise.

    Parameters
    ----------
    cell : Cell
    leveling : mapping with max_tilt_gon and attitudes
    """
    simulated, estimated, theory = cell.simulated_model, cell.estimated_model, cell.linear_theory
    reference = cell.true_values if theory is None else theory.reference
    forces = cap_forces(leveling["max_tilt_gon"] * GON, leveling["attitudes"], cell.gravity)
    return tilt_error(
        simulated,
        simulated.vector(cell.truth),
        estimated,
        reference[: estimated.n_parameters],
        forces,
        cell.gravity,
        cell.holds.use(forces, cell.positions.n_positions),
    )


def simulated_statistics(
    cell: Cell,
    seed: int,
    leveling: Mapping[str, Any],
    levels: Sequence[float] | Array | None = None,
) -> CellStatistics:
    """Simulate a cell and take its statistics; without calibrations if it is not estimable.

    Parameters
    ----------
    cell : Cell
    seed : int, of the study
    leveling, levels : as of `statistics`
    """
    if not cell.estimability.estimable:
        return CellStatistics(cell)
    return statistics(cell, simulate(cell, seed), leveling, levels)
