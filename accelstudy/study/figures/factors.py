"""The factors that vary over the cells of a study, and the levels at which others are held."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from accelstudy.basics.units import MGON, shown_unit, to_display
from accelstudy.schemes import scheme_names
from accelstudy.study.figures.registry import DataFrame, Study


@dataclass(frozen=True)
class Factor:
    """A quantity that may vary over the cells.

    Attributes
    ----------
    name : str, of the figure
    column : str, in the tables
    title, symbol : str
    size, unit : float and str, of one of the column in SI
    """

    name: str
    column: str
    title: str
    symbol: str = ""
    size: float = 1.0
    unit: str = "1"

    def shown(self, values: object) -> np.ndarray:
        """Convert values of the column into the unit shown to people."""
        values = np.asarray(values, dtype=float)
        return values if self.unit == "1" else to_display(values * self.size, self.unit)

    @property
    def shown_unit(self) -> str:
        """Unit shown to people; empty for a number."""
        return "" if self.unit == "1" else shown_unit(self.unit)

    @property
    def label(self) -> str:
        """Label of an axis."""
        unit = f"/ {self.shown_unit}" if self.shown_unit else ""
        return " ".join(filter(None, [self.title, self.symbol, unit]))


NOISES = (
    Factor("sensor-noise", "sensor_sigma_mps2", "sensor noise", "$\\sigma_f$", 1.0, "m/s^2"),
    Factor("robot-noise", "robot_sigma_mgon", "robot noise", "$\\sigma_r$", MGON, "rad"),
    Factor("gravity-noise", "gravity_sigma_mps2", "sd of gravity", "$\\sigma_g$", 1.0, "m/s^2"),
    Factor("gravity-error", "gravity_error_mps2", "error of gravity", "", 1.0, "m/s^2"),
)
POSITIONS = Factor("positions", "n_positions", "number of positions", "$n$")
FACTORS = (*NOISES, POSITIONS)


def varies(study: Study, factor: Factor) -> bool:
    """Whether a study has cells that differ in one factor alone."""
    return _may_vary(study, factor) and not swept(study, factor).empty


def swept(study: Study, factor: Factor) -> DataFrame:
    """Cells that differ in one factor, and in model, scheme and approach.

    For each model and scheme, another factor is held at the level at which this one takes the most
    values; of several such levels, at the one nearest to the study's default.

    Returns
    -------
    DataFrame
        A row per cell: `cell`, `model`, `approach`, `subject` (the scheme, or its family where the
        number of positions varies), `held` (the levels of the other factors, as a text) and `x`,
        the factor as in the tables; NaN where the approach does not use it.
    """
    import pandas as pd

    parts = [pd.DataFrame(columns=["cell", "model", "approach", "subject", "held", "x"])]
    usual = study.noise.settings
    table = pd.DataFrame([cell.labels for cell in study.cells])
    uses_robot = np.array([cell.conditions.uses_angles for cell in study.cells])
    table = table.assign(
        robot_sigma_mgon=table["robot_sigma_mgon"].where(uses_robot).round(9),
        n_positions=[cell.positions.n_positions for cell in study.cells],
        subject=table["scheme"].map(family) if factor is POSITIONS else table["scheme"],
    )
    for _, rows in table.groupby(["model", "subject"], sort=False):
        held = []
        for other in NOISES:
            counts = rows.groupby(other.column)[factor.column].nunique()
            if other is factor or counts.empty:  # the robot's noise, where there is no robot
                continue
            best = counts.index[counts == counts.max()].to_numpy()
            level = best[np.abs(best - usual[other.column]).argmin()]
            rows = rows[(rows[other.column] == level) | rows[other.column].isna()]
            if level or len(counts) > 1:
                among = f" (one of {len(counts)})" if len(counts) > 1 else ""
                held.append(f"{other.title} {other.shown(level):.4g} {other.shown_unit}{among}")
        if len(set(rows[factor.column].dropna())) > 1:
            parts.append(rows.assign(x=rows[factor.column], held="\n".join(held)))
    return pd.concat(parts, ignore_index=True)


def _may_vary(study: Study, factor: Factor) -> bool:
    """Whether grids name several levels of a factor, which most studies do not: this is quick."""
    if factor is POSITIONS:  # that all schemes have some of one family does not count
        named = [[scheme.name for scheme in grid.schemes] for grid in study.grids]
        chosen = [names for names in named if names != [*scheme_names()]]
        return any(len(names) > len({*map(family, names)}) for names in chosen)
    values = [getattr(grid, factor.column) for grid in study.grids]
    listed = {value for each in values if each is not None for value in each}
    return len(listed) + (None in values) > 1


def family(scheme: str) -> str:
    """Return the name of a scheme without its number: "fibonacci" of "fibonacci-24"."""
    return re.sub(r"-\d+", "", scheme, count=1)
