"""The table of positions as it is in its file: columns by name, not yet checked."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.files.checks import check_names
from accelstudy.campaign.files.header import KNOWN
from accelstudy.files.parquet import whole_parquet
from accelstudy.files.reading import read_text

MOST_NAMED = 5
"""Unknown columns of which each has a line."""

Columns = Mapping[str, Sequence[Any]]


def read_positions(path: Path) -> tuple[Columns, list[str]]:
    """Read the columns of a table, as text from CSV and as values from Parquet.

    Returns
    -------
    columns : mapping of name to values
    warnings : list of str

    Raises
    ------
    InputError
        If the file is missing or incomplete, or a column occurs twice.
    """
    columns, odd = (_read_csv if path.suffix == ".csv" else _read_parquet)(path)
    return columns, odd + ignored_in(columns, path)


def ignored_in(columns: Columns, path: Path) -> list[str]:
    """Warnings about columns that the format does not know."""
    unknown = [name for name in columns if name not in KNOWN]
    if len(unknown) > MOST_NAMED:
        first = ", ".join(one_line(repr(name), 30) for name in unknown[:MOST_NAMED])
        return [f"{path}: {len(unknown)} columns are not known and ignored: {first}, …"]
    return [_ignored(path, name) for name in unknown]


def _read_csv(path: Path) -> tuple[Columns, list[str]]:
    """Columns of text, and warnings."""
    try:
        text = read_text(path)
    except UnicodeDecodeError as error:
        raise _not_whole(path, error) from None
    columns = columns_of(text, path)
    # Half a number is a number, too: if the file was cut there, only the line end is missing.
    whole = text.endswith(("\n", "\r"))
    odd = [] if whole else [f"{path}: the last line does not end; check that it is whole"]
    return columns, odd


def columns_of(text: str, path: Path) -> Columns:
    """Columns of the text of a CSV table; errors name `path`."""
    try:
        reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
        lines = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise _not_whole(path, error) from None
    if not lines:
        raise InputError(f"{path}: empty; expected a line of column names, position, fx, fy, fz …")
    names = [name.strip() for name in lines[0][1]]
    if len(names) == 1 and (mark := next((m for m in ";\t" if m in names[0]), None)):
        raise InputError(f"{path}: columns are separated by {mark!r}; a comma would be right")
    for line, row in lines[1:]:
        if len(row) != len(names):
            raise InputError(
                f"{path}: line {line}: {len(row)} values for {len(names)} columns; "
                "is the file whole?"
            )
    check_names(names, path)
    return {name: [row[i] for _, row in lines[1:]] for i, name in enumerate(names)}


def _not_whole(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: not a whole CSV file in UTF-8 ({one_line(error)})")


def _read_parquet(path: Path) -> tuple[Columns, list[str]]:
    """Columns of Python values, and no warnings; unknown columns are not read."""
    with whole_parquet(path) as file:
        names = [str(name) for name in file.schema_arrow.names]
        check_names(names, path)
        table = file.read(columns=[name for name in names if name in KNOWN])
        return {n: table[n].to_pylist() if n in KNOWN else () for n in names}, []


def _ignored(path: Path, name: str) -> str:
    near = get_close_matches(name[:100], KNOWN, n=1)
    hint = f"; did you mean {near[0]!r}?" if near else ""
    return f"{path}: column {one_line(repr(name))} is not known and ignored{hint}"
