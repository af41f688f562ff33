"""Files of the user, read: errors name the file that was read, and no file is read without end."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from accelstudy.basics.errors import InputError, shown
from accelstudy.basics.wording import one_line

LARGEST = 100_000_000
"""Bytes of the largest text that is read as a whole, more than a campaign of 100 000 positions."""


@contextmanager
def readable(path: str | Path) -> Iterator[None]:
    """Turn errors of the system on reading a file into one line that names it."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except IsADirectoryError:
        raise InputError(f"{path}: a folder; give a file") from None
    except OSError as error:
        if error.errno is None:  # not of the system, but of a library that finds the file odd
            raise
        reason = str(error.strerror or error).rpartition("] ")[2]  # Arrow puts more before it
        raise InputError(f"{path}: cannot be read: {reason}") from None


def read_text(path: str | Path) -> str:
    """Read a text in UTF-8, from a file or a pipe; line ends become those of Python.

    Raises
    ------
    InputError
        If it cannot be read, or is larger than `LARGEST`, as a device that never ends.
    UnicodeDecodeError
        If it is not UTF-8; the caller knows what it should be.
    """
    with readable(path), Path(path).open("rb") as file:
        content = file.read(LARGEST + 1)
    if len(content) > LARGEST:
        raise InputError(f"{path}: larger than {LARGEST // 10**6} MB; is it the right file?")
    return content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")


def read_json(path: str | Path, kind: str) -> Mapping[str, Any]:
    """Read a JSON file of accelstudy.

    Parameters
    ----------
    path : path
    kind : str
        What to say of a file that holds something else, such as "not a calibration.json".

    Raises
    ------
    InputError
        As `read_text`; if it is no JSON; if a newer version wrote it.
    """
    try:
        content = json.loads(read_text(path))
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        reason = "nested too deeply" if isinstance(error, RecursionError) else one_line(error)
        raise InputError(f"{path}: {kind}: {reason}") from None
    check_version(content, path)
    return content


def check_version(content: object, path: str | Path) -> None:
    """Refuse what a newer version wrote, before its keys are taken for errors."""
    version = content.get("schema_version") if isinstance(content, Mapping) else None
    if isinstance(version, int) and version > 1:
        raise InputError(
            f"{path}: schema_version: {shown(version)} is of a newer version of accelstudy; to "
            "read this file, get that version: pip install --upgrade accelstudy"
        )
