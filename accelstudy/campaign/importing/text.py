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

import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray
from pyarrow import csv as arrow_csv

from accelstudy.basics.errors import InputError, printable
from accelstudy.basics.progress import stage
from accelstudy.basics.wording import one_line, plural
from accelstudy.campaign.importing.names import layout_by_names, unit_of_cell
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
_LONG = 1e15  # from which on a whole number may have more digits than a float


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
        columns = [_numbers_if_all_are(cells) for cells in self.table.columns]
        return pa.table(columns, names=self.table.column_names)

    def columns(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Columns as numbers where all cells are, else as text; see `Source`."""
        read = "table" in vars(self)  # so that the file is read once
        if not read and self._rows.decimal == "." and not self.dates & {*places}:
            # Numbers at once take less time and memory than texts.
            kinds = {p: pa.int64() if p in self._rows.long else pa.float64() for p in places}
            with suppress(pa.ArrowInvalid):
                return self._parse(self._lines(None), kinds)
        texts = [self.table.column(place) for place in places] if read else self._texts(places)
        return [_numbers_if_all_are(texts.pop(0)) for _ in places]

    def _numbers(self, column: pa.ChunkedArray, place: int) -> NDArray[Any]:
        if place not in self.dates and pa.types.is_string(column.type):
            cells = pc.utf8_trim_whitespace(column)
            cells = pc.if_else(pc.match_substring_regex(cells, _NUMBER), cells, None)
            return pc.replace_substring_regex(cells, r"^[+]", "").cast(pa.float64()).to_numpy()
        return super()._numbers(column, place)

    def _texts(self, places: Sequence[int]) -> list[pa.ChunkedArray]:
        """Cells of columns."""
        # Rows as they stand, then all of the usual width, then each one by itself.
        for is_regular in (None, self._rows.are_regular, lambda _: False):
            try:
                columns = self._parse(self._lines(is_regular), dict.fromkeys(places, pa.string()))
                break
            except pa.ArrowInvalid as error:
                failed = InputError(f"{self.path}: no table: {one_line(error)}")
        else:
            raise failed
        for i, cells in enumerate(columns):
            if pc.any(pc.match_substring(cells, " ")).as_py():
                columns[i] = pc.utf8_trim_whitespace(cells)
            if self._rows.decimal == ",":
                columns[i] = pc.replace_substring_regex(columns[i], _DECIMAL_COMMA, r"\1.\2")
        return columns

    def _parse(self, lines: pa.Buffer, kinds: Mapping[int, pa.DataType]) -> list[pa.ChunkedArray]:
        """Columns of these places and types, of rows of which each has the usual width."""
        names = [str(place) for place in range(self._rows.width)]
        types = {names[place]: kind for place, kind in kinds.items()}
        with stage(f"reading {self.path.name}"):
            if not lines.size:
                return pa.schema(types).empty_table().columns
            return arrow_csv.read_csv(
                pa.BufferReader(lines),
                arrow_csv.ReadOptions(column_names=names, block_size=_BLOCK),
                arrow_csv.ParseOptions(delimiter=self._rows.delimiter or " "),
                arrow_csv.ConvertOptions(
                    column_types=types, include_columns=[*types], strings_can_be_null=False
                ),
            ).columns

    def _lines(self, are_regular: Callable[[bytes], bool] | None) -> pa.Buffer:
        """Rows of the table in UTF-8; blocks of lines that are not regular are written anew."""
        content, self._content = self._content or _read(self.path)[0], None
        self._repeated = 0
        lines = BytesIO(content)
        for _ in range(self._rows.first):
            lines.readline()
        if are_regular is None and self._rows.are_clean(content, lines.tell()):
            return pa.py_buffer(content).slice(lines.tell())
        keep = are_regular or self._rows.are_clean
        blocks = iter(lambda: lines.read(_BLOCK) + lines.readline(), b"")
        return pa.py_buffer(b"".join(b if keep(b) else self._rewritten(b) for b in blocks))

    def _rewritten(self, block: bytes) -> bytes:
        """Lines of a text as rows of the usual width, without those that are no rows."""
        lines = block.decode().split("\n")
        self._repeated += sum(line.strip() in self._rows.header for line in lines)
        rows = (self._rows.cells(line) for line in lines)
        return "".join(self._rows.join(cells) for cells in rows if cells is not None).encode()

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """See `Source`; reads the file again, which only errors and warnings need."""
        lines = enumerate(_read(self.path)[0].decode().split("\n"), 1)
        below = ((n, self._rows.cells(line)) for n, line in lines if n > self._rows.first)
        rows = ((n, cells) for n, cells in below if cells is not None)
        number, cells = next(islice(rows, row, None), (0, []))
        if not number:
            return f"row {row + 1}", "unreadable"
        if any(cells[self._rows.width :]):
            return f"line {number}", f"{len(cells)} columns instead of {self._rows.width}"
        if place >= len(cells):
            return f"line {number}", "the line ends before it"
        return f"line {number}", repr(cells[place][:40]) if cells[place] else "nothing"


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
    """

    def __init__(self, lines: Sequence[str], delimiter: str | None, decimal: str) -> None:
        self.delimiter, self.decimal, self.many = delimiter, decimal, 0
        self._comments = tuple(mark for mark in _COMMENTS if mark != delimiter)
        # Characters around a line that are no cells; None for all blanks.
        self._around = " \r\n" if delimiter == "\t" else None
        rows = [
            (i, split_line(line, delimiter))
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
        self._comment = next((c for c in "#%" for line in lines if line.lstrip()[:1] == c), "#")
        blanks = ("  ", "\t", "\n ", " \n") if delimiter is None else ()
        self._marks = [m.encode() for m in ('"', *self._comments, *self.header, *blanks)]

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

    def are_clean(self, content: bytes, start: int = 0) -> bool:
        """Whether there are, from a place on, no marks that Arrow takes for something else."""
        # A search for one mark is much faster than for several in a row.
        found = (
            content.find(mark[:1], start) >= 0 and content.find(mark, start) >= 0
            for mark in self._marks
        )
        return not content.startswith(b" ", start) and not any(found)

    def are_regular(self, block: bytes) -> bool:
        """Whether a block of lines is clean, and has as many cells as rows of the usual width."""
        delimiter, lines = (self.delimiter or " ").encode(), block.count(b"\n")
        usual = block.endswith(b"\n") and block.count(delimiter) == lines * (self.width - 1)
        return usual and b"\n\n" not in block and self.are_clean(block)

    def cells(self, line: str) -> list[str] | None:
        """Cells of a row; None of any other line."""
        if (
            not (content := line.strip(self._around))
            or content.startswith(self._comments)
            or line.strip() in self.header
        ):
            return None
        start = line.split(self._comment)[0]
        row = line if start.count('"') % 2 else start
        return split_line(row.strip(self._around), self.delimiter)

    def join(self, cells: list[str]) -> str:
        """Line of a row of the usual width; of one with more cells nobody knows which are right."""
        mark = self.delimiter or " "
        cells = [] if any(cells[self.width :]) else cells[: self.width]
        cells = [
            '"' + cell.replace('"', '""') + '"' if mark in cell or '"' in cell else cell
            for cell in cells
        ]
        return mark.join(cells + [""] * (self.width - len(cells))) + "\n"

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
            text = line.strip(self._around).lstrip("".join(self._comments)).strip(self._around)
            if not text.strip(f" \t-=+|_{self.delimiter or ''}"):  # a rule, or nothing
                continue
            cells = split_line(text, self.delimiter)
            cells = [printable(" ".join(cell.strip("\"'").split())) for cell in cells]
            if not units and any(cells) and all(unit_of_cell(c) is not None for c in cells if c):
                units, self.header = cells, (line.strip(),)
                continue
            self._take_names(cells, rows)
            if self.names is not None:
                self.header += (line.strip(),)
                if units:
                    named = zip(self.names, units + [""] * self.width, strict=False)
                    both = ((name, name and unit_of_cell(cell)) for name, cell in named)
                    self.names = [f"{name} [{unit}]" if unit else name for name, unit in both]
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


def _numbers_if_all_are(cells: pa.ChunkedArray) -> pa.ChunkedArray:
    """Cells as numbers, empty ones as null, if that loses no digit of any; as text otherwise."""
    empty = pc.equal(cells, "")
    filled = pc.if_else(empty, None, cells) if pc.any(empty).as_py() else cells
    with suppress(pa.ArrowInvalid):
        return filled.cast(pa.int64())
    with suppress(pa.ArrowInvalid):
        numbers = filled.cast(pa.float64())
        long = pc.any(pc.greater_equal(pc.abs(numbers), _LONG)).as_py()
        digits = r"^\s*[+-]?[0-9]{16,}\s*$"
        if not (long and pc.any(pc.match_substring_regex(cells, digits)).as_py()):
            return numbers
    return cells
