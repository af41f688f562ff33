"""The quantities of every calibration that a study sums up, and those of which it has quantiles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.basics.shares import sigmas_95
from accelstudy.basics.units import GON
from accelstudy.effects import get_effect
from accelstudy.leveling.error import TiltError, cap_forces, tilt_error
from accelstudy.study.cell import Cell

Array = NDArray[np.float64]
Key = tuple[str, str]
"""Quantity, and the name of what it is of."""

ERROR, PRIORI, POSTERIORI, EFFECT = "error", "sd_priori", "sd_posteriori", "sd_of_effect"
TILT = "tilt"
"""Quantities: of each parameter, of each effect (the mean of its parameters' sds a posteriori), and
the rms over attitudes of the errors of roll and of pitch."""
ANGLES = ("roll", "pitch")
TILTS = (*ANGLES, "both")
"""Names of the tilt errors that have quantiles: of each angle by itself, and of the larger of the
two, so that both angles stay below its quantile."""


@dataclass(frozen=True)
class Followed:
    """The quantities of a cell, in SI.

    Attributes
    ----------
    units : dict of parameter to SI unit, in the order of the estimates
    truth : (u,) array
    effects : dict of effect to the numbers of its parameters
    """

    units: dict[str, str]
    truth: Array
    effects: dict[str, list[int]]

    @classmethod
    def of(cls, cell: Cell) -> Followed:
        """Take what a cell estimates."""
        units = cell.parameter_units
        names = list(units)
        effects = {
            spec: [names.index(p.name) for p in get_effect(spec).parameters]
            for spec in cell.effects
            if len({p.unit for p in get_effect(spec).parameters}) == 1
        }
        return cls(units, cell.true_values, effects)

    @cached_property
    def keys(self) -> list[Key]:
        """Quantity and name of each column of `values`."""
        each = [(quantity, name) for quantity in (ERROR, PRIORI, POSTERIORI) for name in self.units]
        return [*each, *((EFFECT, spec) for spec in self.effects)]

    def columns(self, quantity: str) -> slice:
        """Columns of `values` that hold a quantity: of each parameter, or of each effect."""
        held = [i for i, (each, _) in enumerate(self.keys) if each == quantity]
        return slice(held[0], held[-1] + 1) if held else slice(0)

    def values(self, block: Block) -> Array:
        """Quantities of the converged calibrations, (R, q); NaN what needs redundancy."""
        converged = block.converged
        priori = block.sigma_priori[converged]
        freedom = block.redundancy if block.redundancy > 0 else np.nan
        posteriori = np.sqrt(block.omega[converged] / freedom)[:, None] * priori
        effects = [posteriori[:, columns].mean(axis=1) for columns in self.effects.values()]
        errors = block.estimates[converged] - self.truth
        return np.column_stack([errors, priori, posteriori, *effects])

    def inside(self, values: Array, redundancy: int) -> NDArray[np.bool_]:
        """Whether nominal 95 % intervals hold the truth, (R, u); NaN without redundancy: outside.

        The intervals are estimate ± t σ a posteriori, t of Student's distribution.
        """
        half = sigmas_95(redundancy) * values[:, self.columns(POSTERIORI)]
        return np.asarray(np.abs(values[:, self.columns(ERROR)]) <= half)

    def distributed(self, redundancy: int) -> list[Key]:
        """Quantities that have quantiles, tilt errors last."""
        defined = (ERROR, POSTERIORI, EFFECT) if redundancy > 0 else (ERROR,)
        return [*(k for k in self.keys if k[0] in defined), *((TILT, name) for name in TILTS)]


@dataclass(frozen=True)
class Distributed:
    """The quantities of a cell that have quantiles.

    Parameters
    ----------
    followed : Followed
    redundancy : int
    tilt : TiltError, of the calibrations of the cell
    """

    followed: Followed
    redundancy: int
    tilt: TiltError

    @cached_property
    def keys(self) -> list[Key]:
        """Quantity and name of each column of `of`."""
        return self.followed.distributed(self.redundancy)

    def of(self, block: Block) -> Array:
        """Quantities of the converged calibrations, (R, s)."""
        values = self.followed.values(block)
        chosen = [self.followed.keys.index(key) for key in self.keys[: -len(TILTS)]]
        estimates = block.estimates[block.converged][:, : len(self.tilt.reference)]
        return np.column_stack([values[:, chosen], tilts(self.tilt, estimates).T])


def tilts(tilt: TiltError, estimates: Array) -> Array:
    """Tilt errors that calibrations leave, rms over attitudes, (3, R), as in `TILTS`."""
    each = tilt.rms(estimates).T
    return np.vstack([each, each.max(axis=0)])


def cell_tilt_error(cell: Cell, leveling: Mapping[str, Any]) -> TiltError:
    """Tilt error that the calibrations of a cell leave, about the calibration without noise.

    Parameters
    ----------
    cell : Cell
    leveling : mapping with max_tilt_gon and attitudes
    """
    simulated, estimated = cell.simulated_model, cell.estimated_model
    forces = cap_forces(leveling["max_tilt_gon"] * GON, leveling["attitudes"], cell.gravity)
    return tilt_error(
        simulated,
        simulated.vector(cell.truth),
        estimated,
        reference_of(cell)[: estimated.n_parameters],
        forces,
        cell.gravity,
        cell.holds.use(forces, cell.positions.n_positions),
    )


def reference_of(cell: Cell) -> Array:
    """Estimates from observations without noise, (u,); if there are none, the truth."""
    theory = cell.linear_theory
    return cell.true_values if theory is None else theory.reference
