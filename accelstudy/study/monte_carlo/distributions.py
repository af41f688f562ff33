"""Distributions over the calibrations of a cell: exact where they are kept, else from sketches.

Files are read cell by cell, one row group at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.calibration import Block
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.tables import REMEDY
from accelstudy.leveling.error import TiltError
from accelstudy.study.cell import Cell
from accelstudy.study.monte_carlo.followed import TILT, TILTS, CellSketches, Followed, tilts
from accelstudy.study.monte_carlo.sketch import Key, Sketch, merged_sketches
from accelstudy.study.monte_carlo.statistics import Statistics

Array = NDArray[np.float64]

EXACT = 1_000_000
"""Kept calibrations of a cell up to which quantiles are exact. Beyond, they come from sketches. The
error of these is negligible against that of the simulation itself."""


class Distribution(Protocol):
    """A distribution, with quantiles."""

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles, as `numpy.quantile` defines them."""

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""


class Sample:
    """All values, (R,)."""

    def __init__(self, values: Array) -> None:
        self.values = values

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles."""
        return np.quantile(self.values, np.asarray(probabilities, dtype=float))

    def share_below(self, values: ArrayLike) -> Array:
        """Shares that are below given values."""
        at = np.searchsorted(np.sort(self.values), values)
        return np.asarray(at / len(self.values))


def cell_distributions(
    cell: Cell, parts: Mapping[str, Sequence[str | Path]], statistics: Statistics, tilt: TiltError
) -> Mapping[Key, Distribution]:
    """Distributions of the quantities of a cell, and of the tilt error.

    Parameters
    ----------
    cell : Cell
    parts : paths of `estimates` or, where they are not kept, of `sketches`
    statistics : Statistics, with at least one calibration
    tilt : TiltError, about the mean of the kept calibrations
    """
    if "estimates" not in parts:
        return kept_sketches(parts["sketches"], cell)
    if statistics.converged > EXACT:
        sketches = CellSketches(statistics.followed, tilt)
        for block in kept_blocks(parts["estimates"], cell):
            sketches.add(block, statistics.followed.values(block))
        return sketches.by_key
    keys = statistics.followed.sketched(statistics.moments.redundancy)
    angles = [(TILT, name) for name in TILTS]
    values = kept_values(parts["estimates"], cell, statistics.converged, keys, tilt)
    return {key: Sample(column) for key, column in zip([*keys, *angles], values, strict=True)}


def kept_values(
    estimates: Sequence[str | Path],
    cell: Cell,
    count: int,
    keys: Sequence[Key],
    tilt: TiltError | None = None,
) -> Array:
    """Quantities of the kept calibrations of a cell that converged, (k, count), and tilt errors."""
    followed = Followed.of(cell)
    columns = [followed.keys.index(key) for key in keys]
    quantities = np.empty((len(keys) + (0 if tilt is None else len(TILTS)), count))
    end = 0
    for block in kept_blocks(estimates, cell):
        values = followed.values(block)
        start, end = end, end + len(values)
        quantities[: len(keys), start:end] = values[:, columns].T
        if tilt is not None:
            chosen = block.estimates[block.converged][:, : len(tilt.reference)]
            quantities[len(keys) :, start:end] = tilts(tilt, chosen)
    return quantities


def kept_blocks(paths: Iterable[str | Path], cell: Cell) -> Iterator[Block]:
    """Kept replicates of a cell, chunk by chunk.

    Parameters
    ----------
    paths : files of estimates, in order; they may hold other cells too
    cell : Cell

    Returns
    -------
    iterator of Block, whose `correlation_sum`, which is not kept, is NaN

    Raises
    ------
    InputError
        If a file is missing or damaged.
    """
    u = len(cell.parameter_units)
    columns = ["estimate", "sigma_priori", "omega", "redundancy", "iterations", "converged"]
    for rows in _row_groups(paths, cell.name, columns):
        each = {name: rows[name].to_numpy() for name in columns}
        yield Block(
            estimates=each["estimate"].reshape(-1, u),
            sigma_priori=each["sigma_priori"].reshape(-1, u),
            omega=each["omega"][::u],
            redundancy=int(each["redundancy"][0]),
            iterations=each["iterations"][::u],
            converged=each["converged"][::u],
            correlation_sum=np.full((u, u), np.nan),
        )


def kept_sketches(paths: Iterable[str | Path], cell: Cell) -> dict[Key, Sketch]:
    """Sketches of a cell, merged from files of its parts; errors as in `kept_blocks`."""
    return merged_sketches(_row_groups(paths, cell.name, ["quantity", "name", "bucket", "count"]))


def _row_groups(
    paths: Iterable[str | Path], cell: str, columns: Sequence[str]
) -> Iterator[pa.Table]:
    """Row groups of a cell; each row group holds one cell."""
    for path in paths:
        with whole_parquet(path, REMEDY) as file:
            for number in range(file.num_row_groups):
                if _cell_of(file, number) == cell:
                    yield file.read_row_group(number, list(columns))


def _cell_of(file: pq.ParquetFile, number: int) -> str:
    statistics = file.metadata.row_group(number).column(0).statistics
    if statistics is not None and statistics.has_min_max:
        return str(statistics.min)
    return str(file.read_row_group(number, ["cell"])["cell"][0])  # a name too long for statistics
