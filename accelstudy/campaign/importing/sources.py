"""Files of numbers in columns: text of any layout, MATLAB, Parquet, bags and flight logs."""

from __future__ import annotations

import csv
import gzip
import re
import warnings
import zlib
from collections import Counter
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import AbstractContextManager, contextmanager
from io import TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol, TextIO, cast

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.wording import one_line
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.reading import readable
from accelstudy.sensors.conversion import LARGEST

# Slow to import, so where a file needs it: what calibrates a campaign reads no log.
if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa
    import pyarrow.parquet as pq

Array = NDArray[np.float64]

CHUNK = 65536
"""Rows that are held in memory at a time."""

GZIP = b"\x1f\x8b"
"""First bytes of a gzipped file."""

_PREVIEW = 65536  # characters of a text from which its layout is told
_COMMENTS = "#%"
_LAYOUTS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (None, "."), (None, ","))
_BUFFER = 2**20  # bytes of a Parquet column
_IS_DATE = re.compile(r"\d{4}-?\d\d-?\d\d[T ]\d\d(:?\d\d.*)?")
_OF_ROS = re.compile(r"(.*[._/])?linear[_.]acceleration[._/]x", re.IGNORECASE)
_IS_NUMBER = re.compile("double|single|u?int[0-9]+")  # classes of MATLAB arrays


class Source(Protocol):
    """A file of numbers in columns.

    Attributes
    ----------
    path : Path
    names : list of str, of the columns; their places, counted from 0, where the file has no names
    named : bool, whether the file has names
    dates : set of int, places of columns of dates with times, which `read` gives in s
    layout : mapping, what the format says of the keys of `LogLayout`; empty for a plain table
    """

    path: Path
    names: list[str]
    named: bool
    dates: Set[int]
    layout: Mapping[str, Any]

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Generator[Array, None, None]:
        """Rows of the columns at `places`, (k, len(places)), k > 0; NaN where there is no number.

        The column at the place `clock` counts from its first value, since a time in ns since 1970
        has more digits than a float.
        """
        ...

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Describe where a row is in the file, and what its cell in a column says."""
        ...


def chosen_of(path: Path, what: str, found: Collection[str], wanted: str | None) -> str:
    """The one that is wanted, or the only one."""
    if wanted is not None and wanted not in found:
        raise UnknownNameError(f"{what} in {path}", wanted, found)
    if wanted is None and len(found) != 1:
        if not found:
            raise InputError(f"{path}: no {what}")
        raise InputError(
            f"{path}: which {what}? There are {', '.join(found)}; give --variable {min(found)}"
        )
    return next(iter(found)) if wanted is None else wanted


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
    dates, layout : see `Source`
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
        cells = split_line(lines[first], self.delimiter)
        self.dates: Set[int] = {i for i, cell in enumerate(cells) if _IS_DATE.fullmatch(cell)}
        self.quoted = any('"' in line for line in lines[first:])
        self.comment = next((c for c in _COMMENTS for line in lines if line.lstrip()[:1] == c), "#")
        header = self._header(lines[:first])
        self.named = header is not None
        self.names = header or [str(i) for i in range(usual)]
        self.layout = layout_by_names(self.names)

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Generator[Array, None, None]:
        """Rows of some columns; see `Source`."""
        import pandas as pd

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
                yield from self._rows(_chunks(reader), places, clock)
        except InputError:
            raise
        except pd.errors.EmptyDataError:
            return
        except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
            if "inside string" in str(error):
                raise InputError(f"{self.path}: a quotation mark opens and never closes") from None
            raise InputError(f"{self.path}: {self._odd_line()}") from None

    def _rows(
        self, chunks: Iterable[pd.DataFrame], places: Sequence[int], clock: int | None
    ) -> Iterator[Array]:
        def columns() -> Iterator[list[NDArray[Any]]]:
            for chunk in chunks:
                # A surplus cell ends up in the column after the last.
                if chunk[self.width].notna().any():
                    raise InputError(f"{self.path}: {self._odd_line()}")
                yield [
                    nanoseconds(chunk[place])
                    if place in self.dates
                    else _numbers_of_text(chunk[place])
                    for place in places
                ]

        return rows_of(columns(), places, self.dates, clock)

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


def _chunks(reader: Iterator[pd.DataFrame]) -> Iterator[pd.DataFrame]:
    """Yield tables of a reader; raise the warning that pandas gives where it loses cells."""
    import pandas as pd

    while True:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)
            chunk = next(reader, None)
        if chunk is None:
            return
        yield chunk


def layout_by_names(names: Sequence[str]) -> Mapping[str, Any]:
    """What the names of columns say: those of sensor_msgs/Imu stand for axes in flu (REP 103)."""
    return {"frame": "flu"} if any(map(_OF_ROS.fullmatch, names)) else {}


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


def _numbers_of_text(column: pd.Series) -> NDArray[Any]:
    """Numbers of a column, NaN where there is none; whole numbers stay integers."""
    import pandas as pd

    if pd.api.types.is_bool_dtype(column):
        return np.full(len(column), np.nan)
    numbers = pd.to_numeric(column, errors="coerce")
    if numbers.dtype.kind in "iu":
        return numbers.to_numpy()
    return numbers.to_numpy(dtype=float, na_value=np.nan)


def nanoseconds(column: pd.Series) -> NDArray[Any]:
    """Dates with times as ns since 1970, NaN where there is none.

    One without a zone is in UTC, so that all of a column go together.
    """
    import pandas as pd

    dates = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
    numbers = dates.dt.as_unit("ns").astype("int64").to_numpy()
    return np.where(dates.isna(), np.nan, numbers) if dates.isna().any() else numbers


def rows_of(
    chunks: Iterable[Sequence[NDArray[Any]]],
    places: Sequence[int],
    dates: Set[int],
    clock: int | None,
) -> Generator[Array, None, None]:
    """Columns of each chunk as rows of `Source.read`; dates in ns become s."""
    origins: list[Any] = []
    for columns in chunks:
        if not len(columns[0]):
            continue
        origins = origins or [
            column[0] if place == clock else None
            for column, place in zip(columns, places, strict=True)
        ]
        each = zip(columns, origins, places, strict=True)
        yield beside([since(c, zero) * (1e-9 if i in dates else 1) for c, zero, i in each])


class ArraySource:
    """An array (n, c) in memory, which was read as a whole.

    Attributes
    ----------
    path, names, named, dates, layout : see `Source`
    values : (n, c) array
    """

    dates: Set[int] = frozenset()

    def __init__(
        self,
        path: Path,
        values: NDArray[Any],
        names: Sequence[str] = (),
        layout: Mapping[str, Any] | None = None,
    ) -> None:
        self.path, self.values, self.layout = path, values, layout or {}
        self.named = bool(names)
        self.names = list(names) or [str(i) for i in range(values.shape[1])]

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Generator[Array, None, None]:
        """Rows of some columns; see `Source`."""
        starts = range(0, len(self.values), chunk_size)
        chunks = (self.values[i : i + chunk_size] for i in starts)
        columns = ([rows[:, place] for place in places] for rows in chunks)
        return rows_of(columns, places, self.dates, clock)

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        return f"row {row + 1}", f"{self.values[row, place]:g}"


def open_matlab(path: Path, variable: str | None = None) -> ArraySource:
    """Open a MATLAB file; it is read as a whole, since the format allows 2 GB at most."""
    try:
        with readable(path):
            return ArraySource(path, _matlab_array(path, variable))
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


def _matlab_array(path: Path, variable: str | None) -> NDArray[Any]:
    """Array of a MATLAB file, a row per sample."""
    from scipy.io import loadmat, whosmat

    arrays = {
        name: shape
        for name, shape, kind in whosmat(path)
        if _IS_NUMBER.fullmatch(kind) and len(shape) == 2 and all(shape)
    }
    name = chosen_of(path, "array", arrays, variable)
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
        import pyarrow as pa

        self.path = path
        with open_parquet(path) as file:
            schema = file.schema_arrow
            first = next(file.iter_batches(1), None)
        self._columns, self._types = schema.names, schema.types
        self.names = [" ".join(name.split()) for name in schema.names]
        self.named = True
        self.layout = layout_by_names(self.names)
        self.dates: Set[int] = {
            i
            for i, kind in enumerate(schema.types)
            if pa.types.is_timestamp(kind)
            or (first and _IS_DATE.fullmatch(str(first.column(i)[0])))
        }

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Generator[Array, None, None]:
        """Rows of some columns; see `Source`."""
        import pyarrow as pa

        for place in places:
            kind = self._types[place]
            is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
            if not is_number and place not in self.dates:
                raise InputError(f"{self.path}: column {self.names[place]} is {kind}, not numbers")
            if self._columns.count(self._columns[place]) > 1:
                raise InputError(f"{self.path}: there are several columns {self.names[place]!r}")
        names = [self._columns[place] for place in places]
        with open_parquet(self.path) as file:
            batches = file.iter_batches(chunk_size, columns=names)
            columns = ([_numbers(batch.column(name)) for name in names] for batch in batches)
            yield from rows_of(columns, places, self.dates, clock)

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        for chunk in self.read([place], CHUNK):
            if row < len(chunk):
                return f"row {row + 1}", f"{chunk[row, 0]:g}"
            row -= len(chunk)
        return f"row {row + 1}", "nothing"


def _numbers(column: pa.Array) -> NDArray[Any]:
    """Numbers of a column, dates in ns, NaN where there is none; whole numbers stay integers."""
    import pyarrow as pa

    kind = column.type
    if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        return nanoseconds(column.to_pandas())
    if column.null_count or not pa.types.is_integer(column.type):
        column = column.cast(pa.float64(), safe=False)
    return column.to_numpy(zero_copy_only=False)


def beside(columns: Sequence[Array]) -> Array:
    """Columns (k,) as one array (k, c), each of them contiguous, as sums along them are faster."""
    return np.array(columns).T


def since(values: NDArray[Any], zero: Any) -> Array:
    """Numbers as floats, counted from `zero` unless that is None.

    Whole numbers are subtracted as integers: a time in ns since 1970 has more digits than a float.
    """
    if zero is None:
        return values.astype(float)
    if values.dtype.kind in "iu" and isinstance(zero, np.integer):
        return (values.astype(np.int64) - zero.astype(np.int64)).astype(float)
    return values.astype(float) - float(zero)


def check_numbers(
    source: Source, places: Mapping[str, int], raw: Array, row: int = 0, gaps: Sequence[str] = ()
) -> None:
    """Raise `InputError` at the first value that is no usable number.

    Parameters
    ----------
    source : Source
    places : mapping of key to column, in the order of the columns of `raw`
    raw : (k, len(places)) array
    row : int, number of rows before these
    gaps : sequence of str, columns that may have cells without a number
    """
    bad = ~(np.abs(raw) <= LARGEST)
    bad &= ~(np.isnan(raw) & np.isin(list(places), gaps))
    if bad.any():
        i, j = (int(k) for k in np.argwhere(bad)[0])
        key, column = list(places.items())[j]
        where, cell = source.look_up(row + i, column)
        raise InputError(
            f"{source.path}: {where}, column {source.names[column]} ({key}): "
            f"{cell}, not a usable number"
        )


def read_columns(source: Source, places: Mapping[str, int], clock: int | None = None) -> Array:
    """All rows of some columns, (n, len(places)), for small tables; `clock` as in `Source`."""
    chunks = list(source.read(list(places.values()), CHUNK, clock))
    if not chunks:
        raise InputError(f"{source.path}: no row of numbers")
    values = np.concatenate(chunks)
    check_numbers(source, places, values)
    return values
