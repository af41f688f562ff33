"""The estimates that are kept, and the tables of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from accelstudy.basics.errors import InputError
from accelstudy.files.tables import read_table, tables_in

if TYPE_CHECKING:
    import pandas as pd

TABLES = ("cells", "summary", "correlations", "leveling", "quantiles")
"""Tables that each cell contributes to."""


def collect(parts: Sequence[str | Path], cells: Sequence[str]) -> pd.DataFrame:
    """Join the parts of a table, with the rows of each cell in the order of the cells."""
    table = read_table(parts)
    at = table["cell"].astype(str).map({name: i for i, name in enumerate(cells)})
    return table.iloc[at.argsort(kind="stable")].reset_index(drop=True)


def _check_cells(folder: Path) -> None:
    """Check that no cell stands twice: an earlier configuration may have fanned out otherwise."""
    files: dict[str, Path] = {}
    for path in tables_in(folder):
        for cell in read_table(path, columns=["cell"])["cell"].unique():
            if (other := files.setdefault(cell, path)) != path:
                raise InputError(
                    f"{other} and {path} both hold the cell {cell}; delete what is not of your "
                    "study"
                )


def read_estimates(
    path: str | Path | Sequence[str | Path], cells: str | Sequence[str] | None = None
) -> pd.DataFrame:
    """Estimates, with what follows from the stored columns.

    Parameters
    ----------
    path : file, folder of files, or several files
    cells : str or several, optional
        Only these cells.

    Returns
    -------
    DataFrame
        The stored columns, and error, sigma0_squared and sigma_posteriori (NaN without
        redundancy), all in SI.
    """
    names = [cells] if isinstance(cells, str) else cells
    filters = None if names is None else [("cell", "in", list(names))]
    if isinstance(path, str | Path) and Path(path).is_dir():
        _check_cells(Path(path))
    table = read_table(path, filters=filters)
    table["error"] = table["estimate"] - table["truth"]
    table["sigma0_squared"] = table["omega"] / table["redundancy"].where(table["redundancy"] > 0)
    table["sigma_posteriori"] = table["sigma0_squared"] ** 0.5 * table["sigma_priori"]
    return table
