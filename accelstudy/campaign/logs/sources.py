"""Files of numbers in columns: text, MATLAB and Parquet, read a chunk of rows at a time."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.io import loadmat, whosmat

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.logs.text_files import GZIP, TextSource, since
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.reading import readable

__all__ = ["CHUNK", "MatlabSource", "ParquetSource", "Source", "TextSource", "open_source"]

Array = NDArray[np.float64]

CHUNK = 65536
"""Rows that are held in memory at a time."""

_BUFFER = 2**20  # bytes of a Parquet column
_IS_NUMBER = re.compile("double|single|u?int[0-9]+")  # classes of MATLAB arrays


class Source(Protocol):
    """A file of numbers in columns.

    Attributes
    ----------
    path : Path
    names : list of str, of the columns; their places, counted from 0, where the file has no names
    named : bool, whether the file has names
    """

    path: Path
    names: list[str]
    named: bool

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Iterator[Array]:
        """Rows of the columns at `places`, (k, len(places)), k > 0; NaN where there is no number.

        The column at the place `clock` counts from its first value, since a time in ns since 1970
        has more digits than a float.
        """
        ...

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Describe where a row is in the file, and what its cell in a column says."""
        ...


def open_source(path: str | Path, variable: str | None = None) -> Source:
    """Open a file of numbers, by its ending and its first bytes."""
    path = Path(path)
    with readable(path), path.open("rb") as file:
        start = file.read(128)
    if not start:
        raise InputError(f"{path}: the file is empty")
    if path.suffix.lower() in (".parquet", ".pq"):
        return ParquetSource(path)
    if start.startswith(GZIP):
        kind = Path(path.stem).suffix.lower()
        if kind in (".parquet", ".pq", ".mat"):
            raise InputError(f"{path}: unpack it first; only text is read from gzip")
        return TextSource(path)
    # An ASCII .mat has no zero bytes; every binary one has some in its header.
    if path.suffix.lower() == ".mat" and 0 in start:
        return MatlabSource(path, variable)
    if start.startswith(b"\x89HDF"):
        raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7")
    return TextSource(path)


class MatlabSource:
    """An array of a MATLAB file; it is read as a whole, since the format allows 2 GB at most."""

    def __init__(self, path: Path, variable: str | None = None) -> None:
        self.path = path
        try:
            with readable(path):
                self.values = _matlab_array(path, variable)
        except InputError:
            raise
        except NotImplementedError:
            raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7") from None
        except MemoryError:
            raise InputError(
                f"{path}: too large, as a MATLAB file is held in memory; save it as text or Parquet"
            ) from None
        except Exception as error:  # SciPy's reader fails in many ways on a damaged file
            raise InputError(f"{path}: not a whole MATLAB file ({one_line(error)})") from None
        self.names = [str(i) for i in range(self.values.shape[1])]
        self.named = False

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Iterator[Array]:
        """Rows of some columns; see `Source`."""
        origins = [self.values[0, place] if place == clock else None for place in places]
        for first in range(0, len(self.values), chunk_size):
            rows = self.values[first : first + chunk_size]
            yield np.column_stack(
                [since(rows[:, place], zero) for place, zero in zip(places, origins, strict=True)]
            )

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        return f"row {row + 1}", f"{self.values[row, place]:g}"


def _matlab_array(path: Path, variable: str | None) -> NDArray[Any]:
    """Array of a MATLAB file, a row per sample."""
    arrays = {
        name: shape
        for name, shape, kind in whosmat(path)
        if _IS_NUMBER.fullmatch(kind) and len(shape) == 2 and all(shape)
    }
    if variable is not None and variable not in arrays:
        raise UnknownNameError(f"array of {path}", variable, arrays)
    if variable is None and len(arrays) != 1:
        raise InputError(f"{path}: which array? There are {', '.join(arrays) or 'none'}")
    name = next(iter(arrays)) if variable is None else variable
    array = loadmat(path, variable_names=[name])[name]
    if np.iscomplexobj(array):
        raise InputError(f"{path}: array {name} has complex numbers")
    # An array with few rows and many columns has the samples in its columns.
    return array.T if array.shape[0] < array.shape[1] else array


def open_parquet(path: Path) -> AbstractContextManager[pq.ParquetFile]:
    """Open a file to be read page by page, since one group of rows may be the whole file."""
    return whole_parquet(path, pre_buffer=False, buffer_size=_BUFFER)


class ParquetSource:
    """Columns of a Parquet file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with open_parquet(path) as file:
            schema = file.schema_arrow
        self._columns, self._types = schema.names, schema.types
        self.names = [" ".join(name.split()) for name in schema.names]
        self.named = True

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Iterator[Array]:
        """Rows of some columns; see `Source`."""
        for place in places:
            kind = self._types[place]
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
                raise InputError(f"{self.path}: column {self.names[place]} is {kind}, not numbers")
            if self._columns.count(self._columns[place]) > 1:
                raise InputError(f"{self.path}: there are several columns {self.names[place]!r}")
        names = [self._columns[place] for place in places]
        with open_parquet(self.path) as file:
            origins: list[Any] = []
            for batch in file.iter_batches(chunk_size, columns=names):
                if not len(batch):
                    continue
                columns = [_numbers(batch.column(name)) for name in names]
                origins = origins or [
                    column[0] if place == clock else None
                    for column, place in zip(columns, places, strict=True)
                ]
                yield np.column_stack([since(*c) for c in zip(columns, origins, strict=True)])

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        for chunk in self.read([place], CHUNK):
            if row < len(chunk):
                return f"row {row + 1}", f"{chunk[row, 0]:g}"
            row -= len(chunk)
        return f"row {row + 1}", "nothing"


def _numbers(column: pa.Array) -> NDArray[Any]:
    """Numbers of a column, NaN where there is none; whole numbers stay integers."""
    if column.null_count or not pa.types.is_integer(column.type):
        column = column.cast(pa.float64(), safe=False)
    return column.to_numpy(zero_copy_only=False)
