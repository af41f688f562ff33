"""Numbers in lines of text: how its rows are written is told from them, and Arrow reads them."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cached_property
from io import BytesIO
from itertools import islice, product, takewhile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv as arrow_csv

from accelstudy.basics.errors import InputError, printable
from accelstudy.basics.progress import stage
from accelstudy.basics.wording import one_line, plural
from accelstudy.campaign.importing.names import is_unit, layout_by_names, with_unit
from accelstudy.campaign.importing.sources import Source, is_stamp
from accelstudy.files.reading import readable

GZIP = b"\x1f\x8b"
"""First bytes of a gzipped file."""

_PREVIEW = 65536  # characters of a text from which the layout of its rows is told
_BLOCK = 2**20  # bytes that hold any line
_COMMENTS = ("#", "%", "//", ";")
_NO_READING = frozenset({"", "-", "--", "nan", "na", "n/a", "null", "none"})
_LAYOUTS = ((",", "."), *product((";", "\t", "|", None), ".,"))
"""Delimiters, None for blanks, with decimal marks."""
_LABEL = re.compile(rb"(?<![\w.])([A-Za-z_]\w*)[ \t]*[:=][ \t]*(?=[-+.\d])")
"""Name of the number that follows, as in ``ax: 0.12`` or ``ax=0.12``."""
_DECIMAL_COMMA = r"^([+-]?[0-9]*),([0-9]+([eE][+-]?[0-9]+)?)$"
_NUMBER = r"^[+-]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE]([+]?[0-9]{1,2}|-[0-2]?[0-9]{1,2}))?$"


class TextSource(Source):
    """Numbers in lines of text, which are read when they are asked for.

    Attributes
    ----------
    names : list of str, from the header, or the places of the columns
    named : bool, whether there is a header
    path, dates, layout, notes, warnings : see `Source`
    """

    def __init__(self, path: Path) -> None:
        self.path, self._repeated = path, 0
        self._content: bytes | None
        self._content, labels = _read(path)
        self._rows = _Rows.told_from(self._content, path)
        names = labels if len(labels) == self._rows.width else self._rows.names
        self.named = names is not None
        self.names = names or [str(i) for i in range(self._rows.width)]
        self.dates, self.layout = self._rows.dates, layout_by_names(self.names)

    @property
    def notes(self) -> list[str]:
        """Lines about the text as a table; see `Source`."""
        again = f"the header stands {plural(self._repeated, 'more time')} between the rows"
        return [*self._rows.notes, *([again] if self._repeated else [])]

    @cached_property
    def table(self) -> pa.Table:
        """Cells as text, without blanks around them; see `Source`."""
        return pa.table(self._texts(range(self._rows.width)), names=self.unique_names)

    def typed_table(self) -> pa.Table:
        """Columns that hold only numbers as numbers; see `Source`."""
        columns = [_to_numbers(column) for column in self.table.columns]
        return pa.table(columns, names=self.table.column_names)

    def columns(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Columns as numbers where all cells are, which saves time and memory; else as text."""
        if "table" in vars(self):  # so that the file is read once
            return super().columns(places)
        if self._rows.decimal == "." and not self.dates & {*places}:
            kinds = {p: pa.int64() if p in self._rows.long else pa.float64() for p in places}
            try:
                return self._read(kinds).columns
            except pa.ArrowInvalid:
                pass
        return self._texts(places)

    def _numbers(self, column: pa.ChunkedArray, place: int) -> NDArray[Any]:
        if place not in self.dates and pa.types.is_string(column.type):
            return _numbers_of_text(column)
        return super()._numbers(column, place)

    def _texts(self, places: Iterable[int]) -> list[pa.ChunkedArray]:
        """Cells of columns; a row with too many cells is null, as nobody knows which are right."""
        ragged: list[tuple[int, str]] = []

        def set_aside(row: Any) -> str:
            ragged.append((row.number - 1, row.text))
            return "skip"

        try:
            table = self._read(dict.fromkeys(places, pa.string()), set_aside)
        except pa.ArrowInvalid as error:
            raise InputError(f"{self.path}: no table: {one_line(error)}") from None
        columns = self._with_ragged(table, ragged).columns if ragged else table.columns
        for i, cells in enumerate(columns):
            if pc.any(pc.match_substring(cells, " ")).as_py():
                columns[i] = pc.utf8_trim_whitespace(cells)
            if self._rows.decimal == ",":
                columns[i] = pc.replace_substring_regex(columns[i], _DECIMAL_COMMA, r"\1.\2")
        return columns

    def _read(
        self, kinds: Mapping[int, pa.DataType], set_aside: Callable[[Any], str] | None = None
    ) -> pa.Table:
        """Columns of these places and types.

        Rows with fewer or more cells than others are set aside, or an error.
        """
        names = [str(place) for place in range(self._rows.width)]
        types = {names[place]: kind for place, kind in kinds.items()}
        with stage(f"reading {self.path.name}"):
            if not (content := self._rows_only()).size:
                return pa.schema(types).empty_table()
            return arrow_csv.read_csv(
                pa.BufferReader(content),
                # Of several threads none knows the number of its row.
                arrow_csv.ReadOptions(
                    column_names=names, use_threads=set_aside is None, block_size=_BLOCK
                ),
                arrow_csv.ParseOptions(
                    delimiter=self._rows.delimiter or " ", invalid_row_handler=set_aside
                ),
                arrow_csv.ConvertOptions(
                    column_types=types, include_columns=[*types], strings_can_be_null=False
                ),
            )

    def _with_ragged(self, table: pa.Table, ragged: Sequence[tuple[int, str]]) -> pa.Table:
        """Rows with those that have fewer or more cells, by their places, where they belong."""
        width, rows = self._rows.width, list[Sequence[str | None]]()
        for _, text in ragged:
            cells = self._rows.split(text)
            rows.append([None] * width if any(cells[width:]) else [*cells, *[""] * width][:width])
        columns = [[row[int(name)] for row in rows] for name in table.column_names]
        more = pa.table([pa.array(c, pa.string()) for c in columns], table.column_names)
        places, count = np.array([place for place, _ in ragged]), np.arange(len(ragged))
        order = np.insert(np.arange(len(table)), places - count, len(table) + count)
        # Blank lines and the like are no rows.
        none = [place for place, text in ragged if self._rows.clean(text) is None]
        return pa.concat_tables([table, more]).take(np.delete(order, none))

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """See `Source`; reads the file again, which only errors and warnings need."""
        lines = enumerate(_read(self.path)[0].decode().split("\n"), 1)
        below = ((n, self._rows.clean(line)) for n, line in lines if n > self._rows.first)
        rows = ((n, text) for n, text in below if text is not None)
        number, line = next(islice(rows, row, None), (0, ""))
        if not number:
            return f"row {row + 1}", "unreadable"
        cells = self._rows.split(line)
        if any(cells[self._rows.width :]):
            return f"line {number}", f"{len(cells)} columns instead of {self._rows.width}"
        if place >= len(cells):
            return f"line {number}", "the line ends before it"
        return f"line {number}", repr(cells[place][:40]) if cells[place] else "nothing"

    def _rows_only(self) -> pa.Buffer:
        """Rows of the table, each in a line of its own, in UTF-8."""
        content, self._content = self._content or _read(self.path)[0], None
        self._repeated = 0
        lines = BytesIO(content)
        for _ in range(self._rows.first):
            lines.readline()
        if self._rows.are_clean(content, lines.tell()):
            return pa.py_buffer(content).slice(lines.tell())
        blocks = iter(lambda: lines.read(_BLOCK) + lines.readline(), b"")
        return pa.py_buffer(b"".join(map(self._clean_lines, blocks)))

    def _clean_lines(self, block: bytes) -> bytes:
        """Lines of a text without those that are no rows."""
        if self._rows.are_clean(block):
            return block
        lines = block.decode().split("\n")
        self._repeated += sum(line.strip() in self._rows.header for line in lines)
        rows = (row for line in lines if (row := self._rows.clean(line)) is not None)
        return "".join(f"{row}\n" for row in rows).encode()


class _Rows:
    """How the rows of a text are written, if a delimiter and a decimal mark are the right ones.

    Attributes
    ----------
    delimiter : str, None for blanks
    decimal : str, mark between units and tenths
    score : int, numbers in rows of the usual width, of which the right marks give most; 0 if the
        lines are no table
    many : int, numbers in a usual row
    first : int, lines before the data
    width : int, cells of a row; a row with fewer lacks the last ones
    names : list of str, from the header; None without one
    header : tuple of str, lines with names and units
    notes : list of str, how the text was taken
    dates : set of int, places of columns of dates with times
    long : set of int, places of columns of whole numbers with more digits than a float
    comment : str, from which on the rest of a line is no data
    """

    def __init__(self, lines: Sequence[str], delimiter: str | None, decimal: str) -> None:
        self.delimiter, self.decimal, self.many = delimiter, decimal, 0
        self._comments = tuple(mark for mark in _COMMENTS if mark != delimiter)
        # Characters around a line that are no cells; None for all blanks.
        self._around = " \r\n" if delimiter == "\t" else None
        rows = [
            (i, self.split(line))
            for i, line in enumerate(lines)
            if line.strip() and not line.lstrip().startswith(self._comments)
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
        self.comment = next((c for c in "#%" for line in lines if line.lstrip()[:1] == c), "#")
        blanks = ("  ", "\t", "\n ", " \n") if delimiter is None else ()
        self._marks = [m.encode() for m in ('"', *self._comments, *self.header, *blanks)]
        mark = re.escape(delimiter or " ")
        # A cell whose quotation marks hold neither another mark nor the delimiter.
        self._quoted = re.compile(f'(^|{mark}) *"([^"{mark}]*)"')

    @classmethod
    def told_from(cls, content: bytes, path: Path) -> _Rows:
        """Tell the delimiter and the decimal mark of a text."""
        lines = content[:_PREVIEW].decode(errors="replace").split("\n")
        if len(content) > _PREVIEW:
            if len(lines) == 1:
                raise InputError(f"{path}: no end of a line in {_PREVIEW} characters; is it text?")
            lines.pop()  # it may be cut
        tables = [cls(lines, *layout) for layout in _LAYOUTS]
        if any(table.delimiter == "\t" and table.many >= 3 for table in tables):
            # Tabs make a log of the rows already, so blanks are those of a note.
            tables = [table for table in tables if table.delimiter is not None]
        best = max(tables, key=lambda table: table.score)
        if not best.score:
            raise InputError(f"{path}: no line of numbers at the beginning")
        return best

    def split(self, line: str) -> list[str]:
        """Cells of a line, without surrounding blanks and quotation marks."""
        return split_line(line, self.delimiter)

    def are_clean(self, content: bytes, start: int = 0) -> bool:
        """Whether there are, from a place on, lines of the table only, as Arrow takes them."""
        # A search for one mark is much faster than for several in a row.
        found = (
            content.find(mark[:1], start) >= 0 and content.find(mark, start) >= 0
            for mark in self._marks
        )
        return not content.startswith(b" ", start) and not any(found)

    def clean(self, line: str) -> str | None:
        """A row as Arrow takes it, with quotation marks only where they are needed.

        None for any other line.
        """
        if (
            not (content := line.strip(self._around))
            or content.startswith(self._comments)
            or line.strip() in self.header
        ):
            return None
        start = line.split(self.comment)[0]
        row = line if start.count('"') % 2 else start
        if '"' in row:
            plain = self._quoted.sub(r"\1\2", row)
            row = self._quote_again(self.split(row)) if '"' in plain else plain
        return row if self.delimiter or '"' in row else " ".join(row.split())

    def _quote_again(self, cells: Sequence[str]) -> str:
        """A row of cells, with quotation marks around those that need them."""
        mark = self.delimiter or " "
        cells = [cell.replace('"', '""') for cell in cells]
        return mark.join(f'"{c}"' if mark in c or '"' in c else c for c in cells)

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
        unfit: list[str] = []
        for number, line in reversed([*enumerate(before, 1)]):
            text = line.strip(self._around).lstrip("".join(self._comments))
            if not text.strip(f" \t-=+|_{self.delimiter or ''}"):  # a rule, or nothing
                continue
            cells = self.split(text.strip(self._around))
            cells = [printable(" ".join(cell.strip("\"'").split())) for cell in cells]
            if not units and any(cells) and all(is_unit(cell) for cell in cells if cell):
                units, self.header = cells, (line.strip(),)
                continue
            self._take_names(cells, rows)
            if self.names is not None:
                self.header += (line.strip(),)
                if units:
                    units += [""] * (self.width - len(units))
                    self.names = [with_unit(*each) for each in zip(self.names, units, strict=False)]
                    self.notes.append(f"units: in line {number + 1}, below the names")
                return
            if len(cells) > 2:
                unfit.append(
                    f"line {number} has {len(cells)} names for {self.width} columns, so these "
                    "have numbers, from 0"
                )
            if not line.lstrip().startswith(self._comments):
                break
        self.notes += unfit[:1]
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


def split_line(line: str, delimiter: str | None) -> list[str]:
    """Cells of a line, without surrounding blanks and quotation marks.

    No cell holds the end of a line, so a quotation mark that does not close has no meaning.
    """
    if '"' in line:
        line = line if delimiter else " ".join(line.split())
        reader = csv.reader([line, ""], delimiter=delimiter or " ", skipinitialspace=True)
        with suppress(csv.Error):
            if len(rows := [*reader]) == 2:
                return [cell.strip() for cell in rows[0]]
        line = line.replace('"', "")
    return [cell.strip() for cell in line.split(delimiter)]


def _read(path: Path) -> tuple[bytes, list[str]]:
    """All of a file in UTF-8, with line ends as in Python, and the labels that its rows had.

    Of lines as ``ax: 0.12, ay: -0.03, az: 9.8`` the numbers are left; lines with other labels, as
    those of a gyroscope may alternate with them, become empty.
    """
    try:
        with readable(path):
            content = path.read_bytes()
            content = gzip.decompress(content) if content.startswith(GZIP) else content
    except (gzip.BadGzipFile, EOFError, zlib.error):
        raise InputError(f"{path}: not a whole gzip file") from None
    if not content.isascii() or 0 in content[:4096]:
        encoding = _encoding_of(content[:4096])
        try:
            content = content.decode(encoding).encode()
        except UnicodeDecodeError:  # what is no UTF-8 is mostly that of a Western Windows
            encoding = "cp1252" if encoding.startswith("utf-8") else encoding
            content = content.decode(encoding, errors="replace").encode()
    if b"\r" in content:
        content = content.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    first = content[:_PREVIEW].split(b"\n")
    labels, lines = Counter(tuple(_LABEL.findall(line)) for line in first).most_common(1)[0]
    if len(labels) < 3 or lines < len(first) / 3:
        return content, []
    parts = (rb"(.*?)(?<![\w.])%b[ \t]*[:=][ \t]*" % re.escape(label) for label in labels)
    row = re.compile(rb"^(?:%b(.*)|.*)$" % b"".join(parts), re.MULTILINE)
    content = row.sub(lambda line: b"".join(part or b"" for part in line.groups()), content)
    return content, [label.decode() for label in labels]


def _encoding_of(start: bytes) -> str:
    """Encoding of a text: UTF-16, which has a mark or every second byte empty, or UTF-8."""
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    for encoding, place in (("utf-16-le", 1), ("utf-16-be", 0)):
        half, other = start[place::2], start[1 - place :: 2]
        if len(half) > 1 and half.count(0) > 0.7 * len(half) and other.count(0) < 0.3 * len(half):
            return encoding
    return "utf-8-sig"


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


def _to_numbers(column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Cells as numbers if that loses no digit of any; as text otherwise."""
    filled = pc.if_else(pc.equal(column, ""), None, column)
    for kind in (pa.int64(), pa.float64()):
        try:
            numbers = filled.cast(kind)
        except pa.ArrowInvalid:
            continue
        if pa.types.is_integer(kind) or not _has_long(column):
            return numbers
    return column


def _has_long(column: pa.ChunkedArray) -> bool:
    """Whether a cell is a whole number of more digits than a float has."""
    return bool(pc.any(pc.match_substring_regex(column, r"^\s*[+-]?[0-9]{16,}\s*$")).as_py())
