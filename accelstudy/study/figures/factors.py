"""The factors that vary over the cells of a study, and the levels at which others are held."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import MGON, display_unit, to_display, unit_label
from accelstudy.schemes import scheme_names

if TYPE_CHECKING:
    import pandas as pd

    from accelstudy.study.config import Study


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


NOISES = (
    Factor("sensor-noise", "sensor_sigma_mps2", "sensor noise", "$\\sigma_f$", 1.0, "m/s^2"),
    Factor("robot-noise", "robot_sigma_mgon", "robot noise", "$\\sigma_r$", MGON, "rad"),
    Factor("gravity-noise", "gravity_sigma_mps2", "sd of gravity", "$\\sigma_g$", 1.0, "m/s^2"),
    Factor("gravity-error", "gravity_error_mps2", "error of gravity", "", 1.0, "m/s^2"),
)
POSITIONS = Factor("positions", "n_positions", "number of positions", "$n$")
FACTORS = (*NOISES, POSITIONS)


@dataclass(frozen=True)
class Level:
    """The value at which a block holds a factor, of those that the study has.

    Attributes
    ----------
    value : float, as in the tables
    others : tuple of float, the other values of the study
    usual : bool, whether it is the study's default; else it is the middle value
    """

    value: float
    others: tuple[float, ...] = ()
    usual: bool = True


@dataclass(frozen=True)
class Block:
    """Cells that differ in one factor, and in model, scheme and approach.

    Attributes
    ----------
    levels : dict of column to `Level`, of all other factors
    cells : DataFrame, one row per cell, with `x` (as in the tables) and `subject` (its scheme, or
        its family of schemes where the number of positions varies)
    """

    levels: dict[str, Level]
    cells: pd.DataFrame = field(repr=False)

    @property
    def series_of_cells(self) -> list[tuple[str, str]]:
        """Model and subject of each cell; each pair is a line."""
        return list(zip(self.cells["model"], self.cells["subject"], strict=True))

    @property
    def series(self) -> list[tuple[str, str]]:
        """All different series, in order."""
        return list(dict.fromkeys(self.series_of_cells))


def cell_table(study: Study) -> pd.DataFrame:
    """One row per cell of a study; the robot's noise is NaN where no robot is used."""
    import pandas as pd  # slow, and not needed by studies that vary nothing

    table = pd.DataFrame([cell.labels for cell in study.cells])
    uses_robot = np.array([cell.conditions.uses_angles for cell in study.cells])
    robot = table["robot_sigma_mgon"].where(uses_robot)
    return table.assign(
        robot_sigma_mgon=robot.round(9),
        family=table["scheme"].map(family),
        n_positions=[cell.positions.n_positions for cell in study.cells],
    )


def varies(study: Study, factor: Factor) -> bool:
    """Whether a study has cells that differ in one factor alone."""
    return bool(blocks(study, factor))


def blocks(study: Study, factor: Factor) -> list[Block]:
    """Cells over one factor, in blocks that hold all others at the same levels.

    For each model and scheme, another factor is held at the study's default. If this factor does
    not vary at the default, the middle level is taken (of an even number the lower middle one).
    """
    if not (_names_sizes(study) if factor is POSITIONS else _lists_values(study, factor)):
        return []
    import pandas as pd

    table = cell_table(study)
    by = "family" if factor is POSITIONS else "scheme"
    usual = {
        "sensor_sigma_mps2": study.sigma_force,
        "robot_sigma_mgon": study.noise.robot.sigma_mgon,
        "gravity_sigma_mps2": study.noise.gravity.sigma_mps2,
        "gravity_error_mps2": study.noise.gravity.error_mps2,
    }
    parts_of: dict[tuple[tuple[str, Level], ...], list[pd.DataFrame]] = {}
    for (_, subject), rows in table.groupby(["model", by], sort=False):
        if not _several(rows[factor.column]):
            continue
        levels: dict[str, Level] = {}
        for other in NOISES:
            if other is not factor:
                rows = _hold(rows, other, factor, usual[other.column], levels)
        if _several(rows[factor.column]):
            rows = rows.assign(x=rows[factor.column], subject=str(subject))
            parts_of.setdefault(tuple(levels.items()), []).append(rows)
    return [Block(dict(levels), pd.concat(parts)) for levels, parts in parts_of.items()]


def _lists_values(study: Study, factor: Factor) -> bool:
    """Whether the grids list different values of a noise setting; quicker than all cells."""
    values = [getattr(grid, factor.column) for grid in study.all_grids]
    listed = {value for each in values if each is not None for value in each}
    return len(listed) + (None in values) > 1


def _names_sizes(study: Study) -> bool:
    """Whether a grid names schemes of one family; `all` does not count."""
    named = [[scheme.name for scheme in grid.schemes] for grid in study.grids]
    return any(
        len(names) > len(set(map(family, names))) for names in named if names != [*scheme_names()]
    )


def family(scheme: str) -> str:
    """Return the name of a scheme without its number: "fibonacci" of "fibonacci-24"."""
    return re.sub(r"-\d+", "", scheme, count=1)


def _several(values: pd.Series) -> bool:
    return len(values.dropna().unique()) > 1


def _hold(
    rows: pd.DataFrame, other: Factor, factor: Factor, usual: float, levels: dict[str, Level]
) -> pd.DataFrame:
    """Rows with `other` at one level, which is added to `levels`."""
    counts = rows.groupby(other.column)[factor.column].nunique()
    if counts.empty:  # no robot
        return rows
    useful = counts.index[counts > 1] if (counts > 1).any() else counts.index
    at = np.isclose(useful, usual, rtol=1e-6, atol=0)
    chosen = float(useful[at][0] if at.any() else useful[(len(useful) - 1) // 2])
    rest = tuple(float(value) for value in counts.index if value != chosen)
    levels[other.column] = Level(chosen, rest, usual=bool(at.any()))
    return rows[(rows[other.column] == chosen) | rows[other.column].isna()]


def factor_note(study: Study, factor: Factor) -> str:
    """Say in a caption what a study holds fixed where it varies a factor."""
    swept = blocks(study, factor)
    held = list(dict.fromkeys(text for block in swept if (text := levels_text(block.levels))))
    return f"Over the {factor.title}, held fixed: " + "; or ".join(held) + "."


def levels_text(levels: Mapping[str, Level]) -> str:
    """Say at which levels a block holds the other factors, and which other levels there are."""
    return ", ".join(
        _level_text(factor, levels[factor.column]) for factor in NOISES if factor.column in levels
    )


def _level_text(factor: Factor, level: Level) -> str:
    def number(value: float) -> str:
        return f"{factor.shown(value):.4g}"

    text = f"{factor.title} {number(level.value)}"
    if level.value or level.others:
        text += f" {unit_label(display_unit(factor.unit))}"
    if not level.others:
        return text
    ran = sorted([level.value, *level.others])
    if len(ran) > 5:
        values = f"{len(ran)} from {number(ran[0])} to {number(ran[-1])}"
    else:
        values = ", ".join(map(number, ran))
    return f"{text} ({'default, ' if level.usual else ''}of {values})"
