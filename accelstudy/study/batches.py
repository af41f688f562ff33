"""Batches of cells, each of which a job simulates; no number depends on how cells are shared."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from accelstudy.files.tables import parquet_writer, write_table
from accelstudy.study.cell import Cell
from accelstudy.study.replicates import ESTIMATES, estimates_table
from accelstudy.study.statistics import CellStatistics, simulated_statistics
from accelstudy.study.summary import tables_of
from accelstudy.study.tables import TABLES

log = logging.getLogger(__name__)

REPLICATES_PER_BATCH = 400_000
"""Calibrations of a batch of several cells: seconds, as starting Python takes seconds, too."""
CELLS_PER_BATCH = 100
"""Most cells of a batch, even with few replicates, so that small studies use all cores."""
MEGABYTES, BYTES_PER_ESTIMATE = 1000, 120
"""Memory of a job: at least, and for each estimate of its largest cell."""


def batches(cells: Sequence[Cell], most: int = REPLICATES_PER_BATCH) -> list[list[Cell]]:
    """Divide cells into batches, in order, of at most so many replicates if there are several."""
    groups: list[list[Cell]] = []
    room = 0
    for cell in cells:
        if not groups or cell.replicates > room or len(groups[-1]) == CELLS_PER_BATCH:
            groups.append([])
            room = most
        groups[-1].append(cell)
        room -= cell.replicates
    return groups


def memory(cells: Sequence[Cell]) -> int:
    """Memory that the job of a batch needs, megabytes."""
    estimates = max(cell.replicates * cell.n_unknowns for cell in cells)
    return MEGABYTES + round(BYTES_PER_ESTIMATE * estimates / 1e6)


def simulate_batch(
    spec: Mapping[str, Any], outputs: Mapping[str, str | Path], provenance: Mapping[str, Any]
) -> None:
    """Simulate the cells of a batch, and tabulate what came of them.

    Cells that are not estimable leave no estimates; the table of cells says why.

    Parameters
    ----------
    spec : mapping with `seed`, `cells` (plain data of `Cell`) and `leveling` (max_tilt_gon and
        attitudes)
    outputs : paths of `estimates` and of each of `TABLES`
    provenance : see `accelstudy.files.tables.origin`
    """
    cells = [Cell.from_dict(data) for data in spec["cells"]]
    measured = ("estimate", "linear_estimate", "sigma_priori")
    with parquet_writer(outputs["estimates"], ESTIMATES, provenance, measured) as write:

        def results() -> Iterator[CellStatistics]:
            for number, cell in enumerate(cells, 1):
                found = simulated_statistics(cell, spec["seed"], spec["leveling"])
                n, failed = found.simulated, found.simulated - found.converged
                if found.replicates is not None:
                    write(estimates_table(cell, found.replicates))
                said = cell.estimability.reason or f"{n} replicates, {failed} not converged"
                log.info("%d/%d %s: %s", number, len(cells), cell.name, said)
                yield found

        tables = tables_of(results())
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)
