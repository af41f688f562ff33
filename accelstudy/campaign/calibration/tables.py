"""Output of logs with all their columns; cells of text stay as they were read."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.files.outputs import whole_file
from accelstudy.files.parquet import write_parquet

ROWS = 2**16
"""Rows that are processed together, so that memory does not grow with the table."""


def write_table(path: str | Path, table: pa.Table) -> None:
    """Write a table into a file; if that fails, there is no file.

    Parameters
    ----------
    path : file to write; see `is_parquet`, anything else is CSV, packed if it ends in .gz
    table : Table
    """
    path = Path(path)
    try:
        with whole_file(path) as temporary:
            (write_parquet if is_parquet(path) else _write_csv)(temporary, table)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def is_parquet(path: str | Path) -> bool:
    """Whether a file is Parquet by its ending."""
    return Path(path).suffix.lower() in (".parquet", ".pq")


def _write_csv(path: Path, table: pa.Table) -> None:
    packed = path.suffix.lower() == ".gz"
    with (gzip.open if packed else open)(path, "wt", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerow(table.column_names)
        for first in range(0, len(table), ROWS):
            file.write("".join(_lines(table.slice(first, ROWS))))


def _lines(table: pa.Table) -> list[str]:
    """Lines of CSV, joined column by column, which is ten times as fast as row by row."""
    cells = [_text(name, table[name]) for name in table.column_names]
    lines = pc.binary_join_element_wise(*cells, ",", null_handling="replace", null_replacement="")
    return pc.binary_join_element_wise(lines, "", "\n").to_pylist()


def _text(name: str, column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Column as cells of CSV; null for empty cells and NaN."""
    if pa.types.is_floating(column.type):
        return pc.if_else(pc.is_nan(column), None, column).cast(pa.string())
    try:
        text = column.cast(pa.string())
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise InputError(
            f"column {name!r} is {one_line(column.type)}, which no text holds; write .parquet"
        ) from None
    special = pc.match_substring_regex(text, '[",\r\n]')
    if not pc.any(special).as_py():
        return text
    quoted = pc.binary_join_element_wise("", pc.replace_substring(text, '"', '""'), "", '"')
    return pc.if_else(special, quoted, text)
