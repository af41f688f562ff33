"""The result of `accelstudy.simulate`: a study in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import inf
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import pandas as pd
import pyarrow as pa
from matplotlib.axes import Axes

from accelstudy.approaches import get_approach
from accelstudy.basics.arguments import as_sequence, check_type, quantity, tidy
from accelstudy.basics.arrays import CachedTable
from accelstudy.basics.errors import InputError, check_name
from accelstudy.basics.units import MGON, InputQuantity, display_unit, to_display
from accelstudy.basics.wording import plural
from accelstudy.drawing.style import FULL
from accelstudy.files.documents import Document, Part
from accelstudy.files.outputs import SIMULATION
from accelstudy.files.tables import write_table
from accelstudy.pages.result import Result
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.study.cell import Cell
from accelstudy.study.config import parse_study
from accelstudy.study.replicates import ESTIMATES, estimates_tables, simulate
from accelstudy.study.statistics import ANGLES, TILT, CellStatistics, simulated_statistics
from accelstudy.study.tables import tables_of, with_derived

GRID: dict[str, tuple[str, Callable[[str], Any]]] = {
    "model": ("models", get_model),
    "scheme": ("schemes", get_scheme),
    "approach": ("approaches", get_approach),
}
"""Arguments that may be several: the key in a grid of a study, and the lookup of a name."""


class CellRow(Part):
    """A row of a set-up.

    Attributes
    ----------
    cell : name of the set-up; absent if there is one
    """

    cell: str | None = None


class SimulatedParameter(CellRow):
    """A parameter over all calibrations of a set-up, in SI.

    Attributes
    ----------
    name : name
    truth : true value
    bias : mean error
    bias_error : standard error of the bias
    sd : standard deviation
    sd_error : standard error of the sd
    unit : SI unit
    """

    name: str
    truth: float
    bias: float | None
    bias_error: float | None
    sd: float | None
    sd_error: float | None
    unit: str


class SimulatedTilt(CellRow):
    """Tilt error that a calibration leaves in roll or in pitch, up to 50 gon, in rad.

    Attributes
    ----------
    angle : roll or pitch
    rms : over all calibrations
    rms_error : standard error of the rms
    q95 : bound that 95 of 100 calibrations stay below
    q95_error : standard error of this bound
    """

    angle: Literal["roll", "pitch"]
    rms: float | None
    rms_error: float | None
    q95: float | None
    q95_error: float | None


class SimulationDocument(Document):
    """Simulated calibrations; `save` of `accelstudy.simulate` writes it.

    Attributes
    ----------
    state : incomplete if some calibrations did not converge
    verdict : in words
    parameters : parameters of each set-up
    tilt : tilt errors of each set-up
    """

    file = "simulation.json"
    state: Literal["converged", "incomplete"]
    verdict: str
    parameters: list[SimulatedParameter]
    tilt: list[SimulatedTilt]


class Simulation(Result):
    """Simulated calibrations of one set-up, or of several: the cells of a study.

    Attributes
    ----------
    statistics : sequence of CellStatistics
    cells : tuple of Cell, the set-ups
    """

    kind, document = SIMULATION, SimulationDocument

    def __init__(self, statistics: Sequence[CellStatistics], seed: int) -> None:
        self.statistics, self._seed = statistics, seed
        self.cells = tuple(one.cell for one in statistics)
        self.name = self.cells[0].name if len(self.cells) == 1 else f"{len(self.cells)} cells"
        self.size = FULL, 40.0 + 6 * len(self.cells)

    @classmethod
    def of(
        cls,
        *,
        sigma: Sequence[float],
        robot_sigma: float,
        gravity: float,
        truth: Mapping[str, float | str] | None,
        replicates: int,
        seed: int,
        **names: Any,
    ) -> Simulation:
        """Simulate every combination of models, schemes and approaches of `accelstudy.simulate`."""
        grid: dict[str, Any] = {"sensor_sigma_mps2": [*map(tidy, sigma)], "replicates": replicates}
        for name, (several, get) in GRID.items():
            for one in as_sequence(names[name]):
                check_type(name, one, str, PathLike, expected="a name or a file, or several")
            grid[several] = [get(str(one)).name for one in as_sequence(names[name])]
        for name, given in {**names, "sigma": sigma}.items():
            if not as_sequence(given):
                raise InputError(f"{name}: none is given")
        noise = {
            "sensor": {"sigma_mps2": grid["sensor_sigma_mps2"][0]},
            "robot": {"sigma_mgon": tidy(robot_sigma / MGON)},
        }
        content = {"study": "python", "seed": seed, "gravity_mps2": tidy(gravity)}
        content |= {"noise": noise, "grids": [grid]}
        cells = _with_truth(parse_study(content, "simulate").cells, truth)
        if not any(cell.estimability.estimable for cell in cells):
            raise InputError(f"{cells[0].name}: {cells[0].estimability.reason}")
        return cls([simulated_statistics(cell, seed) for cell in cells], seed)

    @property
    def state(self) -> str:
        """Whether all calibrations converged: converged or incomplete."""
        wanted = sum(cell.replicates for cell in self.cells)
        return "converged" if self._converged == wanted else "incomplete"

    @property
    def verdict(self) -> str:
        """How many calibrations there are and, of one set-up, what they leave."""
        said = f"{self.name}, {plural(self._converged, 'calibration')}"
        if len(self.cells) > 1 or not self._converged:
            return f"{said}."
        roll, pitch = to_display(self.tilt["rms"], "rad")
        unit = display_unit("rad")
        return f"{said}. Roll is left with {roll:.3g} {unit} and pitch with {pitch:.3g} {unit} rms."

    @property
    def _converged(self) -> int:
        return sum(one.converged for one in self.statistics)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters or, of several set-ups, the tilt errors."""
        return self.parameters if len(self.cells) == 1 else self.tilt

    def draw(self, ax: Axes) -> None:
        """Draw the tilt error of each set-up, with its standard error."""
        for angle, rows in self.tilt.groupby("angle", sort=False):
            rms, error = (to_display(rows[key], "rad") for key in ("rms", "rms_error"))
            ax.errorbar(rms, range(len(rms)), xerr=error, fmt="o", markersize=3, label=angle)
        ax.set_yticks(range(len(self.cells)), [cell.name for cell in self.cells])
        ax.set_xlabel(f"tilt error / {display_unit('rad')}")
        ax.legend()

    def write(self, folder: Path, place: Path) -> None:
        """Write simulation.json and the tables of a study."""
        super().write(folder, place)
        for name, table in self.tables.items():
            provenance = {"config_hash": None, "seed": self._seed}
            write_table(folder / f"{name}.parquet", table, provenance)

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
        return self._joined(
            {
                "truth": one.cell.true_values,
                "bias": one["bias"].value,
                "bias_error": one["bias"].error,
                "sd": one["sd"].value,
                "sd_error": one["sd"].error,
                "unit": [*one.cell.parameter_units.values()],
                "name": [*one.cell.parameter_units],
            }
            for one in self.statistics
        )

    @property
    def tilt(self) -> pd.DataFrame:
        """Tilt error of roll and of pitch that the calibration leaves up to 50 gon, rad.

        The columns are its rms over all calibrations, and `q95`, which 95 of 100 calibrations stay
        below, each with its standard error.
        """
        bounds = [[one.quantile(TILT, angle, 0.95) for angle in ANGLES] for one in self.statistics]
        table = self._joined(
            {
                "rms": one["tilt_rms"].value,
                "rms_error": one["tilt_rms"].error,
                "q95": [float(bound.value) for bound in of_angles],
                "q95_error": [float(bound.error) for bound in of_angles],
                "angle": ANGLES,
            }
            for one, of_angles in zip(self.statistics, bounds, strict=True)
        )
        table.attrs["units"] = dict.fromkeys(table, "rad")
        return table

    def _joined(self, rows: Iterable[Mapping[str, Any]]) -> pd.DataFrame:
        """Table of all cells, whose last column is its index; of several, their names are, too."""
        tables = (pd.DataFrame(one) for one in rows)
        each = [table.set_index(table.columns[-1]) for table in tables]
        table = pd.concat(each, keys=[cell.name for cell in self.cells], names=["cell"])
        return table.droplevel("cell") if len(each) == 1 else table

    @CachedTable
    def estimates(self) -> pd.DataFrame:
        """Every calibration, SI: a row for each cell, replicate and parameter.

        The columns are those of the estimates of a study, with error, sigma0_squared and
        sigma_posteriori. Cells that cannot be estimated have no rows.
        """
        each = (
            table
            for cell in self.cells
            for table in estimates_tables(cell, simulate(cell, self._seed))
        )
        table = pa.concat_tables([ESTIMATES.empty_table(), *each])
        return with_derived(table.unify_dictionaries().to_pandas())


def _with_truth(cells: Sequence[Cell], truth: Mapping[str, float | str] | None) -> list[Cell]:
    """Cells whose sensors have these true parameters."""
    check_type("truth", truth or {}, Mapping, expected="a mapping of parameter to value")
    units = {p.name: p.unit for cell in cells for p in cell.simulated_model.parameters}
    values = {}
    for name, value in (truth or {}).items():
        check_name("parameter of the truth", name, units)
        values[name] = quantity(f"truth: {name}", value, InputQuantity(units[name], -inf))
    return [
        replace(cell, truth={**cell.truth, **{k: v for k, v in values.items() if k in cell.truth}})
        for cell in cells
    ]
