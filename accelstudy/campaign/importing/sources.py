"""Files of numbers in columns: text of any layout, MATLAB, Parquet, bags and flight logs."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping, Sequence, Set
from contextlib import AbstractContextManager, contextmanager
from io import TextIOWrapper
from itertools import islice, takewhile
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Protocol, TextIO, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError, printable
from accelstudy.basics.wording import counted, one_line
from accelstudy.campaign.importing.clocks import is_stamp, nanoseconds
from accelstudy.campaign.importing.names import is_unit, layout_by_names, with_unit
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.reading import Unpacked, readable
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
_LONGEST = 2**20  # characters of a line
_COMMENTS = ("#", "%", "//", ";")
_NO_READING = frozenset({"", "-", "--", "nan", "na", "n/a", "null", "none"})
_SEPARATORS = {"tab": "\t", "blank": None}
_LAYOUTS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (None, "."), (None, ","))
_BUFFER = 2**20  # bytes of a Parquet column
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
    notes : sequence of str, how the file was read, in lines for people
    warnings : sequence of str, what of the file could not be read
    """

    path: Path
    names: list[str]
    named: bool
    dates: Set[int]
    layout: Mapping[str, Any]
    warnings: Sequence[str]

    @property
    def notes(self) -> Sequence[str]:
        """How the file was read, in lines for people."""
        ...

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
    comment : str, from which on the rest of a line is no data
    first : int, lines before the data
    width, least : int, cells of a row: at most, and usual if the last ones are empty
    repeated : int, how often the header stands between the rows, as far as these were read
    dates, layout, notes, warnings : see `Source`
    """

    warnings: Sequence[str] = ()

    def __init__(self, path: Path, delimiter: str | None = None) -> None:
        self.path, self.repeated = path, 0
        self._encoding = "utf-8-sig"
        with self._readable():
            with self._open_binary() as start:
                self._encoding = _encoding_of(start.read(4096))
            with self._open() as file:
                text = file.read(_PREVIEW)
                more = bool(file.read(1))
        lines = text.split("\n")
        if more and len(lines) == 1:  # it would be read as a whole
            raise InputError(f"{path}: no end of a line in {_PREVIEW} characters; is it text?")
        if more:
            lines.pop()  # it may be cut
        layouts = _LAYOUTS
        if delimiter is not None:
            given = _SEPARATORS.get(delimiter, delimiter)
            layouts = ((given, "."), *(() if given == "," else ((given, ","),)))
        tables = [_Table(lines, *layout) for layout in layouts]
        table = max(tables, key=lambda table: table.score)
        if not table.score:
            advice = "" if delimiter is None else f" with --delimiter {delimiter!r}"
            raise InputError(f"{path}: no line of numbers at the beginning{advice}")
        self.delimiter, self.decimal = table.delimiter, table.decimal
        self.first, self.width, self.least = table.first, table.width, table.least
        self.dates: Set[int] = table.dates
        self.comment = next((c for c in "#%" for line in lines if line.lstrip()[:1] == c), "#")
        self.named = table.names is not None
        self.names = table.names or [str(i) for i in range(self.width)]
        self._notes, self._repeats = table.notes, table.header
        self.layout = layout_by_names(self.names)
        self._comments = _comments(self.delimiter)
        self._marks = ('"', *self._comments, *self._repeats)
        # A cell in quotation marks that holds neither another mark nor the delimiter.
        self._quoted = re.compile(f'"[^"\n{re.escape(self.delimiter or " ")}]*"')

    @property
    def notes(self) -> list[str]:
        """Lines about the text as a table; see `Source`."""
        again = f"the header stands {counted(self.repeated, 'more time')} between the rows"
        return [*self._notes, *([again] if self.repeated else [])]

    def read(
        self, places: Sequence[int], chunk_size: int, clock: int | None = None
    ) -> Generator[Array, None, None]:
        """Rows of some columns; see `Source`. A row with too many cells has no numbers."""
        import pandas as pd

        try:
            with (
                self._readable(),
                self._open(self.first) as file,
                pd.read_csv(
                    cast(TextIO, _Lines(self, file)),
                    sep=self.delimiter or r"\s+",
                    decimal=self.decimal,
                    # With columns to use, a row may have more cells than the first line.
                    usecols=sorted({*places, self.width}),
                    header=0,
                    index_col=False,
                    comment=self.comment,
                    skipinitialspace=True,
                    low_memory=False,
                    chunksize=chunk_size,
                ) as reader,
            ):
                yield from self._rows(reader, places, clock)
        except InputError:
            raise
        except pd.errors.EmptyDataError:
            return
        except pd.errors.ParserError as error:
            raise InputError(f"{self.path}: no table: {one_line(error)}") from None

    def _rows(
        self, chunks: Iterable[pd.DataFrame], places: Sequence[int], clock: int | None
    ) -> Iterator[Array]:
        def columns() -> Iterator[list[NDArray[Any]]]:
            for chunk in chunks:
                values = [
                    nanoseconds(chunk[str(place)])
                    if place in self.dates
                    else _numbers_of_text(chunk[str(place)], self.decimal)
                    for place in places
                ]
                # A surplus cell ends up in the column after the last.
                surplus = chunk[str(self.width)].notna().to_numpy()
                if surplus.any():
                    values = [np.where(surplus, np.nan, column) for column in values]
                yield values

        return rows_of(columns(), places, self.dates, clock)

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """See `Source`; reads the file again, which only errors need."""
        number, line = next(islice(self.rows(), row, None), (0, ""))
        if not number:
            return f"row {row + 1}", "unreadable"
        cells = split_line(line.split(self.comment)[0], self.delimiter)
        if any(cells[self.width :]):
            return f"line {number}", f"{len(cells)} columns instead of {self.width}"
        if place >= len(cells):
            return f"line {number}", "the line ends before it"
        return f"line {number}", repr(cells[place][:40]) if cells[place] else "nothing"

    def rows(self) -> Iterator[tuple[int, str]]:
        """Lines of data with their numbers, counted from 1."""
        with self._readable(), self._open() as file:
            for number, line in enumerate(file, 1):
                if number > self.first and (row := self._row(line.rstrip("\n"))) is not None:
                    yield number, row

    def of_table(self, text: str) -> str:
        """Lines of a text without those that are no rows."""
        if not any(mark in text for mark in self._marks):
            return text
        lines = text.split("\n")
        self.repeated += sum(line.strip() in self._repeats for line in lines)
        if '"' in text and '"' not in self._quoted.sub("", text):
            rows = [row for line in lines if (row := self._row(line, closed=True)) is not None]
        else:
            rows = [row for line in lines if (row := self._row(line)) is not None]
        return "".join(f"{row}\n" for row in rows)

    def _row(self, line: str, closed: bool = False) -> str | None:
        """A line of the table, None for any other; a cell of a log has no end of a line.

        So a quotation mark that is not `closed` in its line has no meaning.
        """
        content = line.strip(_blanks(self.delimiter))
        if not content or content.startswith(self._comments) or line.strip() in self._repeats:
            return None
        if closed or '"' not in line:
            return line
        try:
            reader = csv.reader([line, ""], delimiter=self.delimiter or " ", skipinitialspace=True)
            closed = sum(1 for _ in reader) == 2
        except csv.Error:
            closed = False
        return line if closed else line.replace('"', "")

    def _open_binary(self) -> BinaryIO:
        with self.path.open("rb") as start:
            packed = start.read(len(GZIP)) == GZIP
        return cast(BinaryIO, Unpacked(self.path)) if packed else self.path.open("rb")

    def _open(self, skipped: int = 0) -> TextIO:
        """Open the file and skip some lines; quotation marks in a header have no meaning."""
        file = TextIOWrapper(self._open_binary(), encoding=self._encoding, errors="replace")
        try:
            for _ in range(skipped):
                file.readline()
        except BaseException:
            file.close()
            raise
        return file

    @contextmanager
    def _readable(self) -> Iterator[None]:
        try:
            with readable(self.path):
                yield
        except (gzip.BadGzipFile, EOFError, zlib.error):
            raise InputError(f"{self.path}: not a whole gzip file") from None


class _Lines:
    """The rows of a text as a file; before them a line with a cell more than they have."""

    def __init__(self, source: TextSource, file: TextIO) -> None:
        self._source, self._file = source, file
        self._first = (source.delimiter or " ").join(map(str, range(source.width + 1))) + "\n"
        source.repeated = 0

    def __iter__(self) -> Iterator[str]:  # by which pandas knows a file
        return iter(self.read, "")

    def read(self, size: int = -1) -> str:
        """Some whole lines; an empty text at the end."""
        first, self._first = self._first, ""
        while not first and (text := self._file.read(size)):
            if not text.endswith("\n"):
                text += (end := self._file.readline(_LONGEST))
                if len(end) == _LONGEST:
                    raise InputError(
                        f"{self._source.path}: a line of more than {_LONGEST} characters; is it "
                        "text?"
                    )
            first = self._source.of_table(text)
        return first


class _Table:
    """Lines of a text as a table, if a delimiter and a decimal mark are the right ones.

    Attributes
    ----------
    delimiter, decimal : see `TextSource`
    score : int, numbers in rows of the usual width, of which the right marks give most; 0 if the
        lines are no table
    first, width, least, dates, names, notes : see `TextSource`; no names where there are none
    header : tuple of str, lines with names and units
    """

    def __init__(self, lines: Sequence[str], delimiter: str | None, decimal: str) -> None:
        self.delimiter, self.decimal = delimiter, decimal
        rows = [
            (i, split_line(line, delimiter))
            for i, line in enumerate(lines)
            if line.strip() and not line.lstrip().startswith(_comments(delimiter))
        ]
        numbers = {i: sum(_is_number(cell, decimal) for cell in cells) for i, cells in rows}
        rows = [(i, cells) for i, cells in rows if numbers[i]]
        usual = _most_frequent(len(cells) for _, cells in rows) if rows else 0
        alike = [(i, cells) for i, cells in rows if len(cells) == usual]
        self.score = sum(numbers[i] for i, _ in alike)
        if not self.score:
            return
        # A line may hold text beside its numbers; everything before the first such line is the
        # header, but for rows that lack some reading.
        many = max(1, _most_frequent(numbers[i] for i, _ in alike))
        full = next(place for place, (i, _) in enumerate(alike) if numbers[i] >= many)
        before = takewhile(lambda row: self._lacks(row[1], alike[full][1]), alike[full - 1 :: -1])
        self.first = min([alike[full][0], *(i for i, _ in before if full)])
        self.width = self.least = usual
        cells = [cells for i, cells in rows if i >= self.first]
        self.header: tuple[str, ...] = ()
        self.names: list[str] | None = None
        self.notes: list[str] = []
        self._read_header(lines[: self.first], cells)
        firsts = (next((row[i] for row in cells if row[i:] and row[i]), "") for i in range(usual))
        self.dates = {i for i, cell in enumerate(firsts) if is_stamp(cell)}

    def _lacks(self, cells: Sequence[str], full: Sequence[str]) -> bool:
        """Whether a row is like a full one, but for some readings."""
        return all(
            cell.lower() in _NO_READING
            or _is_number(cell, self.decimal)
            or not _is_number(like, self.decimal)
            for cell, like in zip(cells, full, strict=True)
        )

    def _read_header(self, before: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
        """Names from the last line before the data, which may be a comment, and units below."""
        units: list[str] = []
        for number, line in reversed([*enumerate(before, 1)]):
            text = line.strip(_blanks(self.delimiter)).lstrip("".join(_comments(self.delimiter)))
            if not text.strip(f" \t-=+|_{self.delimiter or ''}"):  # a rule, or nothing
                continue
            cells = split_line(text.strip(_blanks(self.delimiter)), self.delimiter)
            cells = [printable(" ".join(cell.strip("\"'").split())) for cell in cells]
            if not units and any(cells) and all(is_unit(cell) for cell in cells if cell):
                units, self.header = cells, (line.strip(),)
                continue
            self._take_names(cells, rows)
            if self.names is None:
                if len(cells) > 2:
                    self.notes.append(
                        f"line {number} has {len(cells)} names for {self.width} columns, so these "
                        "have numbers, from 0"
                    )
                break
            self.header += (line.strip(),)
            if units:
                units += [""] * (self.width - len(units))
                self.names = [with_unit(*each) for each in zip(self.names, units, strict=False)]
                self.notes.append(f"units: in line {number + 1}, below the names")
            return
        if units:
            self._take_names(units, rows)

    def _take_names(self, names: list[str], rows: Sequence[Sequence[str]]) -> None:
        """Take names if there is one for each column."""
        longest = max(map(len, rows))
        while len(names) > longest and not names[-1]:
            names = names[:-1]
        if len(names) == self.width - 1 and not any(row[len(names) :][:1] != [""] for row in rows):
            self.width = self.least = len(names)
            self.notes.append("a delimiter at the end of each row is no column")
        if self.width < len(names) == longest:
            self.width = len(names)
        if len(names) == self.width:
            self.names = names


def _comments(delimiter: str | None) -> tuple[str, ...]:
    """What begins a line that is no row."""
    return tuple(mark for mark in _COMMENTS if mark != delimiter)


def _blanks(delimiter: str | None) -> str | None:
    """Characters around a line that are no cells; None for all blanks."""
    return " \r\n" if delimiter == "\t" else None


def _encoding_of(start: bytes) -> str:
    """Encoding of a text: UTF-16, which has a mark or every second byte empty, or UTF-8."""
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    for encoding, place in (("utf-16-le", 1), ("utf-16-be", 0)):
        half, other = start[place::2], start[1 - place :: 2]
        if len(half) > 1 and half.count(0) > 0.7 * len(half) and other.count(0) < 0.3 * len(half):
            return encoding
    return "utf-8-sig"


def split_line(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line, without surrounding blanks and quotation marks."""
    if '"' in line and delimiter is not None:
        try:
            row = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])
            return [cell.strip() for cell in row]
        except csv.Error:
            pass
    return [cell.strip() for cell in line.split(delimiter)]


def _is_number(cell: str, decimal: str) -> bool:
    if decimal == "," and "." in cell:
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return "_" not in cell  # a number to Python, not to anyone else


def _most_frequent(counts: Iterable[int]) -> int:
    """Most frequent of some numbers, the largest of equally frequent ones."""
    return max(Counter(counts).items(), key=lambda item: item[::-1])[0]


def _numbers_of_text(column: pd.Series, decimal: str) -> NDArray[Any]:
    """Numbers of a column, NaN where there is none; whole numbers stay integers."""
    import pandas as pd

    if pd.api.types.is_bool_dtype(column):
        return np.full(len(column), np.nan)
    if decimal != "." and not pd.api.types.is_numeric_dtype(column):
        # Beside a cell without a number, pandas leaves all of them as they are.
        column = column.astype("str").str.replace(decimal, ".", regex=False)
    numbers = pd.to_numeric(column, errors="coerce")
    if numbers.dtype.kind in "iu":
        return numbers.to_numpy()
    return numbers.to_numpy(dtype=float, na_value=np.nan)


def rows_of(
    chunks: Iterable[Sequence[NDArray[Any]]],
    places: Sequence[int],
    dates: Set[int],
    clock: int | None,
) -> Generator[Array, None, None]:
    """Columns of each chunk as rows of `Source.read`; dates in ns become s."""
    zero: Any = None
    for columns in chunks:
        if not len(columns[0]):
            continue
        if zero is None and clock is not None:
            times = columns[places.index(clock)]
            zero = next(iter(times[np.isfinite(times)]), None)
        each = [(c, zero if i == clock else None, i) for c, i in zip(columns, places, strict=True)]
        yield beside([since(c, start) * (1e-9 if i in dates else 1) for c, start, i in each])


class ArraySource:
    """An array (n, c) in memory, which was read as a whole.

    Attributes
    ----------
    path, names, named, dates, layout, notes, warnings : see `Source`
    values : (n, c) array
    """

    dates: Set[int] = frozenset()
    notes: Sequence[str] = ()

    def __init__(
        self,
        path: Path,
        values: NDArray[Any],
        names: Sequence[str] = (),
        layout: Mapping[str, Any] | None = None,
        warnings: Sequence[str] = (),
    ) -> None:
        self.path, self.values, self.layout = path, values, layout or {}
        self.warnings = warnings
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


class TypedSource:
    """Columns of types, from where `batches` has them; see `Source`."""

    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()

    def __init__(self, path: Path, schema: pa.Schema) -> None:
        import pyarrow as pa

        self.path = path
        first = next(self.batches(1), None)
        self._columns, self._types = schema.names, schema.types
        self.names = [printable(" ".join(name.split())) for name in schema.names]
        self.named = True
        self.layout = layout_by_names(self.names)
        self.dates: Set[int] = {
            i
            for i, kind in enumerate(schema.types)
            if pa.types.is_timestamp(kind) or (first and is_stamp(str(first.column(i)[0])))
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
        batches = self.batches(chunk_size, names)
        columns = ([_numbers(batch.column(name)) for name in names] for batch in batches)
        yield from rows_of(columns, places, self.dates, clock)

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Where a value stands, and the value; see `Source`."""
        for chunk in self.read([place], CHUNK):
            if row < len(chunk):
                return f"row {row + 1}", f"{chunk[row, 0]:g}"
            row -= len(chunk)
        return f"row {row + 1}", "nothing"

    def batches(
        self, chunk_size: int, columns: Sequence[str] | None = None
    ) -> Iterator[pa.RecordBatch]:
        """Rows as they are, of all columns or of some."""
        raise NotImplementedError


class ParquetSource(TypedSource):
    """Columns of a Parquet file."""

    def __init__(self, path: Path) -> None:
        with open_parquet(path) as file:
            schema = file.schema_arrow
        super().__init__(path, schema)

    def batches(
        self, chunk_size: int, columns: Sequence[str] | None = None
    ) -> Iterator[pa.RecordBatch]:
        """Rows as they are, of all columns or of some."""
        with open_parquet(self.path) as file:
            yield from file.iter_batches(chunk_size, columns=columns)


class TableSource(TypedSource):
    """A table in memory, which messages call by a name instead of a path."""

    def __init__(self, name: str, table: pa.Table) -> None:
        self._table = table
        super().__init__(Path(name), table.schema)

    def __str__(self) -> str:
        return str(self.path)

    def batches(
        self, chunk_size: int, columns: Sequence[str] | None = None
    ) -> Iterator[pa.RecordBatch]:
        """Rows as they are, of all columns or of some."""
        table = self._table if columns is None else self._table.select(columns)
        yield from table.to_batches(chunk_size)


LogFile: TypeAlias = str | Path | TableSource
"""Where a log is: the path of a file, or a table in memory."""


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
