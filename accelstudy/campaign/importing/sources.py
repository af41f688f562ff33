"""Tables of numbers: text of any layout, MATLAB, Parquet, or a table in memory."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import islice, pairwise, takewhile
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv as arrow_csv

from accelstudy.basics.errors import InputError, UnknownNameError, printable
from accelstudy.basics.progress import stage
from accelstudy.basics.wording import counted, one_line
from accelstudy.campaign.importing.names import is_unit, layout_by_names, with_unit
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.reading import readable

Array = NDArray[np.float64]

GZIP = b"\x1f\x8b"
"""First bytes of a gzipped file."""

_PREVIEW = 65536  # characters of a text from which its layout is told
_BLOCK = 2**20  # bytes that hold any line
_COMMENTS = ("#", "%", "//", ";")
_NO_READING = frozenset({"", "-", "--", "nan", "na", "n/a", "null", "none"})
_SEPARATORS = {"tab": "\t", "blank": None}
_LAYOUTS = ((",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ","), (None, "."), (None, ","))
_DECIMAL_COMMA = r"^([+-]?[0-9]*),([0-9]+([eE][+-]?[0-9]+)?)$"
_NUMBER = r"^[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE]([+]?[0-9]{1,2}|-[0-2]?[0-9]{1,2}))?$"
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
        self.path, self._table, self.warnings, self.named = Path(path), table, warnings, named
        self.names = [printable(" ".join(name.split())) for name in table.column_names]
        self.layout = layout_by_names(self.names) if layout is None else layout
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

    def columns(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Columns as they are in the file: of a text, of text; rows that are none are null."""
        return [self._table.column(place) for place in places]

    def numbers(
        self, places: Sequence[int], columns: Sequence[pa.ChunkedArray] | None = None
    ) -> list[NDArray[Any]]:
        """Numbers of columns, NaN where there is none; dates and other whole numbers as integers.

        A time in ns since 1970 has more digits than a float. The columns are read unless they were.
        """
        left = self._cells_of_numbers(places) if columns is None else [*columns]
        # A text takes more memory than its numbers, so it goes as these come.
        numbers = [self._numbers(left.pop(0), place) for place in places]
        pa.default_memory_pool().release_unused()
        return numbers

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Describe where a row is in the file, and what its cell in a column says."""
        (values,) = self.numbers([place])
        value = values[row] * (1e-9 if place in self.dates else 1)
        return f"row {row + 1}", f"{value:g}"

    def _cells_of_numbers(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Columns of which only the numbers matter."""
        return self.columns(places)

    def _numbers(self, column: pa.ChunkedArray, place: int) -> NDArray[Any]:
        kind = column.type
        if place in self.dates:
            return nanoseconds(column.to_pandas())
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise InputError(f"{self.path}: column {self.names[place]} is {kind}, not numbers")
        if column.null_count:
            column = column.cast(pa.float64(), safe=False)
        return column.to_numpy()


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


class TextSource(Source):
    """Numbers in lines of text, which are read when they are asked for.

    Attributes
    ----------
    path : Path
    names : list of str, from the header, or the places of the columns
    named : bool, whether there is a header
    delimiter : str, None for blanks
    decimal : str, mark between units and tenths
    comment : str, from which on the rest of a line is no data
    first : int, lines before the data
    width : int, cells of a row; a row with fewer lacks the last ones
    repeated : int, how often the header stands between the rows, once these were read
    dates, layout, notes, warnings : see `Source`
    """

    def __init__(self, path: Path, delimiter: str | None = None) -> None:
        self.path, self.repeated = path, 0
        self._content: bytes | None = self._read_content()
        lines = self._content[:_PREVIEW].decode(errors="replace").split("\n")
        if len(self._content) > _PREVIEW:
            if len(lines) == 1:
                raise InputError(f"{path}: no end of a line in {_PREVIEW} characters; is it text?")
            lines.pop()  # it may be cut
        layouts = _LAYOUTS
        if delimiter is not None:
            given = _SEPARATORS.get(delimiter, delimiter)
            layouts = ((given, "."), *(() if given == "," else ((given, ","),)))
        tables = [_Table(lines, *layout) for layout in layouts]
        if any(table.delimiter == "\t" and table.many >= 3 for table in tables):
            # Tabs make a log of the rows already, so blanks are those of a note.
            tables = [table for table in tables if table.delimiter is not None]
        table = max(tables, key=lambda table: table.score)
        if not table.score:
            advice = "" if delimiter is None else f" with `delimiter` {delimiter!r}"
            raise InputError(f"{path}: no line of numbers at the beginning{advice}")
        self.delimiter, self.decimal = table.delimiter, table.decimal
        self.first, self.width = table.first, table.width
        self.dates, self._long = table.dates, table.long
        self.comment = next((c for c in "#%" for line in lines if line.lstrip()[:1] == c), "#")
        self.named = table.names is not None
        self.names = table.names or [str(i) for i in range(self.width)]
        self._notes, self._repeats = table.notes, table.header
        self.layout = layout_by_names(self.names)
        self._comments = _comments(self.delimiter)
        blanks = ("  ", "\t", "\n ", " \n") if self.delimiter is None else ()
        self._marks = [m.encode() for m in ('"', *self._comments, *self._repeats, *blanks)]
        mark = re.escape(self.delimiter or " ")
        # A cell in quotation marks that holds neither another mark nor the delimiter.
        self._quoted = re.compile(f'"[^"\n{mark}]*"')
        # Blanks before a cell in quotation marks or, as a delimiter, between any cells.
        between = rf'(?<={mark})[ ]+(?=")' if self.delimiter else r"\s+"
        self._blanks = re.compile(between + r'(?=(?:[^"]*"[^"]*")*[^"]*$)')

    @property
    def notes(self) -> list[str]:
        """Lines about the text as a table; see `Source`."""
        again = f"the header stands {counted(self.repeated, 'more time')} between the rows"
        return [*self._notes, *([again] if self.repeated else [])]

    def columns(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Cells of columns, without blanks around them; a row with too many cells is null.

        Nobody knows which of its cells are right.
        """
        try:
            table, ragged = self._read(dict.fromkeys(places, pa.string()))
        except pa.ArrowInvalid as error:
            raise InputError(f"{self.path}: no table: {one_line(error)}") from None
        if ragged:
            table = self._with_ragged(table, ragged)
        columns = {}
        for name in table.column_names:
            cells = table[name]
            if pc.any(pc.match_substring(cells, " ")).as_py():
                cells = pc.utf8_trim_whitespace(cells)
            if self.decimal == ",":
                cells = pc.replace_substring_regex(cells, _DECIMAL_COMMA, r"\1.\2")
            columns[int(name)] = cells
        return [columns[place] for place in places]

    def _cells_of_numbers(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Columns as numbers where all cells are, which saves time and memory."""
        if self.decimal == "." and not self.dates & {*places}:
            types = {p: pa.int64() if p in self._long else pa.float64() for p in places}
            try:
                table, ragged = self._read(types)
            except pa.ArrowInvalid:
                return self.columns(places)
            if not ragged:
                return [table[str(place)] for place in places]
        return self.columns(places)

    def _numbers(self, column: pa.ChunkedArray, place: int) -> NDArray[Any]:
        if place not in self.dates and pa.types.is_string(column.type):
            return _numbers_of_text(column)
        return super()._numbers(column, place)

    def _read(self, types: Mapping[int, pa.DataType]) -> tuple[pa.Table, list[tuple[int, str]]]:
        """Columns of these places and types, and the rows with fewer or more cells than others."""
        names = [str(place) for place in range(self.width)]
        ragged: list[tuple[int, str]] = []

        def set_aside(row: Any) -> str:
            ragged.append((row.number - 1, row.text))
            return "skip"

        kinds = {names[place]: kind for place, kind in types.items()}
        with stage(f"reading {self.path.name}"):
            content = self._rows()
            if not content.size:
                return pa.schema(kinds).empty_table(), ragged
            table = arrow_csv.read_csv(
                pa.BufferReader(content),
                # Of several threads none knows the number of its row.
                arrow_csv.ReadOptions(column_names=names, use_threads=False, block_size=_BLOCK),
                arrow_csv.ParseOptions(
                    delimiter=self.delimiter or " ", invalid_row_handler=set_aside
                ),
                arrow_csv.ConvertOptions(
                    column_types=kinds, include_columns=[*kinds], strings_can_be_null=False
                ),
            )
        return table, ragged

    def _with_ragged(self, table: pa.Table, ragged: Sequence[tuple[int, str]]) -> pa.Table:
        """Rows with those that have fewer or more cells, by their places, where they belong."""
        rows: list[Sequence[str | None]] = []
        for _, text in ragged:
            cells = split_line(text, self.delimiter)
            filled = [*cells, *[""] * self.width][: self.width]
            rows.append([None] * self.width if any(cells[self.width :]) else filled)
        columns = [[row[int(name)] for row in rows] for name in table.column_names]
        more = pa.table([pa.array(c, pa.string()) for c in columns], table.column_names)
        places = np.array([place for place, _ in ragged])
        order = np.insert(
            np.arange(len(table)),
            places - np.arange(len(places)),
            len(table) + np.arange(len(places)),
        )
        # Blank lines and the like are no rows.
        none = [place for place, text in ragged if self._row(text) is None]
        return pa.concat_tables([table, more]).take(np.delete(order, none))

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
        for number, line in enumerate(self._read_content().decode().split("\n"), 1):
            if number > self.first and (row := self._row(line)) is not None:
                yield number, row

    def _rows(self) -> pa.Buffer:
        """Rows of the table, each in a line of its own, in UTF-8."""
        content, self._content = self._content or self._read_content(), None
        self.repeated, start = 0, 0
        for _ in range(self.first):
            start = content.find(b"\n", start) + 1
        if self._is_plain(content, start):
            return pa.py_buffer(content).slice(start)
        ends = [start]
        while ends[-1] < len(content):
            ends.append(content.find(b"\n", ends[-1] + _BLOCK) + 1 or len(content))
        blocks = [self._of_table(content[i:end]) for i, end in pairwise(ends)]
        return pa.py_buffer(b"".join(blocks))

    def _is_plain(self, content: bytes, start: int = 0) -> bool:
        """Whether there are, from a place on, lines of the table only, as Arrow takes them."""
        # A search for one mark is much faster than for several in a row.
        found = (
            content.find(mark[:1], start) >= 0 and content.find(mark, start) >= 0
            for mark in self._marks
        )
        return not content.startswith(b" ", start) and not any(found)

    def _of_table(self, block: bytes) -> bytes:
        """Lines of a text without those that are no rows."""
        if self._is_plain(block):
            return block
        text = block.decode()
        lines = text.split("\n")
        self.repeated += sum(line.strip() in self._repeats for line in lines)
        closed = '"' not in self._quoted.sub("", text)
        rows = (row for line in lines if (row := self._row(line, closed)) is not None)
        return "".join(f"{row}\n" for row in rows).encode()

    def _row(self, line: str, closed: bool = False) -> str | None:
        """A line of the table, None for any other; a cell of a log has no end of a line.

        So a quotation mark that is not `closed` in its line has no meaning.
        """
        content = line.strip(_blanks(self.delimiter))
        if not content or content.startswith(self._comments) or line.strip() in self._repeats:
            return None
        row = line
        if self.comment in line and (start := line.split(self.comment)[0]).count('"') % 2 == 0:
            row = start
        if '"' in row and not closed:
            try:
                mark = self.delimiter or " "
                reader = csv.reader([row, ""], delimiter=mark, skipinitialspace=True)
                closed = sum(1 for _ in reader) == 2
            except csv.Error:
                closed = False
            row = row if closed else row.replace('"', "")
        if '"' in row:
            return self._blanks.sub("" if self.delimiter else " ", row.strip(" "))
        return row if self.delimiter else " ".join(row.split())

    def _read_content(self) -> bytes:
        """All of the file in UTF-8, with line ends as in Python."""
        try:
            with readable(self.path):
                content = self.path.read_bytes()
                content = gzip.decompress(content) if content.startswith(GZIP) else content
        except (gzip.BadGzipFile, EOFError, zlib.error):
            raise InputError(f"{self.path}: not a whole gzip file") from None
        if not content.isascii() or 0 in content[:4096]:
            content = content.decode(_encoding_of(content[:4096]), errors="replace").encode()
        return (
            content.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in content else content
        )


class _Table:
    """Lines of a text as a table, if a delimiter and a decimal mark are the right ones.

    Attributes
    ----------
    delimiter, decimal : see `TextSource`
    score : int, numbers in rows of the usual width, of which the right marks give most; 0 if the
        lines are no table
    many : int, numbers in a usual row
    first, width, dates, names, notes : see `TextSource`; no names where there are none
    header : tuple of str, lines with names and units
    long : set of int, places of columns of whole numbers with more digits than a float
    """

    def __init__(self, lines: Sequence[str], delimiter: str | None, decimal: str) -> None:
        self.delimiter, self.decimal, self.many = delimiter, decimal, 0
        comments = _comments(delimiter)
        rows = [
            (i, split_line(line, delimiter))
            for i, line in enumerate(lines)
            if line.strip() and not line.lstrip().startswith(comments)
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
        self.many = max(1, _most_frequent(numbers[i] for i, _ in alike))
        full = next(place for place, (i, _) in enumerate(alike) if numbers[i] >= self.many)
        before = takewhile(lambda row: self._lacks(row[1], alike[full][1]), alike[full - 1 :: -1])
        self.first = min([alike[full][0], *(i for i, _ in before if full)])
        self.width = usual
        cells = [cells for i, cells in rows if i >= self.first]
        self.header: tuple[str, ...] = ()
        self.names: list[str] | None = None
        self.notes: list[str] = []
        self._read_header(lines[: self.first], cells)
        firsts = [next((row[i] for row in cells if row[i:] and row[i]), "") for i in range(usual)]
        self.dates = {i for i, cell in enumerate(firsts) if is_stamp(cell)}
        self.long = {i for i, cell in enumerate(firsts) if re.fullmatch("-?[0-9]{16,19}", cell)}

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
            self.width = len(names)
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


def _numbers_of_text(column: pa.ChunkedArray) -> NDArray[Any]:
    """Numbers of cells, NaN where there is none; whole numbers as integers."""
    if pc.all(pc.match_substring_regex(column[:9], "^-?[0-9]+$")).as_py():
        try:
            return column.cast(pa.int64()).to_numpy()
        except pa.ArrowInvalid:
            pass
    try:
        return column.cast(pa.float64()).to_numpy()
    except pa.ArrowInvalid:
        # Somewhere is what is no number, or is written as Arrow does not take it.
        column = pc.utf8_trim_whitespace(column)
        column = pc.if_else(pc.match_substring_regex(column, _NUMBER), column, None)
        column = pc.replace_substring_regex(column, r"^[+]", "")
        return column.cast(pa.float64()).to_numpy()


def table_of(values: NDArray[Any], names: Sequence[str] = ()) -> pa.Table:
    """Array (n, c) as a table; its columns have their places as names if they have no others."""
    names = names or [str(place) for place in range(values.shape[1])]
    return pa.table([*map(pa.array, values.T)], names=[*names])


def open_matlab(path: Path, variable: str | None = None) -> Source:
    """Open a MATLAB file; it is read as a whole, since the format allows 2 GB at most."""
    try:
        with readable(path):
            return Source(path, table_of(_matlab_array(path, variable)), named=False)
    except InputError:
        raise
    except NotImplementedError:
        raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7") from None
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


def open_parquet(path: Path) -> Source:
    """Open a Parquet file."""
    with whole_parquet(path) as file:
        return Source(path, file.read())


LogFile: TypeAlias = str | Path | Source
"""Where a log is: the path of a file, or a table in memory."""


def counted_from_first(values: NDArray[Any]) -> tuple[Array, float]:
    """Numbers counted from the first of them, and that first one; NaN if there is none.

    Whole numbers, such as times in ns, are counted as integers.
    """
    zero = next(iter(values[np.isfinite(values)]), np.nan)
    if values.dtype.kind in "iu" and isinstance(zero, np.integer):
        return (values.astype(np.int64) - zero.astype(np.int64)).astype(float), float(zero)
    return values - float(zero), float(zero)


def is_stamp(text: str) -> bool:
    """Whether a text is a date with a time, or a time of day, that `nanoseconds` reads."""
    return _STAMP.fullmatch(text.strip()) is not None


def nanoseconds(column: pd.Series) -> NDArray[Any]:
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
