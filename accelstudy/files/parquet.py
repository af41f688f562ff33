"""Parquet files with checksums of their pages: damaged ones are refused."""

from __future__ import annotations

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


def write_parquet(path: str | Path, table: pa.Table, **options: Any) -> None:
    """Write a whole table; `options` are those of Arrow's writer."""
    pq.write_table(table, path, write_page_checksum=True, **options)


def write_frame(path: str | Path, frame: pd.DataFrame) -> None:
    """Write a table of pandas without its index, whole or not at all."""
    with whole_file(path) as temporary:
        write_parquet(temporary, pa.Table.from_pandas(frame, preserve_index=False))


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
        If the file is missing, is no whole Parquet file, or a page is not what was written.
    """
    with (
        _whole(path, remedy),
        pq.ParquetFile(path, page_checksum_verification=True, **options) as file,
    ):
        yield file


@contextmanager
def _whole(path: str | Path, remedy: str) -> Iterator[None]:
    """Turn Arrow's error on an incomplete file into one line."""
    try:
        with readable(path):
            with Path(path).open("rb") as file:  # Arrow's errors do not say that it is the disk
                file.read(1)
            yield
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, LookupError, OverflowError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:100]
        end = f"; {remedy}" if remedy else ""
        raise InputError(f"{path}: not a whole Parquet file ({reason}){end}") from None
