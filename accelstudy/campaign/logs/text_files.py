"""Numbers in lines of text of any layout, perhaps gzipped."""

from __future__ import annotations

import csv
import gzip
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO, TextIO, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.files.reading import readable

Array = NDArray[np.float64]

GZIP = b"\x1f\x8b"
"""First bytes of a gzipped file."""

_PREVIEW = 65536  # characters of a text from which its layout is told
_COMMENTS = "#%"
_LAYOUTS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (None, "."), (None, ","))


class TextSource:
    """Numbers in lines of text.

    Attributes
    ----------
    path : Path
    names : list of str, from the header, or the places of the columns
    named : bool, whether there is a header
    delimiter : str, None for blanks
    decimal : str, mark between units and tenths
    comment : str, with which lines begin that are no data
    quoted : bool, whether numbers stand in quotation marks
    first : int, lines before the data
    width : int, number of columns
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with self._readable(), self._open() as file:
            text = file.read(_PREVIEW)
            more = bool(file.read(1))
        lines = text.split("\n")
        if more and len(lines) == 1:  # it would be read as a whole
            raise InputError(f"{path}: no end of a line in {_PREVIEW} characters; is it text?")
        if more:
            lines.pop()  # it may be cut
        rows = [line for line in lines if _is_row(line)]
        scores = [sum(_count_numbers(row, layout) for row in rows) for layout in _LAYOUTS]
        if not rows or max(scores) == 0:
            raise InputError(f"{path}: no line of numbers at the beginning")
        layout = _LAYOUTS[int(np.argmax(scores))]
        self.delimiter: str | None = layout[0]
        self.decimal = layout[1]
        # Most lines are data; everything before the first such line is the header.
        usual = _most_frequent(len(split_line(row, self.delimiter)) for row in rows)
        alike = [row for row in rows if len(split_line(row, self.delimiter)) == usual]
        # A line may hold text beside its numbers.
        numbers = max(1, _most_frequent(_count_numbers(row, layout) for row in alike))
        first = next(
            (
                i
                for i, line in enumerate(lines)
                if _is_row(line)
                and _count_numbers(line, layout) >= numbers
                and len(split_line(line, self.delimiter)) == usual
            ),
            None,
        )
        if first is None:
            raise InputError(f"{path}: no line of numbers at the beginning")
        self.first, self.width = first, usual
        self.quoted = any('"' in line for line in lines[first:])
        self.comment = next((c for c in _COMMENTS for line in lines if line.lstrip()[:1] == c), "#")
        header = self._header(lines[:first])
        self.named = header is not None
        self.names = header or [str(i) for i in range(usual)]

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Iterator[Array]:
        """Rows of some columns; see `Source`."""
        origins: list[Any] = []
        try:
            with (
                self._readable(),
                self._open(self.first) as file,
                pd.read_csv(
                    file,
                    sep=self.delimiter or r"\s+",
                    decimal=self.decimal,
                    header=None,
                    names=range(self.width + 1),
                    index_col=False,
                    comment=self.comment,
                    quoting=csv.QUOTE_MINIMAL if self.quoted else csv.QUOTE_NONE,
                    skipinitialspace=True,
                    low_memory=False,
                    on_bad_lines="error",
                    chunksize=chunk_size,
                ) as reader,
            ):
                for chunk in _chunks(reader):
                    if not len(chunk):
                        continue
                    # A surplus cell ends up in the column after the last.
                    if chunk[self.width].notna().any():
                        raise InputError(f"{self.path}: {self._odd_line()}")
                    columns = [_numbers(chunk[place]) for place in places]
                    origins = origins or [
                        column[0] if place == clock else None
                        for column, place in zip(columns, places, strict=True)
                    ]
                    yield np.column_stack([since(*c) for c in zip(columns, origins, strict=True)])
        except InputError:
            raise
        except pd.errors.EmptyDataError:
            return
        except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
            if "inside string" in str(error):
                raise InputError(f"{self.path}: a quotation mark opens and never closes") from None
            raise InputError(f"{self.path}: {self._odd_line()}") from None

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """See `Source`; reads the file again, which only errors need."""
        number, line = next(islice(self.rows(), row, None), (0, ""))
        if not number:
            return f"row {row + 1}", "unreadable"
        cells = split_line(line.split(self.comment)[0], self.delimiter)
        if place >= len(cells):
            return f"line {number}", "the line ends before it"
        return f"line {number}", repr(cells[place][:40]) if cells[place] else "nothing"

    def rows(self) -> Iterator[tuple[int, str]]:
        """Lines of data with their numbers, counted from 1."""
        with self._readable(), self._open() as file:
            for number, line in enumerate(file, 1):
                if number > self.first and line.strip() and line.lstrip()[0] != self.comment:
                    yield number, line.rstrip("\n")

    def _open(self, skipped: int = 0) -> TextIO:
        """Open the file and skip some lines; quotation marks in a header have no meaning."""
        with self.path.open("rb") as start:
            packed = start.read(len(GZIP)) == GZIP
        if packed:
            unpacked = cast(BinaryIO, gzip.GzipFile(self.path))
            file: TextIO = TextIOWrapper(unpacked, encoding="utf-8-sig", errors="replace")
        else:
            file = self.path.open(encoding="utf-8-sig", errors="replace")
        for _ in range(skipped):
            file.readline()
        return file

    @contextmanager
    def _readable(self) -> Iterator[None]:
        try:
            with readable(self.path):
                yield
        except (gzip.BadGzipFile, EOFError, zlib.error):
            raise InputError(f"{self.path}: not a whole gzip file") from None

    def _odd_line(self) -> str:
        for number, line in self.rows():
            cells = len(split_line(line, self.delimiter))
            if cells > self.width:
                return f"line {number}: {cells} columns instead of {self.width}"
        return "some line has too many columns"

    def _header(self, before: Sequence[str]) -> list[str] | None:
        """Names from the last line before the data, which may be a comment."""
        for line in reversed(before):
            if line.strip():
                names = split_line(line.strip().lstrip(_COMMENTS).strip(), self.delimiter)
                names = [" ".join(name.strip("\"'").split()) for name in names]
                return names if len(names) == self.width else None
        return None


def since(values: NDArray[Any], zero: Any) -> Array:
    """Numbers as floats, counted from `zero` unless that is None.

    Whole numbers are subtracted as integers: a time in ns since 1970 has more digits than a float.
    """
    if zero is None:
        return values.astype(float)
    if values.dtype.kind in "iu" and isinstance(zero, np.integer):
        return (values.astype(np.int64) - zero.astype(np.int64)).astype(float)
    return values.astype(float) - float(zero)


def _chunks(reader: Iterator[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Yield tables of a reader; raise the warning that pandas gives where it loses cells."""
    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            chunk = next(reader, None)
        if chunk is None:
            return
        yield chunk


def split_line(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line, without surrounding blanks and quotation marks."""
    if '"' in line and delimiter is not None:
        try:
            row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
            return [cell.strip() for cell in row]
        except csv.Error:
            pass
    return [cell.strip() for cell in line.split(delimiter)]


def _is_row(line: str) -> bool:
    return bool(line.strip()) and line.lstrip()[0] not in _COMMENTS


def _count_numbers(line: str, layout: tuple[str | None, str]) -> int:
    delimiter, decimal = layout
    return sum(_is_number(cell, decimal) for cell in split_line(line, delimiter))


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == "," and "." in cell:
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in cell  # a number to Python, not to anyone else


def _most_frequent(counts: Iterator[int]) -> int:
    """Most frequent of some numbers, the largest of equally frequent ones."""
    return max(Counter(counts).items(), key=lambda item: item[::-1])[0]


def _numbers(column: pd.Series) -> NDArray[Any]:
    """Numbers of a column, NaN where there is none; whole numbers stay integers."""
    if pd.api.types.is_bool_dtype(column):
        return np.full(len(column), np.nan)
    numbers = pd.to_numeric(column, errors="coerce")
    if numbers.dtype.kind in "iu":
        return numbers.to_numpy()
    return numbers.to_numpy(dtype=float, na_value=np.nan)
