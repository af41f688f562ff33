"""The estimates that are kept, and the tables of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from accelstudy.files.tables import read_table

if TYPE_CHECKING:
    import pandas as pd

TABLES = ("cells", "summary", "correlations", "leveling", "quantiles")
"""Tables that each batch of cells contributes to."""


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
    table = read_table(path, filters=None if names is None else [("cell", "in", list(names))])
    table["error"] = table["estimate"] - table["truth"]
    table["sigma0_squared"] = table["omega"] / table["redundancy"].where(table["redundancy"] > 0)
    table["sigma_posteriori"] = table["sigma0_squared"] ** 0.5 * table["sigma_priori"]
    return table
