"""Lines of text: how their rows are written is told from them, and Arrow reads them."""

from __future__ import annotations

import csv
import gzip
import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from io import BytesIO
from itertools import islice, product, takewhile
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import csv as arrow_csv

from accelstudy.basics.errors import InputError, printable
from accelstudy.basics.progress import stage
from accelstudy.basics.wording import one_line, plural
from accelstudy.campaign.importing.columns import unit_of_cell
from accelstudy.campaign.importing.sources import Source
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


def read_text(path: Path) -> Source:
    """Read a text; its cells stay as they are written, without blanks around them.

    Raises
    ------
    InputError
        If it is no table.
    """
    content, labels = _read(path)
    rows = _Rows.told_from(content, path)
    names = labels if len(labels) == rows.width else rows.names
    # Rows as they stand, then all of the usual width, then each one by itself.
    for is_regular in (None, rows.are_regular, lambda _: False):
        try:
            columns = rows.parse(content, is_regular, path)
            break
        except pa.ArrowInvalid as error:
            failed = InputError(f"{path}: no table: {one_line(error)}")
    else:
        raise failed
    again = f"the header stands {plural(rows.repeated, 'more time')} between the rows"
    return Source(
        path,
        pa.table(columns, names=names or [str(i) for i in range(rows.width)]),
        notes=[*rows.notes, *([again] if rows.repeated else [])],
        named=names is not None,
        locate=partial(_look_up, path, rows),
    )


def _look_up(path: Path, rows: _Rows, row: int, place: int) -> tuple[str, str]:
    """Find a cell; this reads the file again, which only errors and warnings need."""
    lines = enumerate(_read(path)[0].decode().split("\n"), 1)
    below = ((n, rows.cells(line)) for n, line in lines if n > rows.first)
    number, cells = next(islice(((n, c) for n, c in below if c is not None), row, None), (0, []))
    if not number:
        return f"row {row + 1}", "unreadable"
    if any(cells[rows.width :]):
        return f"line {number}", f"{len(cells)} columns instead of {rows.width}"
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
    repeated : int, headers between the rows
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
        self.repeated = 0
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

    def parse(
        self, content: bytes, are_regular: Callable[[bytes], bool] | None, path: Path
    ) -> list[pa.ChunkedArray]:
        """Cells of the columns; blocks of lines that are not regular are written anew before."""
        self.repeated = 0
        lines = BytesIO(content)
        for _ in range(self.first):
            lines.readline()
        start = lines.tell()
        text = pa.py_buffer(content).slice(start)
        if are_regular is not None or not self.are_clean(content, start):
            keep = are_regular or self.are_clean
            blocks = iter(lambda: lines.read(_BLOCK) + lines.readline(), b"")
            text = pa.py_buffer(b"".join(b if keep(b) else self._rewritten(b) for b in blocks))
        types = {str(place): pa.string() for place in range(self.width)}
        if not text.size:
            return pa.schema(types).empty_table().columns
        with stage(f"reading {path.name}"):
            columns = arrow_csv.read_csv(
                pa.BufferReader(text),
                arrow_csv.ReadOptions(column_names=[*types], block_size=_BLOCK),
                arrow_csv.ParseOptions(delimiter=self.delimiter or " "),
                arrow_csv.ConvertOptions(column_types=types, strings_can_be_null=False),
            ).columns
        if content.find(b" ", start) >= 0:
            columns = [*map(pc.utf8_trim_whitespace, columns)]
        if self.decimal == ",":
            columns = [pc.replace_substring_regex(c, _DECIMAL_COMMA, r"\1.\2") for c in columns]
        return columns

    def _rewritten(self, block: bytes) -> bytes:
        """Lines of a text as rows of the usual width, without those that are no rows."""
        lines = block.decode().split("\n")
        self.repeated += sum(line.strip() in self.header for line in lines)
        rows = (self.cells(line) for line in lines)
        return "".join(self.join(cells) for cells in rows if cells is not None).encode()

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
