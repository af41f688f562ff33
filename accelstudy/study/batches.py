"""How the jobs of a study share its cells; no number depends on it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from accelstudy.simulation.sessions import BLOCK
from accelstudy.study.cell import CHUNK, Cell

LEAST_PER_JOB = 400_000
"""Calibrations in one job: seconds of compiled code, as starting Python takes seconds too."""
JOB_GROWTH = 100
"""A large study of N calibrations has jobs of 100 √N or somewhat more, and so about √N / 100 of
them: some tens for 10⁸, some thousands for 10¹¹."""
CELLS_PER_BATCH = 100
"""Most cells in one job, even with few replicates, so that small studies use all cores."""


@dataclass(frozen=True)
class Share:
    """Part of a cell that a job simulates: `count` chunks from the chunk `first` on."""

    cell: Cell
    first: int
    count: int

    def to_dict(self) -> dict[str, Any]:
        """Plain data, from which `from_dict` makes the share again."""
        return {"cell": self.cell.to_dict(), "first": self.first, "count": self.count}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Share:
        """Make a share of plain data."""
        return cls(Cell.from_dict(data["cell"]), data["first"], data["count"])


@dataclass(frozen=True)
class Batch:
    """Cells that are summarised together.

    Attributes
    ----------
    cells : tuple of Cell
    jobs : tuple of tuples of Share
        Shares of each job. One job has all cells; only a cell that is too large for one job is
        shared by several.
    """

    cells: tuple[Cell, ...]
    jobs: tuple[tuple[Share, ...], ...]


def job_size(cells: Iterable[Cell]) -> int:
    """Calibrations in one job: a power of two, so that a few more cells do not change all jobs."""
    wanted = JOB_GROWTH * math.isqrt(sum(cell.replicates for cell in cells))
    size = LEAST_PER_JOB
    while size < wanted:
        size *= 2
    return size


def batches(cells: Sequence[Cell], size: int | None = None) -> list[Batch]:
    """Divide cells into batches, in order, with jobs of at most `size` calibrations (or one chunk).

    Parameters
    ----------
    cells : sequence of Cell
    size : int, optional
        By default `job_size`.
    """
    size = size or job_size(cells)
    groups: list[list[Cell]] = []
    room = 0
    for cell in cells:
        if not groups or cell.replicates > room or len(groups[-1]) == CELLS_PER_BATCH:
            groups.append([])
            room = size
        groups[-1].append(cell)
        room -= cell.replicates
    return [Batch(tuple(group), tuple(_jobs(group, size))) for group in groups]


def _jobs(cells: list[Cell], size: int) -> Iterable[tuple[Share, ...]]:
    whole = [cell.n_chunks for cell in cells]
    at_once = max(1, size // (CHUNK * BLOCK))
    if len(cells) > 1 or whole[0] <= at_once:
        yield tuple(Share(cell, 0, n) for cell, n in zip(cells, whole, strict=True))
        return
    jobs = -(-whole[0] // at_once)
    ends = [whole[0] * i // jobs for i in range(jobs + 1)]
    for first, end in pairwise(ends):
        yield (Share(cells[0], first, end - first),)
