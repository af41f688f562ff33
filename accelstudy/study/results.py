"""Cells simulated into files: their estimates, and tables of what came of them."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.files.tables import parquet_writer, write_table
from accelstudy.study.cell import Cell
from accelstudy.study.replicates import ESTIMATES, Replicates, estimates_table
from accelstudy.study.statistics import CellStatistics, simulated_statistics
from accelstudy.study.tables import TABLES, tables_of

log = logging.getLogger(__name__)


def simulated_tables(
    cells: Sequence[Cell],
    seed: int,
    keep: Callable[[Cell, Replicates], object],
) -> dict[str, pd.DataFrame]:
    """Simulate cells one after the other; return each of `TABLES`.

    Parameters
    ----------
    cells : sequence of Cell
    seed : int, of the study
    keep : function that gets each cell that is estimable with its replicates
    """

    def results() -> Iterator[CellStatistics]:
        for number, cell in enumerate(cells, 1):
            found = simulated_statistics(cell, seed)
            if found.replicates is not None:
                keep(cell, found.replicates)
            failed = found.simulated - found.converged
            said = f"{found.simulated} replicates, {failed} not converged"
            said = cell.estimability.reason or said
            log.info("%d/%d %s: %s", number, len(cells), cell.name, said)
            yield found

    return tables_of(results())


def simulate_cells(
    cells: Sequence[Cell],
    outputs: Mapping[str, str | Path],
    provenance: Mapping[str, Any],
) -> None:
    """Simulate cells, and write their estimates and what came of them.

    Cells that are not estimable leave no estimates; the table of cells says why.

    Parameters
    ----------
    cells : sequence of Cell
    outputs : paths of `estimates` and of each of `TABLES`
    provenance : see `accelstudy.files.tables.origin`; its seed is that of the study
    """
    measured = ("estimate", "linear_estimate", "sigma_priori")
    with parquet_writer(outputs["estimates"], ESTIMATES, provenance, measured) as write:
        tables = simulated_tables(
            cells,
            provenance["seed"],
            lambda cell, replicates: write(estimates_table(cell, replicates)),
        )
    for name in TABLES:
        write_table(outputs[name], tables[name], provenance)
