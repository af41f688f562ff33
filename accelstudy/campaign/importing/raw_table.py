"""The raw table of a log: the columns of a file as they stand there, and their numbers."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError, printable
from accelstudy.basics.wording import one_line
from accelstudy.files.reading import readable

_NUMBER = r"^[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE]([+]?[0-9]{1,2}|-[0-2]?[0-9]{1,2}))?$"
_SAMPLED_CELLS = 1000
"""Cells of a column among which the first that is not empty tells whether it has dates."""
_CLOCK = r"\d{1,2}:\d\d(:\d\d([.,:]\d+)?)?"
_ISO = r"\d{4}-?\d\d-?\d\d[T ]\d\d(:?\d\d.*)?"
_US_DAY = re.compile(r"\d{1,2}/\d{1,2}/\d{4}\b.*")
_DAY = r"(\d{4}(?P<of>[-/.])\d{1,2}(?P=of)\d{1,2}|\d{1,2}\.\d{1,2}\.\d{4})"
_STAMP = re.compile(rf"\s*({_ISO}|{_DAY}[T ]+{_CLOCK}|{_CLOCK})\s*")
"""The order of day and month is plain in 31.1.2024, but not in 3/1/2024."""
_AS_ISO = (
    (r"(:\d\d:\d\d)[,:](\d+)$", r"\1.\2"),  # "12:30:05:500", as LabVIEW and others write it
    (r"^(\d{1,2})\.(\d{1,2})\.(\d{4})", r"\3-\2-\1"),
    (r"^(\d{1,2}:)", r"1970-01-01 \1"),
    (r"[T ]+(\d):", r" 0\1:"),
)


@dataclass(frozen=True, eq=False)
class RawTable:
    """The raw table of a log, whatever file it was read from.

    Attributes
    ----------
    path : Path of its file, or what messages call it
    content : Table, its columns as they were read
    layout : mapping, what the format says of the keys of `LogLayout`
    notes : sequence of str, how the file was read
    warnings : sequence of str, what of the file could not be read
    named : bool, whether its columns have names, and not only places
    frame : DataFrame, the table in memory, as it was given; None of a file
    """

    path: Path
    content: pa.Table
    layout: Mapping[str, Any] = field(default_factory=dict)
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    named: bool = True
    frame: pd.DataFrame | None = None

    @cached_property
    def names(self) -> list[str]:
        """Names of the columns; their places, counted from 0, where the file has no names."""
        return [printable(" ".join(name.split())) for name in self.content.column_names]

    @property
    def labels(self) -> list[str]:
        """Names of the columns as sentences have them."""
        return self.names if self.named else [f"column {name}" for name in self.names]

    @cached_property
    def dates(self) -> set[int]:
        """Places of columns of dates with times, or of times of a day."""
        columns = enumerate(self.content.columns)
        return {i for i, column in columns if pa.types.is_timestamp(column.type) or _dated(column)}

    @cached_property
    def unclear_dates(self) -> list[str]:
        """Names of columns of dates as 3/1/2024, in which month and day are not told apart."""
        first = (_first_cell(column) for column in self.content.columns)
        return [n for n, cell in zip(self.names, first, strict=True) if _US_DAY.match(cell)]

    def table(self, as_written: bool = False) -> pa.Table:
        """Return the columns by unique names: `column_0` … of a table without names.

        Parameters
        ----------
        as_written : bool, whether cells of a text stay text
        """
        unique = [f"column_{place}" for place in range(len(self.names))]
        if self.named:
            before = [self.names[:place].count(name) for place, name in enumerate(self.names)]
            pairs = zip(self.names, before, strict=True)
            unique = [f"{name}.{n}" if n else name for name, n in pairs]
        content = self.cells() if as_written else self.content
        return content.rename_columns(unique)

    def cells(self) -> pa.Table:
        """Return the columns; those of a text as text."""
        return self.content

    def numbers(self, place: int) -> NDArray[Any]:
        """Numbers of a column, NaN where there is none; whole numbers as integers.

        A time in ns since 1970 has more digits than a float.
        """
        column = self.content.column(place)
        kind = column.type
        if pa.types.is_string(kind) or pa.types.is_large_string(kind):
            cells = pc.utf8_trim_whitespace(column)
            cells = pc.if_else(pc.match_substring_regex(cells, _NUMBER), cells, None)
            column = pc.replace_substring_regex(cells, r"^[+]", "").cast(pa.float64())
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            return np.full(len(column), np.nan)
        if column.null_count:
            column = column.cast(pa.float64(), safe=False)
        return column.to_numpy()

    def nanoseconds(self, place: int) -> NDArray[Any]:
        """Dates with times as ns since 1970, of a time of day since midnight; NaN without one.

        One without a zone is in UTC, so that all of a column go together. Years that do not fit
        into ns (before 1678 and after 2261) are no dates of a log.
        """
        column = self.content.column(place).to_pandas()
        dates = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
        if dates.isna().any() and not pd.api.types.is_datetime64_any_dtype(column):
            text = column.astype("str").str.strip()
            for pattern, iso in _AS_ISO:
                text = text.str.replace(pattern, iso, regex=True)
            dates = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
        dates = dates.where((dates.dt.year > 1677) & (dates.dt.year < 2262))
        numbers = dates.dt.as_unit("ns").astype("int64").to_numpy()
        return np.where(dates.isna(), np.nan, numbers) if dates.isna().any() else numbers

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Describe where a row is in the file, and what its cell in a column holds."""
        cell = self.content.column(place)[row].as_py()
        shown = str(cell) if isinstance(cell, float | int) else repr(str(cell)[:40])
        return f"row {row + 1}", "nan" if cell is None else shown


def _dated(column: pa.ChunkedArray) -> bool:
    """Whether the first cell that is not empty is a date with a time, or a time of day."""
    return _STAMP.fullmatch(_first_cell(column)) is not None


def _first_cell(column: pa.ChunkedArray) -> str:
    """Return the first cell of a column that is not empty; nothing if there is none."""
    cells = (str(cell) for cell in column.slice(0, _SAMPLED_CELLS).to_pylist() if cell is not None)
    return next(filter(None, cells), "")


@contextmanager
def unless_damaged(path: Path, kind: str) -> Iterator[None]:
    """Turn whatever a library fails with on a damaged file into one line that names it."""
    try:
        with readable(path):
            yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: not a whole {kind} ({one_line(error)})") from None


def choose(path: Path, what: str, names: Collection[str], wanted: str | None) -> str:
    """Return the name that is wanted, or the only one."""
    if wanted is not None and wanted not in names:
        raise UnknownNameError(f"{what} in {path}", wanted, names, "; `variable` chooses one")
    if wanted is None and len(names) != 1:
        if not names:
            raise InputError(f"{path}: no {what}")
        raise InputError(
            f"{path}: which {what}? There are {', '.join(names)}; give `variable` {min(names)}"
        )
    return next(iter(names)) if wanted is None else wanted
