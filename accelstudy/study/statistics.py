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

ERROR, POSTERIORI, TILT = "error", "sd_posteriori", "tilt"
"""Quantities that have quantiles: of each parameter, and the rms over attitudes of tilt errors."""
ANGLES = ("roll", "pitch")
TILTS = (*ANGLES, "both")
"""Names of the tilt errors that have quantiles: of each angle by itself, and of the larger of the
two, so that both angles stay below its quantile."""


@dataclass(frozen=True)
class CellStatistics:
    """Statistics of the calibrations of a cell, SI; NaN where nothing was simulated or converged.

    Attributes
    ----------
    cell : Cell
    replicates : Replicates; None of a cell that is not estimable
    bias, sd : Estimates, (u,), of the errors of the estimates
    sigma_priori, sigma_posteriori : Estimates, (u,), means of the stated standard deviations
    sd_ratio : Estimates, (u,), `sigma_posteriori` over `sd`
    coverage : Estimates, (u,), shares of the nominal 95 % intervals that hold the truth
    correlation : Estimates, below the diagonal in the order of `numpy.tril_indices`
    effect_sigma : Estimates, (e,), mean sigma a posteriori of the parameters of each effect
    variance_factor : Estimates, (1,), mean of σ̂0²
    tilt_rms : Estimates, (2,), rad, rms of roll and pitch over attitudes and calibrations
    levels : (k,) array, probabilities of the quantiles
    quantiles : dict of quantity and name to Estimates, (k,); empty if nothing converged
    """

    cell: Cell
    replicates: Replicates | None
    bias: Estimates
    sd: Estimates
    sigma_priori: Estimates
    sigma_posteriori: Estimates
    sd_ratio: Estimates
    coverage: Estimates
    correlation: Estimates
    effect_sigma: Estimates
    variance_factor: Estimates
    tilt_rms: Estimates
    levels: Array = field(default_factory=lambda: np.zeros(0))
    quantiles: Mapping[Key, Estimates] = field(default_factory=dict)

    @classmethod
    def unknown(cls, cell: Cell, replicates: Replicates | None = None) -> CellStatistics:
        """Return the statistics of a cell without calibrations."""
        u = cell.n_unknowns
        sizes = {"correlation": u * (u - 1) // 2, "effect_sigma": len(cell.uniform_effects)}
        sizes |= {"variance_factor": 1, "tilt_rms": 2}
        of_parameters = ("bias", "sd", "sigma_priori", "sigma_posteriori", "sd_ratio", "coverage")
        sizes |= dict.fromkeys(of_parameters, u)
        unknown: dict[str, Any] = {name: Estimates.unknown(n) for name, n in sizes.items()}
        return cls(cell, replicates, **unknown)

    @property
    def simulated(self) -> int:
        """Number of simulated calibrations."""
        return 0 if self.replicates is None else len(self.replicates.simulated.converged)

    @property
    def converged(self) -> int:
        """Number of calibrations that converged."""
        return 0 if self.replicates is None else int(self.replicates.simulated.converged.sum())

    @property
    def redundancy(self) -> int:
        """Redundancy of a calibration; 0 of a cell that was not simulated."""
        return 0 if self.replicates is None else self.replicates.simulated.redundancy

    @property
    def control(self) -> str:
        """Which control variate the estimates have: `linear` or `none`."""
        linear = self.replicates is not None and self.replicates.linear is not None
        return "linear" if linear and self.simulated >= LEAST else "none"

    @property
    def mean_correlation(self) -> Array:
        """Mean of the correlations from Σ_xx, (u, u)."""
        u = self.cell.n_unknowns
        if self.replicates is None or not self.converged:
            return np.full((u, u), np.nan)
        return self.replicates.simulated.correlation_sum / self.converged

    @property
    def first(self) -> tuple[Array, Array]:
        """Errors and sigmas a posteriori of the first calibration that converged, (u,) each."""
        u = self.cell.n_unknowns
        if self.replicates is None or not self.converged:
            return np.full(u, np.nan), np.full(u, np.nan)
        block = self.replicates.simulated
        at = int(np.argmax(block.converged))
        one = calibrations(self.cell, block.rows(slice(at, at + 1)))
        return one["error"][0], one["sigma_posteriori"][0]

    def quantile(self, quantity: str, name: str, level: float) -> Estimates:
        """One quantile; NaN where there is none."""
        if (quantity, name) not in self.quantiles:
            return Estimates.unknown(1)[0]
        at = np.flatnonzero(np.isclose(self.levels, level))
        return self.quantiles[quantity, name][at][0]


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
    converged = simulated.converged
    if not converged.any():
        return CellStatistics.unknown(cell, replicates)
    tilt = cell_tilt_error(cell, leveling)
    own = calibrations(cell, simulated, tilt)
    theory = None if linear is None else calibrations(cell, linear, tilt)
    known = None
    if cell.linear_theory is not None and theory is not None:
        known = KnownValues(cell, cell.linear_theory, tilt)

    def estimate(statistic: Statistic, *names: str, by: str | None) -> Estimates:
        def numbers(of: Mapping[str, Array]) -> Array:
            return of[names[0]] if len(names) == 1 else np.hstack([of[name] for name in names])

        expected = np.nan if known is None or by is None else getattr(known, by)
        beside = None if theory is None else numbers(theory)
        return controlled(statistic, numbers(own), beside, expected, converged)

    at = usual_levels(len(own["error"])) if levels is None else np.asarray(levels, dtype=float)
    return CellStatistics(
        cell,
        replicates,
        bias=estimate(MEAN, "error", by="bias"),
        sd=estimate(SD, "error", by="sd"),
        sigma_priori=estimate(MEAN, "sigma_priori", by=None),  # linear theory has one only
        sigma_posteriori=estimate(MEAN, "sigma_posteriori", by="sigma_posteriori"),
        sd_ratio=estimate(RATIO, "sigma_posteriori", "error", by="sd_ratio"),
        coverage=estimate(MEAN, "inside", by="coverage"),
        correlation=_correlation(estimate(CORRELATION, "error", by="correlation"), own["error"]),
        effect_sigma=estimate(MEAN, "effect_sigma", by="effect_sigma"),
        variance_factor=estimate(MEAN, "variance_factor", by="variance_factor"),
        tilt_rms=estimate(ROOT_MEAN, "tilt_squared", by="tilt_rms"),
        levels=at,
        quantiles=_quantiles(cell, own, theory, known, converged, at, simulated.redundancy > 0),
    )


def _correlation(estimates: Estimates, errors: Array) -> Estimates:
    """Correlations within −1 and 1; NaN of fewer calibrations than parameters."""
    count, u = errors.shape
    if count <= u:
        return Estimates.unknown(len(estimates.value))
    value, plain = (np.clip(each, -1, 1) for each in (estimates.value, estimates.plain))
    return Estimates(value, estimates.error, estimates.gain, plain)


def _quantiles(
    cell: Cell,
    own: Mapping[str, Array],
    theory: Mapping[str, Array] | None,
    known: KnownValues | None,
    converged: NDArray[np.bool_],
    levels: Array,
    redundant: bool,
) -> dict[Key, Estimates]:
    """Quantiles of the errors, of the sigmas a posteriori and of the tilt errors."""
    quantities = {ERROR: "error", **({POSTERIORI: "sigma_posteriori"} if redundant else {})}
    by_theory: dict[str, Array] = {}
    inexact = np.zeros((len(TILTS), len(levels)))
    if known is not None and len(converged) >= LEAST:
        by_theory[ERROR] = known.error_quantiles(levels)
        sigma = known.theory.sigma[:, None]
        by_theory[POSTERIORI] = sigma * known.factor_quantiles(levels)
        by_theory[TILT] = known.tilts.quantile(levels)
        inexact = known.tilts.relative_error(levels)
    found: dict[Key, Estimates] = {}
    for quantity, column in (*quantities.items(), (TILT, "tilt")):
        for i, name in enumerate(TILTS if quantity == TILT else cell.parameter_units):
            found[quantity, name] = controlled_quantiles(
                levels,
                own[column][:, i],
                None if theory is None else theory[column][:, i],
                by_theory[quantity][i] if by_theory else None,
                converged,
                inexact[i] if quantity == TILT else 0.0,
            )
    return found


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
        return CellStatistics.unknown(cell)
    return statistics(cell, simulate(cell, seed), leveling, levels)
