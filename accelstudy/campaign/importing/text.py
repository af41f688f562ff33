"""Lines of text: how their rows are written is told from them, and Arrow reads them."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from io import BytesIO, StringIO
from itertools import islice, product, takewhile
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv as arrow_csv

from accelstudy.basics.errors import InputError, printable
from accelstudy.basics.progress import stage
from accelstudy.basics.wording import plural
from accelstudy.campaign.importing.columns import unit_of_cell
from accelstudy.campaign.importing.raw_table import RawTable
from accelstudy.files.reading import readable

GZIP = b"\x1f\x8b"
"""First bytes of a gzipped file."""

_PREVIEW = 65536  # characters of a text from which the layout of its rows is told
_BLOCK = 2**22  # bytes that hold any line
_COMMENTS = ("#", "%", "//", ";")
_NO_READING = ("", "-", "--", "nan", "na", "n/a", "null", "none")
_NULLS = [each for cell in _NO_READING for each in {cell, cell.upper(), cell.title(), "NaN", "N/a"}]
_LAYOUTS = ((",", "."), *product((";", "\t", "|", None), ".,"), (",", ","))
"""Delimiters, None for blanks, with decimal marks; both commas if cells are in quotation marks."""
_LABEL = re.compile(rb"(?<![\w.])([A-Za-z_]\w*)[ \t]*[:=][ \t]*(?=[-+.\d])")
"""Name of the number that follows, as in ``ax: 0.12`` or ``ax=0.12``."""
_DECIMAL_COMMA = r"^([+-]?[0-9]*),([0-9]+([eE][+-]?[0-9]+)?)$"


@dataclass(frozen=True, eq=False)
class TextTable(RawTable):
    """The raw table of a text; its numbers are read at once, its cells as text once more."""

    rows: _Rows = field(kw_only=True)

    @classmethod
    def read(cls, path: Path) -> TextTable:
        """Read a text.

        Raises
        ------
        InputError
            If it is no table.
        """
        text, labels = _read(path)
        rows = _Rows.told_from(text, path)
        names = labels if len(labels) == rows.width else rows.names
        content = rows.parse(text, path, names or [str(i) for i in range(rows.width)])
        again = f"the header stands {plural(rows.repeated, 'more time')} between the rows"
        notes = [*rows.notes, *([again] if rows.repeated else [])]
        return cls(path, content, notes=notes, named=names is not None, rows=rows)

    def cells(self) -> pa.Table:
        """Return the columns of cells as they are written, without blanks around them."""
        text, _ = _read(self.path)
        return self.rows.parse(text, self.path, self.content.column_names, as_written=True)

    def look_up(self, row: int, place: int) -> tuple[str, str]:
        """Find a cell; this reads the file again, which only errors and warnings need."""
        lines = enumerate(_read(self.path)[0].decode().split("\n"), 1)
        below = ((n, self.rows.cells(line)) for n, line in lines if n > self.rows.first)
        of_rows = ((n, cells) for n, cells in below if cells is not None)
        number, cells = next(islice(of_rows, row, None))
        if any(cells[self.rows.width :]):
            return f"line {number}", f"{len(cells)} columns instead of {self.rows.width}"
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
    width : int, cells of a row; a row with fewer lacks the last ones
    first : int, lines before the data
    names : list of str, from the header; None without one
    header : tuple of str, lines with names and units
    notes : list of str, how the text was taken
    repeated : int, headers between the rows
    """

    def __init__(self, lines: Sequence[str], delimiter: str | None, decimal: str) -> None:
        self.delimiter, self.decimal, self.many = delimiter, decimal, 0
        self._comments = tuple(mark for mark in _COMMENTS if mark != delimiter)
        # Characters around a line that are no cells; None for all blanks.
        self._around = " \r\n" if delimiter == "\t" else None
        self.header: tuple[str, ...] = ()
        self.repeated = 0
        rows = {
            i: split_line(line, delimiter)
            for i, line in enumerate(lines)
            if line.strip() and not line.lstrip().startswith(self._comments)
        }
        numbers = {i: sum(_is_number(cell, decimal) for cell in row) for i, row in rows.items()}
        rows = {i: row for i, row in rows.items() if numbers[i]}
        self.width = _most_frequent(map(len, rows.values())) if rows else 0
        alike = {i: row for i, row in rows.items() if len(row) == self.width}
        self.score = sum(numbers[i] for i in alike)
        if not self.score:
            return
        # A line may hold text beside its numbers; everything before the first such line is the
        # header, but for rows that lack some reading.
        self.many = max(1, _most_frequent(numbers[i] for i in alike))
        full = next(i for i in alike if numbers[i] >= self.many)
        above = takewhile(
            lambda i: self._lacks(alike[i], alike[full]), reversed([i for i in alike if i < full])
        )
        self.first = min([full, *above])
        self._sample = [row for i, row in rows.items() if i >= self.first]

    @classmethod
    def told_from(cls, text: bytes, path: Path) -> _Rows:
        """Tell the delimiter and the decimal mark of a text, and read its header."""
        lines = text[:_PREVIEW].decode(errors="replace").split("\n")
        if len(text) > _PREVIEW:
            if len(lines) == 1:
                raise InputError(f"{path}: no end of a line in {_PREVIEW} characters; is it text?")
            lines.pop()  # it may be cut
        there = [layout for layout in _LAYOUTS if layout[0] is None or layout[0].encode() in text]
        tables = [cls(lines, *layout) for layout in there]
        if any(table.delimiter == "\t" and table.many >= 3 for table in tables):
            # Tabs make a log of the rows already, so blanks are those of a note.
            tables = [table for table in tables if table.delimiter is not None]
        best = max(tables, key=lambda table: table.score)
        if not best.score:
            raise InputError(f"{path}: no line of numbers at the beginning")
        best._read_header(lines)
        return best

    # --- the header ------------------------------------------------------------------------------

    def _read_header(self, lines: Sequence[str]) -> None:
        """Names from the last line before the data, which may be a comment, and units below."""
        self.names: list[str] | None = None
        self.notes: list[str] = []
        units: list[str] = []
        for number, line in reversed([*enumerate(lines[: self.first], 1)]):
            text = line.strip(self._around).lstrip("".join(self._comments)).strip(self._around)
            if not text.strip(f" \t-=+|_{self.delimiter or ''}"):  # a rule, or nothing
                continue
            cells = split_line(text, self.delimiter)
            cells = [printable(" ".join(cell.strip("\"'").split())) for cell in cells]
            if not units and any(cells) and all(map(unit_of_cell, filter(None, cells))):
                units, self.header = cells, (line.strip(),)
                continue
            if self._take_names(cells, units):
                self.header += (line.strip(),)
                self.notes += [f"units: in line {number + 1}, below the names"] if units else []
                break
            if not line.lstrip().startswith(self._comments):
                break
        if self.names is None:
            self._take_names(units, [])
        # What Arrow takes for something else.
        comment = next((c for c in "#%" for line in lines if line.lstrip()[:1] == c), "#")
        blanks = ("  ", "\t", "\n ", " \n") if self.delimiter is None else ()
        self._comment = comment
        self._marks = [m.encode() for m in ('"', *self._comments, *self.header, *blanks)]

    def _take_names(self, names: list[str], units: Sequence[str]) -> bool:
        """Take names, with units behind them, if there is one for each column."""
        longest = max(map(len, self._sample))
        while len(names) > longest and not names[-1]:
            names = names[:-1]
        empty = all(row[len(names) :][:1] == [""] for row in self._sample)
        if len(names) == self.width - 1 and empty:
            self.width = len(names)
        if self.width < len(names) == longest:
            self.width = len(names)
        if len(names) == self.width:
            of_names = (unit_of_cell(unit) for unit in [*units, *[""] * self.width])
            pairs = zip(names, of_names, strict=False)
            self.names = [f"{name} [{unit}]" if name and unit else name for name, unit in pairs]
        return self.names is not None

    def _lacks(self, cells: Sequence[str], full: Sequence[str]) -> bool:
        """Whether a row is like a full one, but for some readings."""
        return all(
            cell.lower() in _NO_READING
            or _is_number(cell, self.decimal)
            or not _is_number(like, self.decimal)
            for cell, like in zip(cells, full, strict=True)
        )

    # --- the body --------------------------------------------------------------------------------

    def parse(
        self, text: bytes, path: Path, names: Sequence[str], as_written: bool = False
    ) -> pa.Table:
        """Table of the rows: a column of numbers as such, unless cells stay as they are written."""
        firsts = [
            next((row[i] for row in self._sample if row[i : i + 1] not in ([], [""])), "")
            for i in range(self.width)
        ]
        types = {
            str(i): pa.string()
            for i, cell in enumerate(firsts)
            if as_written or not _is_number(cell, self.decimal)
        }
        start = 0
        for _ in range(self.first):
            start = text.index(b"\n", start) + 1
        # Rows as they stand, or with those written anew that are not regular, or all of them.
        clean = [] if not self._are_clean(text, start) else [None]
        for keep in (*clean, self._are_regular, lambda _: False):
            body = pa.py_buffer(text).slice(start)
            if keep is not None:
                body = pa.py_buffer(self._regular(text[start:], keep))
            with suppress(pa.ArrowInvalid), stage(f"reading {path.name}"):
                content = arrow_csv.read_csv(
                    pa.BufferReader(body),
                    arrow_csv.ReadOptions(
                        column_names=[*map(str, range(self.width))], block_size=_BLOCK
                    ),
                    arrow_csv.ParseOptions(delimiter=self.delimiter or " "),
                    arrow_csv.ConvertOptions(
                        column_types=types, null_values=_NULLS, decimal_point=self.decimal
                    ),
                )
                break
        else:
            raise InputError(f"{path}: no table")
        return pa.table([*map(self._tidied, content.columns)], names=[*names])

    def _tidied(self, column: pa.ChunkedArray) -> pa.ChunkedArray:
        """Column whose cells of text have no blanks around them, and points as decimal marks."""
        if not pa.types.is_string(column.type):
            return column
        cells = pc.utf8_trim_whitespace(column)
        if self.decimal == ",":
            cells = pc.replace_substring_regex(cells, _DECIMAL_COMMA, r"\1.\2")
        return cells

    def _regular(self, body: bytes, keep: Callable[[bytes], bool]) -> bytes:
        """Lines of which blocks are written anew, as rows of the usual width, or kept."""
        self.repeated, lines = 0, BytesIO(body)
        blocks = iter(lambda: lines.read(_BLOCK) + lines.readline(), b"")
        return b"".join(block if keep(block) else self._rewritten(block) for block in blocks)

    def _rewritten(self, block: bytes) -> bytes:
        """Rows of the usual width; of one with more cells nobody knows which are right."""
        lines, out = block.decode().split("\n"), StringIO()
        self.repeated += sum(line.strip() in self.header for line in lines)
        writer = csv.writer(out, delimiter=self.delimiter or " ", lineterminator="\n")
        for cells in filter(None, map(self.cells, lines)):
            usable = [] if any(cells[self.width :]) else cells[: self.width]
            writer.writerow(usable + [""] * (self.width - len(usable)))
        return out.getvalue().encode()

    def _are_clean(self, text: bytes, start: int = 0) -> bool:
        """Whether there are, from a place on, no marks that Arrow takes for something else."""
        # A search for one mark is much faster than for several in a row.
        found = (
            text.find(mark[:1], start) >= 0 and text.find(mark, start) >= 0 for mark in self._marks
        )
        return not text.startswith(b" ", start) and not any(found)

    def _are_regular(self, block: bytes) -> bool:
        """Whether a block of lines is clean, and has as many cells as rows of the usual width."""
        delimiter, lines = (self.delimiter or " ").encode(), block.count(b"\n")
        usual = block.endswith(b"\n") and block.count(delimiter) == lines * (self.width - 1)
        return usual and b"\n\n" not in block and self._are_clean(block)

    def cells(self, line: str) -> list[str] | None:
        """Cells of a row; None of any other line."""
        content = line.strip(self._around)
        if not content or content.startswith(self._comments) or line.strip() in self.header:
            return None
        start = line.split(self._comment)[0]
        row = line if start.count('"') % 2 else start
        return split_line(row.strip(self._around), self.delimiter)


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
            text = path.read_bytes()
            text = gzip.decompress(text) if text.startswith(GZIP) else text
    except (gzip.BadGzipFile, EOFError, zlib.error):
        raise InputError(f"{path}: not a whole gzip file") from None
    if not text.isascii() or 0 in text[:4096]:
        encoding = _encoding_of(text[:4096])
        try:
            text = text.decode(encoding).encode()
        except UnicodeDecodeError:  # what is no UTF-8 is mostly that of a Western Windows
            encoding = "cp1252" if encoding.startswith("utf-8") else encoding
            text = text.decode(encoding, errors="replace").encode()
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    first = text[:_PREVIEW].split(b"\n")
    labels, lines = Counter(tuple(_LABEL.findall(line)) for line in first).most_common(1)[0]
    if len(labels) < 3 or lines < len(first) / 3:
        return text, []
    parts = (rb"(.*?)(?<![\w.])%b[ \t]*[:=][ \t]*" % re.escape(label) for label in labels)
    row = re.compile(rb"^(?:%b(.*)|.*)$" % b"".join(parts), re.MULTILINE)
    text = row.sub(lambda line: b"".join(part or b"" for part in line.groups()), text)
    return text, [label.decode() for label in labels]


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
