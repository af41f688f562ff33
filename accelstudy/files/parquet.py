"""Parquet files with checksums of their pages and of their footer: damaged ones are refused.

Parquet itself has checksums of pages only. A flipped bit in the footer, which holds the schema,
could rename a column. So the digest of the footer stands right before it, where other programs
find nothing that the footer points to, and do not look.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.parquet as pq

from accelstudy.basics.errors import InputError
from accelstudy.files.outputs import whole_file
from accelstudy.files.reading import readable

if TYPE_CHECKING:
    import pandas as pd

_MARK = b"accelstudy:sha256"
_DIGEST = hashlib.sha256().digest_size
_END = 8  # bytes after the footer: its length, and the letters PAR1


@contextmanager
def parquet_file(path: str | Path, schema: pa.Schema, **options: Any) -> Iterator[pq.ParquetWriter]:
    """Open a new file, which is written table by table; `options` are those of Arrow's writer."""
    with pq.ParquetWriter(path, schema, write_page_checksum=True, **options) as writer:
        yield writer
    _seal(Path(path))


def write_parquet(path: str | Path, table: pa.Table, **options: Any) -> None:
    """Write a whole table; `options` are those of Arrow's writer."""
    with parquet_file(path, table.schema, **options) as writer:
        writer.write_table(table)


def write_frame(path: str | Path, frame: pd.DataFrame) -> None:
    """Write a table of pandas without its index, whole or not at all."""
    with whole_file(path) as temporary:
        write_parquet(temporary, pa.Table.from_pandas(frame, preserve_index=False))


def read_parquet(path: str | Path, remedy: str = "", **options: Any) -> pa.Table:
    """Read a whole table; `remedy` and errors as in `whole_parquet`, `options` those of Arrow."""
    with _whole(path, remedy):
        _check_footer(Path(path))
        return pq.read_table(path, partitioning=None, page_checksum_verification=True, **options)


def read_frame(path: str | Path, remedy: str = "", **options: Any) -> pd.DataFrame:
    """Read a whole table of pandas; see `read_parquet`."""
    table = read_parquet(path, remedy, **options)
    with _whole(path, remedy):  # a file without our digest may have odd metadata
        return table.to_pandas()


def read_row_groups(path: str | Path, remedy: str = "") -> Iterator[pa.Table]:
    """Read a table row group by row group; `remedy` and errors as in `whole_parquet`."""
    with whole_parquet(path, remedy) as file:
        for number in range(file.num_row_groups):
            with _whole(path, remedy):
                group = file.read_row_group(number)
            yield group


@contextmanager
def whole_parquet(path: str | Path, remedy: str = "", **options: Any) -> Iterator[pq.ParquetFile]:
    """Open a file whose pages are verified when they are read.

    Parameters
    ----------
    path : path
    remedy : str
        What a person must do if the file is damaged; the end of the message.
    **options
        Those of Arrow's `ParquetFile`.

    Raises
    ------
    InputError
        If the file is missing, is no whole Parquet file, or its footer or a page is not what was
        written.
    """
    with _whole(path, remedy):
        _check_footer(Path(path))
        with pq.ParquetFile(path, page_checksum_verification=True, **options) as file:
            yield file


def _seal(path: Path) -> None:
    """Put the digest of the footer before it."""
    with path.open("r+b") as file:
        start = _footer_start(file)
        footer = file.read()
        file.seek(start)
        file.write(_MARK + hashlib.sha256(footer).digest() + footer)


def _check_footer(path: Path) -> None:
    """Refuse a footer that is not what was written; files of other programs have no digest."""
    with path.open("rb") as file:
        start = _footer_start(file)
        file.seek(max(0, start - len(_MARK) - _DIGEST))
        mark, digest, footer = file.read(len(_MARK)), file.read(_DIGEST), file.read()
    if mark == _MARK and digest != hashlib.sha256(footer).digest():
        raise ValueError("its footer is not what was written")


def _footer_start(file: Any) -> int:
    """Place where the footer begins; the file is left there."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - _END))
    length = int.from_bytes(file.read(4), "little")
    return file.seek(max(0, size - _END - length))


@contextmanager
def _whole(path: str | Path, remedy: str) -> Iterator[None]:
    """Turn Arrow's error on an incomplete file into one line."""
    try:
        with readable(path):
            yield
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, LookupError, OverflowError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:100]
        end = f"; {remedy}" if remedy else ""
        raise InputError(f"{path}: not a whole Parquet file ({reason}){end}") from None
