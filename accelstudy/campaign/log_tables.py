"""Tables of any columns, CSV or Parquet, read and written a chunk of rows at a time.

What a column is (whole numbers, numbers, text, ...) must not depend on where a chunk ends, so it is
found out before the first chunk is given.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from accelstudy.campaign.log_files import CHUNK, open_parquet
from accelstudy.campaign.wording import one_line
from accelstudy.errors import InputError
from accelstudy.outputs import whole_file


def read_chunks(path: str | Path, chunk_size: int = CHUNK) -> Iterator[pa.Table]:
    """Rows of a CSV or Parquet file, all chunks with the same schema; at least one, maybe empty.

    Parameters
    ----------
    path : file; .parquet, anything else is CSV with a line of names
    chunk_size : int, rows held in memory at a time

    Raises
    ------
    InputError
        If the file is missing or is no whole table.
    """
    path = Path(path)
    return (_parquet_chunks if path.suffix == ".parquet" else _csv_chunks)(path, chunk_size)


@contextmanager
def chunk_writer(path: str | Path) -> Iterator[Callable[[pa.Table], None]]:
    """Write tables of one schema into one file, which is whole or not there.

    Parameters
    ----------
    path : file to write; .parquet, anything else is CSV
    """
    path = Path(path)
    try:
        with whole_file(path) as temporary:
            if path.suffix == ".parquet":
                with _parquet_writer(temporary) as write:
                    yield write
            else:
                with temporary.open("w", encoding="utf-8", newline="") as file:

                    def write(table: pa.Table) -> None:
                        _as_text(table).to_csv(file, index=False, header=not file.tell())

                    yield write
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


# --- CSV -----------------------------------------------------------------------------------------


def _csv_chunks(path: Path, chunk_size: int) -> Iterator[pa.Table]:
    schema = _csv_schema(path, chunk_size)
    # pandas' own type of text keeps an empty cell apart, which str(...) would make "nan".
    kinds = {f.name: "str" if f.type == pa.string() else f.type.to_pandas_dtype() for f in schema}
    for chunk in _csv_frames(path, chunk_size, dtype=kinds):
        table = pa.Table.from_pandas(chunk, schema=schema, preserve_index=False)
        yield table.replace_schema_metadata(None)


def _csv_schema(path: Path, chunk_size: int) -> pa.Schema:
    """Types that hold the columns as a whole, each chunk of which may look like another."""
    found: dict[str, set[np.dtype[Any]]] = {}
    for chunk in _csv_frames(path, chunk_size):
        for name in chunk:
            column = chunk[name]
            numeric = pd.api.types.is_bool_dtype(column) or pd.api.types.is_numeric_dtype(column)
            kind = np.dtype(str(column.dtype)) if numeric and len(column) else np.dtype(object)
            found.setdefault(str(name), set()).add(kind)
    return pa.schema([(name, _common(kinds)) for name, kinds in found.items()])


def _common(kinds: set[np.dtype[Any]]) -> pa.DataType:
    if kinds == {np.dtype(bool)}:
        return pa.bool_()
    # Numbers beyond int64 are text here, as beside others they would lose digits.
    if all(kind.kind in "if" for kind in kinds):
        return pa.from_numpy_dtype(np.result_type(*kinds))
    return pa.string()


def _csv_frames(path: Path, chunk_size: int, **options: Any) -> Iterator[pd.DataFrame]:
    try:
        with pd.read_csv(path, chunksize=chunk_size, low_memory=False, **options) as reader:
            for chunk in reader:
                if not isinstance(chunk.index, pd.RangeIndex):
                    # pandas would take the first value for a label and shift the others.
                    raise InputError(f"{path}: lines have more values than there are names")
                yield chunk
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from None
    except InputError:
        raise
    except (ValueError, pd.errors.ParserError) as error:
        raise InputError(f"{path}: no CSV table: {one_line(error)}") from None


def _as_text(table: pa.Table) -> pd.DataFrame:
    """Frame whose text does not depend on what else is in the chunk."""
    for i, field in enumerate(table.schema):
        if pa.types.is_timestamp(field.type):
            # pandas would show as many digits as the chunk needs.
            table = table.set_column(i, field.name, table.column(i).cast(pa.string()))
    return table.to_pandas(types_mapper=_NULLABLE.get)


# A whole number beside an empty cell would become 1.0, though only in chunks with such a cell.
_NULLABLE = {
    pa.from_numpy_dtype(np.dtype(name.lower())): pd.api.types.pandas_dtype(name)
    for name in ("Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64")
}


# --- Parquet -------------------------------------------------------------------------------------


def _parquet_chunks(path: Path, chunk_size: int) -> Iterator[pa.Table]:
    try:
        with open_parquet(path) as file:
            # What pandas keeps beside the columns, the labels of its rows, is none of the log.
            schema = file.schema_arrow.remove_metadata()
            names = [name for name in schema.names if not name.startswith("__index_level_")]
            if twice := next((name for name in names if names.count(name) > 1), None):
                raise InputError(f"{path}: {twice!r}: the column stands twice")
            yield schema.empty_table().select(names)
            for batch in file.iter_batches(chunk_size, columns=names):
                yield pa.Table.from_batches([batch]).replace_schema_metadata(None)
    except OSError as error:
        raise InputError(f"{path}: {one_line(error.strerror or error)}") from None
    except pa.ArrowException as error:
        raise InputError(f"{path}: not a whole Parquet file ({one_line(error)})") from None


@contextmanager
def _parquet_writer(path: Path) -> Iterator[Callable[[pa.Table], None]]:
    writer: pq.ParquetWriter | None = None

    def write(table: pa.Table) -> None:
        nonlocal writer
        if writer is None:
            writer = pq.ParquetWriter(path, table.schema)
        writer.write_table(table)

    try:
        yield write
    finally:
        if writer is not None:
            writer.close()
