"""Files of numbers in columns: text, MATLAB and Parquet, read a chunk of rows at a time."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Protocol, TextIO

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.io import loadmat, whosmat

from accelstudy.campaign.wording import one_line
from accelstudy.errors import InputError, UnknownNameError

Array = NDArray[np.float64]

CHUNK = 65536
"""Rows that are held in memory at a time."""

_PREVIEW = 65536  # characters of a text from which its layout is told
_BUFFER = 2**20  # bytes of a Parquet column
_COMMENTS = "#%"
_IS_NUMBER = re.compile("double|single|u?int[0-9]+")  # classes of MATLAB arrays
_LAYOUTS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (None, "."), (None, ","))


class Source(Protocol):
    """A file of numbers in columns."""

    path: Path
    names: list[str]

    def read(self, places: Sequence[int], chunk_size: int) -> Iterator[Array]:
        """Rows of the columns at `places`, (k, len(places)), k > 0; NaN where no number stands."""
        ...

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a row stands in the file, and what stands in one of its columns."""
        ...


def open_source(path: str | Path, variable: str | None = None) -> Source:
    """Open a file of numbers, by its ending and its first bytes."""
    path = Path(path)
    try:
        with path.open("rb") as file:
            start = file.read(128)
    except OSError as error:
        raise InputError(f"{path}: {(error.strerror or str(error)).lower()}") from None
    if not start:
        raise InputError(f"{path}: the file is empty")
    if path.suffix.lower() in (".parquet", ".pq"):
        return ParquetSource(path)
    # An ASCII .mat has no zero bytes; every binary one has some in its header.
    if path.suffix.lower() == ".mat" and 0 in start:
        return MatlabSource(path, variable)
    if start.startswith(b"\x89HDF"):
        raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7")
    return TextSource(path)


class TextSource:
    """Numbers in lines of text."""

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._open() as file:
            text = file.read(_PREVIEW)
            more = bool(file.read(1))
        lines = text.split("\n")
        if more and len(lines) == 1:  # it would be read as a whole
            raise InputError(f"{path}: no end of a line in {_PREVIEW} characters; is it text?")
        if more:
            lines.pop()  # it may be cut
        rows = [line for line in lines if _is_row(line)]
        if not rows:
            raise InputError(f"{path}: no line of numbers at the beginning")
        scores = [sum(map(_count_numbers, rows, [lay] * len(rows))) for lay in _LAYOUTS]
        layout = _LAYOUTS[int(np.argmax(scores))]
        self.delimiter: str | None = layout[0]
        self.decimal = layout[1]
        # Most lines are data; what stands before the first line like them is the header.
        widths = [len(_split(row, self.delimiter)) for row in rows]
        usual = max(set(widths), key=lambda width: (widths.count(width), width))
        first = next(
            (
                i
                for i, line in enumerate(lines)
                if _is_row(line)
                and len(_split(line, self.delimiter)) == usual
                and _count_numbers(line, layout) >= max(1, _typical(rows, usual, layout))
            ),
            None,
        )
        if first is None or max(scores) == 0:
            raise InputError(f"{path}: no line of numbers at the beginning")
        self.first, self.width = first, usual
        self.comment = next((c for c in _COMMENTS for line in lines if line.lstrip()[:1] == c), "#")
        self.names = self._header(lines[:first]) or [str(i) for i in range(usual)]

    def read(self, places: Sequence[int], chunk_size: int) -> Iterator[Array]:
        """Rows of some columns; see `Source`."""
        try:
            with (
                self._open() as file,
                pd.read_csv(
                    file,
                    sep=self.delimiter or r"\s+",
                    decimal=self.decimal,
                    header=None,
                    names=range(self.width + 1),
                    index_col=False,
                    skiprows=self.first,
                    comment=self.comment,
                    quoting=csv.QUOTE_NONE,
                    skipinitialspace=True,
                    low_memory=False,
                    on_bad_lines="error",
                    chunksize=chunk_size,
                ) as reader,
            ):
                for chunk in reader:
                    # A cell too many lands in the column after the last.
                    if chunk[self.width].notna().any():
                        raise InputError(f"{self.path}: {self._odd_line()}")
                    yield np.column_stack([_numbers(chunk[place]) for place in places])
        except InputError:
            raise
        except pd.errors.EmptyDataError:
            return
        except pd.errors.ParserError:
            raise InputError(f"{self.path}: {self._odd_line()}") from None

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """See `Source`; reads the file anew, as only an error asks for it."""
        number, line = next(islice(self._rows(), row, None), (0, ""))
        if not number:
            return f"row {row + 1}", "unreadable"
        cells = _split(line.split(self.comment)[0], self.delimiter)
        if place >= len(cells):
            return f"line {number}", "the line ends before it"
        return f"line {number}", repr(cells[place][:40]) if cells[place] else "nothing"

    def _open(self) -> TextIO:
        return self.path.open(encoding="utf-8-sig", errors="replace")

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Lines of data with their numbers, counted from 1."""
        with self._open() as file:
            for number, line in enumerate(file, 1):
                if number > self.first and line.strip() and line.lstrip()[0] != self.comment:
                    yield number, line.rstrip("\n")

    def _odd_line(self) -> str:
        for number, line in self._rows():
            cells = len(_split(line, self.delimiter))
            if cells > self.width:
                return f"line {number}: {cells} columns instead of {self.width}"
        return "some line has too many columns"

    def _header(self, before: Sequence[str]) -> list[str] | None:
        """Names from the last line before the data, which may be a comment."""
        for line in reversed(before):
            if line.strip():
                names = _split(line.strip().lstrip(_COMMENTS).strip(), self.delimiter)
                names = [" ".join(name.strip("\"'").split()) for name in names]
                return names if len(names) == self.width else None
        return None


class MatlabSource:
    """An array of a MATLAB file, which is read as a whole: the format allows 2 GB at most."""

    def __init__(self, path: Path, variable: str | None = None) -> None:
        self.path = path
        try:
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
            # Few rows and many columns are a table that lies on its side.
            self.values = array.T if array.shape[0] < array.shape[1] else array
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

    def read(self, places: Sequence[int], chunk_size: int) -> Iterator[Array]:
        """Rows of some columns; see `Source`."""
        for first in range(0, len(self.values), chunk_size):
            yield self.values[first : first + chunk_size, list(places)].astype(float)

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        return f"row {row + 1}", f"{self.values[row, place]:g}"


def open_parquet(path: Path) -> pq.ParquetFile:
    """Open a file to be read page by page, as a group of rows may be all of it."""
    return pq.ParquetFile(path, pre_buffer=False, buffer_size=_BUFFER)


class ParquetSource:
    """Columns of a Parquet file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            schema = pq.read_schema(path)
        except (pa.ArrowException, OSError) as error:
            raise InputError(f"{path}: not a whole Parquet file ({one_line(error)})") from None
        self._columns, self._types = schema.names, schema.types
        self.names = [" ".join(name.split()) for name in schema.names]

    def read(self, places: Sequence[int], chunk_size: int) -> Iterator[Array]:
        """Rows of some columns; see `Source`."""
        for place in places:
            kind = self._types[place]
            if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
                raise InputError(f"{self.path}: column {self.names[place]} is {kind}, not numbers")
        names = [self._columns[place] for place in places]
        try:
            with open_parquet(self.path) as file:
                for batch in file.iter_batches(chunk_size, columns=names):
                    if len(batch):
                        columns = [batch.column(name) for name in names]
                        yield np.column_stack(
                            [c.cast(pa.float64(), safe=False).to_numpy(False) for c in columns]
                        )
        except (pa.ArrowException, OSError) as error:
            raise InputError(f"{self.path}: not a whole Parquet file ({one_line(error)})") from None

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        for chunk in self.read([place], CHUNK):
            if row < len(chunk):
                return f"row {row + 1}", f"{chunk[row, 0]:g}"
            row -= len(chunk)
        return f"row {row + 1}", "nothing"


def _is_row(line: str) -> bool:
    return bool(line.strip()) and line.lstrip()[0] not in _COMMENTS


def _split(line: str, delimiter: str | None) -> list[str]:
    return [cell.strip() for cell in line.split(delimiter)]


def _count_numbers(line: str, layout: tuple[str | None, str]) -> int:
    delimiter, decimal = layout
    return sum(_is_number(cell, decimal) for cell in _split(line, delimiter))


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == "," and "." in cell:
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in cell  # a number to Python, not to anyone else


def _typical(rows: Iterable[str], width: int, layout: tuple[str | None, str]) -> int:
    """How many numbers most lines of a width hold; text beside them is no harm."""
    counts = [_count_numbers(row, layout) for row in rows if len(_split(row, layout[0])) == width]
    return max(set(counts), key=lambda count: (counts.count(count), count))


def _numbers(column: pd.Series) -> Array:
    """Numbers of a column, NaN where there is none."""
    if pd.api.types.is_bool_dtype(column):
        return np.full(len(column), np.nan)
    return pd.to_numeric(column, errors="coerce").to_numpy(dtype=float, na_value=np.nan)
