"""Cells simulated into files: their estimates, and tables of what came of them."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from accelstudy.files.tables import parquet_writer, write_table
from accelstudy.study.cell import Cell
from accelstudy.study.replicates import ESTIMATES, estimates_table
from accelstudy.study.statistics import CellStatistics, simulated_statistics
from accelstudy.study.summary import tables_of
from accelstudy.study.tables import TABLES

log = logging.getLogger(__name__)


def simulate_cells(
    cells: Iterable[Mapping[str, Any]],
    leveling: Mapping[str, Any],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Simulate cells, and write their estimates and what came of them.

    Cells that are not estimable leave no estimates; the table of cells says why.

    Parameters
    ----------
    cells : plain data of each `Cell`
    leveling : mapping with max_tilt_gon and attitudes
    outputs : paths of `estimates` and of each of `TABLES`
    provenance : see `accelstudy.files.tables.origin`; its seed is that of the study
    """
    simulated = [Cell.from_dict(data) for data in cells]
    measured = ("estimate", "linear_estimate", "sigma_priori")
    with parquet_writer(outputs["estimates"], ESTIMATES, provenance, measured) as write:

        def results() -> Iterator[CellStatistics]:
            for number, cell in enumerate(simulated, 1):
                found = simulated_statistics(cell, provenance["seed"], leveling)
                n, failed = found.simulated, found.simulated - found.converged
                if found.replicates is not None:
                    write(estimates_table(cell, found.replicates))
                said = cell.estimability.reason or f"{n} replicates, {failed} not converged"
                log.info("%d/%d %s: %s", number, len(simulated), cell.name, said)
                yield found

        tables = tables_of(results())
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)
