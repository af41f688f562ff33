"""Logs with all their columns unchanged, read and written a chunk of rows at a time.

Cells of text stay text, so that they are written as they were read, and no type depends on where a
chunk ends. Parquet needs types: they are found beforehand, in a pass over the whole text.
"""

from __future__ import annotations

import csv
import gzip
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.importing.sources import (
    CHUNK,
    ArraySource,
    Source,
    TextSource,
    TypedSource,
)
from accelstudy.files.outputs import whole_file
from accelstudy.files.parquet import parquet_file

Array = NDArray[np.float64]

_DECIMAL_COMMA = r"^(\s*[+-]?[0-9]*),([0-9]+([eE][+-]?[0-9]+)?\s*)$"


def read_chunks(source: Source, chunk_size: int = CHUNK, typed: bool = False) -> Iterator[pa.Table]:
    """Rows of a log, all its columns in their order, all chunks with the same schema.

    A row of text with more or fewer cells than the others becomes empty, since nobody knows which
    of its cells are right.

    Parameters
    ----------
    source : Source
    chunk_size : int, rows held in memory at a time
    typed : bool, whether text columns that hold only numbers become numbers; reads the text twice

    Raises
    ------
    InputError
        If the file turns out to be incomplete.
    """
    names = column_names(source)
    if isinstance(source, TextSource):
        read = partial(_text_chunks, source, names, chunk_size)
        return _with_types(read) if typed else read()
    if isinstance(source, TypedSource):
        return _typed_chunks(source, names, chunk_size)
    assert isinstance(source, ArraySource)
    values = source.values
    starts = range(0, len(values), chunk_size)
    return (pa.table(list(values[i : i + chunk_size].T), names=names) for i in starts)


def column_names(source: Source) -> list[str]:
    """Names of the columns, all different: `column_0` … of a log without names."""
    if not source.named:
        return [f"column_{place}" for place in range(len(source.names))]
    names, seen = [], Counter[str]()
    for name in source.names:
        names.append(f"{name}.{seen[name]}" if seen[name] else name)
        seen[name] += 1
    return names


def numbers(column: pa.ChunkedArray) -> Array:
    """Numbers of a column of numbers or of text, NaN where there is none."""
    if not pa.types.is_string(column.type):
        return column.cast(pa.float64(), safe=False).to_numpy()
    try:
        # Arrow reads any number in full precision, but stops at what is none.
        return _cast(column, pa.float64()).to_numpy()
    except pa.ArrowInvalid:
        return pd.to_numeric(column.to_pandas(), errors="coerce").to_numpy(float, na_value=np.nan)


def _holds(column: pa.ChunkedArray, kind: pa.DataType) -> bool:
    """Whether a column of text can be converted to a type without losing digits."""
    try:
        _cast(column, kind)
    except pa.ArrowInvalid:
        return False
    whole = pc.match_substring_regex(column, r"^\s*[+-]?[0-9]{16,}\s*$")
    return pa.types.is_integer(kind) or not pc.any(whole).as_py()


def _cast(column: pa.ChunkedArray, kind: pa.DataType) -> pa.ChunkedArray:
    text = pc.utf8_trim_whitespace(column)
    return pc.if_else(pc.equal(text, ""), None, text).cast(kind)


# --- Reading -------------------------------------------------------------------------------------


def _text_chunks(source: TextSource, names: list[str], chunk_size: int) -> Iterator[pa.Table]:
    schema = pa.schema([(name, pa.string()) for name in names])
    rows = _cells(source)
    while chunk := list(islice(rows, chunk_size)):
        columns = [pa.array(column, pa.string()) for column in zip(*chunk, strict=True)]
        if source.decimal == ",":
            columns = [pc.replace_substring_regex(c, _DECIMAL_COMMA, r"\1.\2") for c in columns]
        yield pa.Table.from_arrays(columns, schema=schema)


def _with_types(read: Callable[[], Iterable[pa.Table]]) -> Iterator[pa.Table]:
    possible: dict[str, list[pa.DataType]] = {}
    for table in read():
        for name in table.column_names:
            kinds = possible.setdefault(name, [pa.int64(), pa.float64()])
            while kinds and not _holds(table[name], kinds[0]):
                kinds.pop(0)
    for table in read():
        columns = zip(table.columns, possible.values(), strict=True)
        typed = [_cast(column, kinds[0]) if kinds else column for column, kinds in columns]
        yield pa.table(typed, names=[*possible])


def _cells(source: TextSource) -> Iterator[Sequence[str | None]]:
    lines = (line for _, line in source.rows())
    if source.delimiter is None:
        rows: Iterable[list[str]] = (line.split() for line in lines)
    else:
        rows = csv.reader(lines, delimiter=source.delimiter, skipinitialspace=True)
    width, none = source.width, [None] * source.width
    try:
        for row in rows:
            if source.least <= len(row) < width:
                row += [""] * (width - len(row))
            yield row[:width] if len(row) >= width and not any(row[width:]) else none
    except csv.Error as error:
        raise InputError(f"{source.path}: no table: {one_line(error)}") from None


def _typed_chunks(source: TypedSource, names: list[str], chunk_size: int) -> Iterator[pa.Table]:
    # The row labels that pandas writes as a column are not part of the log.
    kept = [name for name in names if not name.startswith("__index_level_")]
    for batch in source.batches(chunk_size):
        table = pa.Table.from_batches([batch]).replace_schema_metadata(None)
        yield table.rename_columns(names).select(kept)


# --- Writing -------------------------------------------------------------------------------------


@contextmanager
def chunk_writer(path: str | Path) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema into one file; if that fails, there is no file.

    Parameters
    ----------
    path : file to write; see `is_parquet`, anything else is CSV, packed if it ends in .gz
    """
    path = Path(path)
    try:
        with (
            whole_file(path) as temporary,
            (_parquet_writer if is_parquet(path) else _csv_writer)(temporary) as write,
        ):
            yield write
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def is_parquet(path: str | Path) -> bool:
    """Whether a file is Parquet by its ending."""
    return Path(path).suffix.lower() in (".parquet", ".pq")


@contextmanager
def _csv_writer(path: Path) -> Iterator[Callable[[pa.Table], None]]:
    packed = path.suffix.lower() == ".gz"
    with (gzip.open if packed else open)(path, "wt", encoding="utf-8", newline="") as file:
        empty = True

        def write(table: pa.Table) -> None:
            nonlocal empty
            if empty:
                csv.writer(file, lineterminator="\n").writerow(table.column_names)
            empty = False
            file.write("".join(_lines(table)))

        yield write


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


@contextmanager
def _parquet_writer(path: Path) -> Iterator[Callable[[pa.Table], None]]:
    writer: pq.ParquetWriter | None = None
    with ExitStack() as stack:

        def write(table: pa.Table) -> None:
            nonlocal writer
            if writer is None:
                writer = stack.enter_context(parquet_file(path, table.schema))
            writer.write_table(table)

        yield write
