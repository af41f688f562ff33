"""Kept replicates and sketches, read cell by cell, one row group at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from accelstudy.adjustment.calibration import Block
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.tables import REMEDY
from accelstudy.study.cells.cell import Cell
from accelstudy.study.monte_carlo.sketch import Key, Sketch, merged_sketches


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
