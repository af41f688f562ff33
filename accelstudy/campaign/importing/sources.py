"""The raw table of a log: its columns as they are in its file, and their numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError, printable
from accelstudy.campaign.importing.columns import layout_by_names

_NUMBER = r"^[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE]([+]?[0-9]{1,2}|-[0-2]?[0-9]{1,2}))?$"
_LONG = 1e15  # from which on a whole number may have more digits than a float
SAMPLED_CELLS = 1000
"""Cells of a column among which the first that is not empty tells whether it has dates."""
_CLOCK = r"\d{1,2}:\d\d(:\d\d([.,:]\d+)?)?"
_ISO = r"\d{4}-?\d\d-?\d\d[T ]\d\d(:?\d\d.*)?"
_DAY = r"(\d{4}(?P<of>[-/.])\d{1,2}(?P=of)\d{1,2}|\d{1,2}\.\d{1,2}\.\d{4})"
_STAMP = re.compile(rf"{_ISO}|{_DAY}[T ]+{_CLOCK}|{_CLOCK}")
"""The order of day and month is plain in 31.1.2024, but not in 3/1/2024."""
_AS_ISO = (
    (r"(:\d\d:\d\d)[,:](\d+)$", r"\1.\2"),  # "12:30:05:500", as LabVIEW and others write it
    (r"^(\d{1,2})\.(\d{1,2})\.(\d{4})", r"\3-\2-\1"),
    (r"^(\d{1,2}:)", r"1970-01-01 \1"),
    (r"[T ]+(\d):", r" 0\1:"),
)


class Source:
    """The raw table of a log, whatever file it was read from.

    Parameters
    ----------
    path : its file, or what messages call it
    table : Table; of a text its cells, which are read as numbers where numbers are asked for
    layout : mapping, what the format says of the keys of `LogLayout`; else, what the names say
    notes : sequence of str, how the file was read
    warnings : sequence of str, what of the file could not be read
    named : bool, whether its columns have names, and not only places
    locate : function that says where a row is in a text, and what its cell in a column holds

    Attributes
    ----------
    names : list of str, of the columns; their places, counted from 0, where the file has no names
    dates : set of int, places of columns of dates with times, of which the numbers are in ns
    table : Table, by unique names: `column_0` … of a table without names
    """

    def __init__(
        self,
        path: str | Path,
        table: pa.Table,
        layout: Mapping[str, Any] | None = None,
        *,
        notes: Sequence[str] = (),
        warnings: Sequence[str] = (),
        named: bool = True,
        locate: Callable[[int, int], tuple[str, str]] | None = None,
    ) -> None:
        self.path, self.notes, self.warnings, self.named = Path(path), notes, warnings, named
        self.names = [printable(" ".join(name.split())) for name in table.column_names]
        self.layout = layout_by_names(self.names) if layout is None else layout
        self._locate, unique = locate, [f"column_{place}" for place in range(len(self.names))]
        if named:
            before = [self.names[:place].count(name) for place, name in enumerate(self.names)]
            unique = [
                f"{name}.{n}" if n else name for name, n in zip(self.names, before, strict=True)
            ]
        self.table = table.rename_columns(unique)
        self.dates = {
            i
            for i, kind in enumerate(table.schema.types)
            if pa.types.is_timestamp(kind) or is_stamp(_first_cell(table.column(i)))
        }

    def __str__(self) -> str:
        return str(self.path)

    def typed_table(self) -> pa.Table:
        """Return the table in which columns that hold only numbers have them as such."""
        if self._locate is None:
            return self.table
        return pa.table([*map(_typed, self.table.columns)], names=self.table.column_names)

    def numbers(self, place: int) -> NDArray[Any]:
        """Numbers of a column, NaN where there is none; dates and other whole numbers as integers.

        A time in ns since 1970 has more digits than a float.
        """
        column = self.table.column(place)
        if place in self.dates:
            return _nanoseconds(column.to_pandas())
        if self._locate is not None:
            column = _typed(column, exact=False)
            if pa.types.is_string(column.type):
                cells = pc.utf8_trim_whitespace(column)
                cells = pc.if_else(pc.match_substring_regex(cells, _NUMBER), cells, None)
                column = pc.replace_substring_regex(cells, r"^[+]", "").cast(pa.float64())
        kind = column.type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise InputError(f"{self.path}: column {self.names[place]} is {kind}, not numbers")
        if column.null_count:
            column = column.cast(pa.float64(), safe=False)
        return column.to_numpy()

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Describe where a row is in the file, and what its cell in a column holds."""
        if self._locate is not None:
            return self._locate(row, place)
        value = self.numbers(place)[row] * (1e-9 if place in self.dates else 1)
        return f"row {row + 1}", f"{value:g}"


LogFile = str | Path | Source
"""Where a log is: the path of a file, or a table in memory."""


def chosen_of(path: Path, what: str, found: Collection[str], wanted: str | None) -> str:
    """The one that is wanted, or the only one."""
    if wanted is not None and wanted not in found:
        raise UnknownNameError(f"{what} in {path}", wanted, found)
    if wanted is None and len(found) != 1:
        if not found:
            raise InputError(f"{path}: no {what}")
        raise InputError(
            f"{path}: which {what}? There are {', '.join(found)}; give `variable` {min(found)}"
        )
    return next(iter(found)) if wanted is None else wanted


def is_stamp(text: str) -> bool:
    """Whether a text is a date with a time, or a time of day, that the numbers of a table tell."""
    return _STAMP.fullmatch(text.strip()) is not None


def _first_cell(column: pa.ChunkedArray) -> str:
    """First cell of a column that is not empty, as text."""
    firsts = (str(cell) for cell in column.slice(0, SAMPLED_CELLS).to_pylist() if cell is not None)
    return next(filter(None, firsts), "")


def _typed(cells: pa.ChunkedArray, exact: bool = True) -> pa.ChunkedArray:
    """Cells of a text as numbers, empty ones as null, if all are; else as they are.

    An exact number loses no digit.
    """
    for fills, kind in product((False, True), (pa.int64(), pa.float64())):
        with suppress(pa.ArrowInvalid):
            filled = pc.if_else(pc.equal(cells, ""), None, cells) if fills else cells
            numbers = filled.cast(kind)
            many = r"^\s*[+-]?[0-9]{16,}\s*$"
            long = (
                exact
                and kind == pa.float64()
                and pc.any(pc.greater_equal(pc.abs(numbers), _LONG)).as_py()
            )
            lost = long and pc.any(pc.match_substring_regex(cells, many)).as_py()
            return cells if lost else numbers
    return cells


def _nanoseconds(column: pd.Series) -> NDArray[Any]:
    """Dates with times as ns since 1970, NaN where there is none; of a time of day, since midnight.

    One without a zone is in UTC, so that all of a column go together. Years that do not fit into
    ns (before 1678 and after 2261) are no dates of a log.
    """
    dates = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
    if dates.isna().any() and not pd.api.types.is_datetime64_any_dtype(column):
        text = column.astype("str").str.strip()
        for pattern, iso in _AS_ISO:
            text = text.str.replace(pattern, iso, regex=True)
        dates = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    dates = dates.where((dates.dt.year > 1677) & (dates.dt.year < 2262))
    numbers = dates.dt.as_unit("ns").astype("int64").to_numpy()
    return np.where(dates.isna(), np.nan, numbers) if dates.isna().any() else numbers
