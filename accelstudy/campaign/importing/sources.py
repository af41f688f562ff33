"""Tables of numbers as they stand in their files, MATLAB or in memory."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError, printable
from accelstudy.basics.wording import one_line
from accelstudy.campaign.importing.names import layout_by_names
from accelstudy.files.reading import readable

_IS_NUMBER = re.compile("double|single|u?int[0-9]+")  # classes of MATLAB arrays
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
    """A table of numbers in memory, as it is in its file.

    Parameters
    ----------
    path : its file, or what messages call it
    table : Table
    layout : mapping, what the format says of the keys of `LogLayout`; else, what the names say
    warnings : sequence of str, what of the file could not be read
    named : bool, whether its columns have names, and not only places

    Attributes
    ----------
    names : list of str, of the columns; their places, counted from 0, where the file has no names
    dates : set of int, places of columns of dates with times, of which the numbers are in ns
    table : Table, by unique names
    """

    warnings: Sequence[str] = ()

    def __init__(
        self,
        path: str | Path,
        table: pa.Table,
        layout: Mapping[str, Any] | None = None,
        warnings: Sequence[str] = (),
        named: bool = True,
    ) -> None:
        self.path, self.warnings, self.named = Path(path), warnings, named
        self.names = [printable(" ".join(name.split())) for name in table.column_names]
        self.layout = layout_by_names(self.names) if layout is None else layout
        self.table = table.rename_columns(self.unique_names)
        self.dates = {
            i
            for i, kind in enumerate(table.schema.types)
            if pa.types.is_timestamp(kind) or (len(table) and is_stamp(str(table.column(i)[0])))
        }

    def __str__(self) -> str:
        return str(self.path)

    @property
    def notes(self) -> Sequence[str]:
        """How the file was read, in lines for people."""
        return ()

    @property
    def unique_names(self) -> list[str]:
        """Names of the columns, all different: `column_0` … of a table without names."""
        if not self.named:
            return [f"column_{place}" for place in range(len(self.names))]
        before = [self.names[:place].count(name) for place, name in enumerate(self.names)]
        return [f"{name}.{n}" if n else name for name, n in zip(self.names, before, strict=True)]

    def typed_table(self) -> pa.Table:
        """The table, with numbers as such; only those of a text are not yet."""
        return self.table

    def columns(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Columns of which only the numbers matter."""
        return [self.table.column(place) for place in places]

    def numbers(self, places: Sequence[int]) -> list[NDArray[Any]]:
        """Numbers of columns, NaN where there is none; dates and other whole numbers as integers.

        A time in ns since 1970 has more digits than a float.
        """
        columns = zip(self.columns(places), places, strict=True)
        numbers = [self._numbers(column, place) for column, place in columns]
        pa.default_memory_pool().release_unused()
        return numbers

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Describe where a row is in the file, and what its cell in a column says."""
        (values,) = self.numbers([place])
        value = values[row] * (1e-9 if place in self.dates else 1)
        return f"row {row + 1}", f"{value:g}"

    def _numbers(self, column: pa.ChunkedArray, place: int) -> NDArray[Any]:
        kind = column.type
        if place in self.dates:
            return _nanoseconds(column.to_pandas())
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise InputError(f"{self.path}: column {self.names[place]} is {kind}, not numbers")
        if column.null_count:
            column = column.cast(pa.float64(), safe=False)
        return column.to_numpy()


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


def open_matlab(path: Path, variable: str | None = None) -> Source:
    """Open a MATLAB file; it is read as a whole, since the format allows 2 GB at most."""
    from scipy.io import loadmat, whosmat

    try:
        with readable(path):
            arrays = {
                name: shape
                for name, shape, kind in whosmat(path)
                if _IS_NUMBER.fullmatch(kind) and len(shape) == 2 and all(shape)
            }
            name = chosen_of(path, "array", arrays, variable)
            array = loadmat(path, variable_names=[name])[name]
    except InputError:
        raise
    except NotImplementedError:
        raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7") from None
    except Exception as error:  # SciPy's reader fails in many ways on a damaged file
        raise InputError(f"{path}: not a whole MATLAB file ({one_line(error)})") from None
    if np.iscomplexobj(array):
        raise InputError(f"{path}: array {name} has complex numbers")
    # An array with few rows and many columns has the samples in its columns.
    columns = array if array.shape[0] < array.shape[1] else array.T
    return Source(path, pa.table({str(i): c for i, c in enumerate(columns)}), named=False)


def is_stamp(text: str) -> bool:
    """Whether a text is a date with a time, or a time of day, that the numbers of a table tell."""
    return _STAMP.fullmatch(text.strip()) is not None


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
