"""A cache on disk of what takes long to make and depends on nothing but its key.

Formulas and kernels are code, so whoever can write to them runs code as the user who reads them.
They are read only from a folder and a file that are the user's own and that nobody else can write.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from accelstudy.files.outputs import whole_file

_DIGEST = hashlib.sha256().digest_size
_OTHERS = stat.S_IWGRP | stat.S_IWOTH

Made = TypeVar("Made")


def cache_folder(kind: str) -> Path:
    """Folder of the cache of a kind, under `accelstudy` in the user's folder of caches."""
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(caches) / "accelstudy" / kind


def cached(kind: str, key: str, make: Callable[[], bytes], load: Callable[[bytes], Made]) -> Made:
    """Return the cached value, computing it if necessary.

    What is damaged, or could have been written by somebody else, counts as not there.

    Parameters
    ----------
    kind, key : str, name of the cache, and of the value in it
    make : function that gives the bytes to store
    load : function that makes the value of these bytes
    """
    with contextlib.suppress(Exception):
        return load(_read(cache_folder(kind) / key))
    content = make()
    with contextlib.suppress(OSError, RuntimeError):  # no right, no room, or no home folder
        _write(cache_folder(kind) / key, content)
    return load(content)


def _read(file: Path) -> bytes:
    """Read what was stored; raise an error if it is not there, not whole, or not the user's own."""
    _check_own(file.parent, stat.S_ISDIR)
    _check_own(file, stat.S_ISREG)
    stored = file.read_bytes()
    digest, content = stored[:_DIGEST], stored[_DIGEST:]
    if hashlib.sha256(content).digest() != digest:
        raise ValueError(f"{file} is damaged")
    return content


def _write(file: Path, content: bytes) -> None:
    """Store it for the next process, whole or not at all, and readable by the user alone."""
    folder = file.parent
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o700, exist_ok=True)
    _check_own(folder, stat.S_ISDIR)
    with whole_file(file) as part:
        part.touch(mode=0o600)
        part.write_bytes(hashlib.sha256(content).digest() + content)


def _check_own(path: Path, is_kind: Callable[[int], bool]) -> None:
    """Raise an error unless it is of a kind, owned by the user, and writable by nobody else.

    In a folder of which this is so, nobody can put something else in a place after the check.
    """
    status = path.lstat()
    if not is_kind(status.st_mode) or status.st_uid != os.geteuid() or status.st_mode & _OTHERS:
        raise PermissionError("others may have written here")
