"""A study in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from accelstudy.api.given import GRAVITY, each, for_programs, names, of_type, quantity, whole
from accelstudy.approaches import get_approach
from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import MGON, STANDARD_GRAVITY, Given
from accelstudy.basics.wording import counted
from accelstudy.pages.notebook import notebook_html
from accelstudy.planning.quantities import QUANTITIES
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.study.cell import Cell
from accelstudy.study.config import parse_study
from accelstudy.study.config.blocks import LevelingConfig
from accelstudy.study.statistics import (
    ANGLES,
    TILT,
    CellStatistics,
    calibrations,
    cell_tilt_error,
    simulated_statistics,
)
from accelstudy.study.summary import tables_of

if TYPE_CHECKING:
    import xarray as xr

LEVELING = LevelingConfig().model_dump()
"""Where the tilt error is evaluated, as in a study by default."""
REPLICATES = Range(2, bounds.REPLICATES.most)
"""Calibrations of a cell, of which there is a standard deviation."""
DIGITS = 12
"""Of a quantity in the configuration, so that 3.2 mgon stays that number."""


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """Simulated calibrations of one set-up, or of several: the cells of a study.

    Attributes
    ----------
    statistics : tuple of CellStatistics
    """

    statistics: tuple[CellStatistics, ...]

    @property
    def cells(self) -> tuple[Cell, ...]:
        """The set-ups."""
        return tuple(one.cell for one in self.statistics)

    def __repr__(self) -> str:
        return f"Simulation({self._what})"

    def _repr_html_(self) -> str:
        table = self.parameters if len(self.cells) == 1 else self.tilt
        return notebook_html("Simulation", self._what, table)

    @property
    def _what(self) -> str:
        n = sum(one.converged for one in self.statistics)
        what = self.cells[0].name if len(self.cells) == 1 else f"{len(self.cells)} cells"
        return f"{what}, {counted(n, 'calibration')}"

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of a study: cells, summary, correlations, leveling and quantiles.

        Their columns are those of the files of a study; units stand in their names, or in a column.
        """
        return tables_of(self.statistics)

    @property
    def parameters(self) -> pd.DataFrame:
        """Bias and standard deviation of each estimated parameter with their errors, SI.

        The errors are standard errors by the number of replicates. Of several cells the index has
        the name of the cell, too.
        """
        tables = []
        for one in self.statistics:
            cell, bias, sd = one.cell, one.bias, one.sd
            columns = {
                "truth": cell.true_values,
                "bias": bias.value,
                "bias_error": bias.error,
                "sd": sd.value,
                "sd_error": sd.error,
                "unit": list(cell.parameter_units.values()),
            }
            tables.append(pd.DataFrame(columns, index=pd.Index(cell.parameter_units, name="name")))
        return self._joined(tables)

    @property
    def tilt(self) -> pd.DataFrame:
        """Tilt error of roll and of pitch that the calibration leaves up to 50 gon, rad.

        The columns are its rms over all calibrations, and `q95`, which 95 of 100 calibrations stay
        below, each with its standard error.
        """
        tables = []
        for one in self.statistics:
            rms = one.tilt_rms
            bound = [one.quantile(TILT, angle, 0.95) for angle in ANGLES]
            columns = {
                "rms": rms.value,
                "rms_error": rms.error,
                "q95": [float(b.value) for b in bound],
                "q95_error": [float(b.error) for b in bound],
            }
            tables.append(pd.DataFrame(columns, index=pd.Index(ANGLES, name="angle")))
        table = self._joined(tables)
        table.attrs["units"] = dict.fromkeys(table, "rad")
        return table

    @cached_property
    def estimates(self) -> xr.Dataset:
        """Every calibration, SI: an `xarray.Dataset` of cell × replicate × parameter.

        Its variables are `estimate`, its a-posteriori standard deviation `sigma`, the `truth` of
        each cell, and `tilt`, the rms error of each angle up to 50 gon. A calibration that did not
        converge is NaN, and so is a parameter that a cell does not estimate.
        """
        import xarray as xr

        units = {name: u for cell in self.cells for name, u in cell.parameter_units.items()}
        count = max(cell.replicates for cell in self.cells)
        estimate = np.full((len(self.cells), count, len(units)), np.nan)
        sigma, truth = np.full_like(estimate, np.nan), np.full_like(estimate[:, 0], np.nan)
        tilt = np.full((len(self.cells), count, len(ANGLES)), np.nan)
        for i, (cell, one) in enumerate(zip(self.cells, self.statistics, strict=True)):
            at = np.array([list(units).index(name) for name in cell.parameter_units])
            truth[i, at] = cell.true_values
            if one.replicates is None:
                continue
            block = one.replicates.simulated
            good = np.flatnonzero(block.converged)
            numbers = calibrations(cell, block, cell_tilt_error(cell, LEVELING))
            estimate[i, good[:, None], at] = block.estimates[good]
            sigma[i, good[:, None], at] = numbers["sigma_posteriori"]
            tilt[i, good] = numbers["tilt"][:, : len(ANGLES)]
        parameters, noted = ("cell", "replicate", "parameter"), {"units": "SI, as `unit` says"}
        return xr.Dataset(
            {
                "estimate": (parameters, estimate, noted),
                "sigma": (parameters, sigma, noted),
                "truth": (("cell", "parameter"), truth, noted),
                "tilt": (("cell", "replicate", "angle"), tilt, {"units": "rad"}),
            },
            {
                "cell": [cell.name for cell in self.cells],
                "replicate": np.arange(1, count + 1),
                "parameter": list(units),
                "angle": list(ANGLES),
                "unit": ("parameter", list(units.values())),
                **{
                    key: ("cell", [getattr(cell, key) for cell in self.cells])
                    for key in ("model", "scheme", "approach")
                },
                "sensor_sigma": (
                    "cell",
                    [cell.noise.sigma_force for cell in self.cells],
                    {"units": "m/s^2"},
                ),
            },
        )

    def _joined(self, tables: Sequence[pd.DataFrame]) -> pd.DataFrame:
        """Tables of all cells; that of a single one without its name."""
        if len(tables) == 1:
            return tables[0]
        return pd.concat(tables, keys=[cell.name for cell in self.cells], names=["cell"])


@for_programs
def simulate(
    model: str | Sequence[str],
    scheme: str | Sequence[str],
    approach: str | Sequence[str],
    *,
    sigma: float | str | Sequence[float | str],
    robot_accuracy: float | str = "3.2 mgon",
    gravity: float | str = STANDARD_GRAVITY,
    truth: Mapping[str, float | str] | None = None,
    replicates: int = 1000,
    seed: int = 1,
) -> Simulation:
    """Simulate the calibrations of one set-up, or of every combination of several.

    A study of the workflow with the same cells, noise and seed gives the same numbers.

    Parameters
    ----------
    model, scheme, approach : str, a name or a file, or several of them
    sigma : float in m/s² or str with a unit, of the mean of a position; or several
    robot_accuracy : float in rad or str with a unit, of the robot's roll and pitch
    gravity : float in m/s² or str with a unit
    truth : mapping of parameter to true value, SI or with a unit; 0 if omitted. Of several models
        each has those that are its own.
    replicates, seed : int

    Raises
    ------
    InputError
        If a name or a value is wrong, or the positions do not determine any of the models.
    """
    grid: dict[str, Any] = {
        "models": [get_model(one).name for one in names("model", model)],
        "schemes": [get_scheme(one).name for one in names("scheme", scheme)],
        "approaches": [get_approach(one).name for one in names("approach", approach)],
        "sensor_sigma_mps2": [_si("sigma", one, QUANTITIES["sigma"]) for one in each(sigma)],
        "replicates": whole("replicates", replicates, REPLICATES),
    }
    for key, values in zip(("model", "scheme", "approach", "sigma"), grid.values(), strict=False):
        if not values:
            raise InputError(f"{key}: none is given")
    robot = _si("robot_accuracy", robot_accuracy, QUANTITIES["robot_accuracy"], MGON)
    study = parse_study(
        {
            "study": "python",
            "seed": whole("seed", seed, bounds.SEED),
            "gravity_mps2": _si("gravity", gravity, GRAVITY),
            "noise": {
                "sensor": {"sigma_mps2": grid["sensor_sigma_mps2"][0]},
                "robot": {"sigma_mgon": robot},
            },
            "grids": [grid],
        },
        "simulate",
    )
    cells = _with_truth(study.cells, truth)
    if not any(cell.estimability.estimable for cell in cells):
        raise InputError(f"{cells[0].name}: {cells[0].estimability.reason}")
    return Simulation(tuple(simulated_statistics(cell, seed, LEVELING) for cell in cells))


def _si(name: str, value: float | str, given: Given, unit: float = 1.0) -> float:
    """Quantity in a unit of the configuration."""
    return float(f"{quantity(name, value, given) / unit:.{DIGITS}g}")


def _with_truth(cells: Sequence[Cell], truth: Mapping[str, float | str] | None) -> list[Cell]:
    """Cells whose sensors have these true parameters."""
    of_type("truth", truth or {}, Mapping, expected="a mapping of parameter to value")
    units = {p.name: p.unit for cell in cells for p in cell.simulated_model.parameters}
    values = {}
    for name, value in (truth or {}).items():
        if name not in units:
            raise UnknownNameError("parameter of the truth", name, units)
        values[name] = quantity(f"truth: {name}", value, Given(units[name], "", -inf))
    return [
        replace(cell, truth={**cell.truth, **{k: v for k, v in values.items() if k in cell.truth}})
        for cell in cells
    ]
