"""Names that become names of files and folders."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from errno import ENAMETOOLONG
from glob import glob, has_magic
from pathlib import Path

from accelstudy.basics.errors import InputError, brief

MAX_NAME_BYTES = 100
"""Bytes. Endings are added to a name, and the name of a file must stay below 255 bytes."""


def path_name(text: str, otherwise: str) -> str:
    """Make the name of a file or folder of any text; `otherwise`, if it has no usable letter."""
    name = re.sub(r"[^\w.-]+", "-", text).lstrip(".-").encode()[:MAX_NAME_BYTES]
    return name.decode(errors="ignore") or otherwise


def distinct(names: Sequence[str]) -> list[str]:
    """Return names that differ: equal ones get their number among all names behind them."""
    numbered = [f"{name}-{number}" for number, name in enumerate(names, start=1)]
    several = {name for name, count in Counter(names).items() if count > 1}
    own = [new if name in several else name for name, new in zip(names, numbered, strict=True)]
    return own if len({*own}) == len(own) else numbered


def check_path_name(name: str) -> str:
    """Return the name if it can name a folder on any disk and in any pattern of the workflow.

    Raises
    ------
    InputError
        If it has other characters than letters, digits, _, - and ., begins with - or ., or is
        longer than `MAX_NAME_BYTES`.
    """
    if not re.fullmatch(r"\w[\w.-]*", name):
        raise InputError(
            f"{brief(name)} cannot be the name of a folder; use letters, digits, _, - and ., and "
            "begin with a letter, a digit or _"
        )
    if len(name.encode()) > MAX_NAME_BYTES:
        raise InputError(
            f"{brief(name)} is too long for a folder; use at most {MAX_NAME_BYTES} letters"
        )
    return name


def check_file_name(path: str | os.PathLike[str]) -> None:
    """Raise `InputError` for a path that no file can have, or whose name no page could show."""
    try:
        os.fspath(path).encode()
        os.lstat(path)
    except (TypeError, AttributeError):
        raise InputError(f"expected the path of a file, not {brief(path)}") from None
    except ValueError:  # not UTF-8, or with a zero
        raise InputError(f"{brief(str(path))}: no name of a file in UTF-8") from None
    except OSError as error:
        if error.errno == ENAMETOOLONG:
            raise InputError(f"{brief(str(path))}: too long for the name of a file") from None


def natural(path: str | Path) -> list[tuple[int, str]]:
    """Key by which numbers in names count as such: sensor-2 comes before sensor-10."""
    parts = re.split(r"([0-9]+)", str(path))
    return [(int(part), "") if part.isdigit() else (0, part) for part in parts]


def matches(path: str | Path, wanted: Callable[[str], bool]) -> list[str] | None:
    """Paths that match a pattern and are wanted, pos2 before pos10; None of a path that is none."""
    if os.path.exists(path) or not has_magic(str(path)):
        return None
    return sorted(filter(wanted, glob(str(path))), key=natural)
