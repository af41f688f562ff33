"""What takes long to make and depends on nothing but itself: kept on disk for the next process.

Formulas and kernels are code, so whoever can write to them runs code as the user who reads them.
They are read only from a folder and a file that are the user's own and that nobody else can write.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import secrets
import shutil
import stat
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

_DIGEST = hashlib.sha256().digest_size
_OTHERS = stat.S_IWGRP | stat.S_IWOTH

Made = TypeVar("Made")


def kept_in(kind: str) -> Path:
    """Where things of a kind are kept: under `accelstudy` in the user's folder of caches."""
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(caches) / "accelstudy" / kind


def kept_or_made(
    kind: str, key: str, make: Callable[[], bytes], load: Callable[[bytes], Made]
) -> Made:
    """Return what `load` makes of the stored bytes, or of those that are made and then stored.

    What is damaged, or could have been written by somebody else, counts as not there.
    """
    with contextlib.suppress(Exception):
        return load(_kept(kind, key))
    content = make()
    with contextlib.suppress(OSError, RuntimeError):  # no right, no room, or no home folder
        _keep(kind, key, content)
    return load(content)


def _kept(kind: str, key: str) -> bytes:
    """Read what was stored; raise an error if it is not there, not whole, or not the user's own."""
    with _own_folder(kind) as folder:
        # Opened without waiting, as it may be a FIFO.
        file = os.open(key, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=folder)
        with open(file, "rb") as opened:
            _check_own(file, stat.S_ISREG)
            stored = opened.read()
    digest, content = stored[:_DIGEST], stored[_DIGEST:]
    if hashlib.sha256(content).digest() != digest:
        raise ValueError(f"{key} is damaged")
    return content


def _keep(kind: str, key: str, content: bytes) -> None:
    """Store it for the next process.

    It appears whole or not at all: processes that start together each write their own file and
    give it the name.
    """
    place = kept_in(kind)
    with contextlib.suppress(OSError):  # an earlier version left it open to the group of the user
        if place.lstat().st_mode & _OTHERS:
            shutil.rmtree(place)
    place.parent.mkdir(parents=True, exist_ok=True)
    place.mkdir(mode=0o700, exist_ok=True)
    with _own_folder(kind) as folder:
        part = f".{secrets.token_hex(8)}"
        new = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600, dir_fd=folder)
        try:
            with open(new, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(part, key, src_dir_fd=folder, dst_dir_fd=folder)
        except OSError:
            os.unlink(part, dir_fd=folder)
            raise


@contextlib.contextmanager
def _own_folder(kind: str) -> Iterator[int]:
    """Open the folder of a kind, so that nobody can put another in its place after the check."""
    if not hasattr(os, "geteuid"):
        raise OSError("this system does not say whose a file is")
    folder = os.open(kept_in(kind), os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        _check_own(folder, stat.S_ISDIR)
        yield folder
    finally:
        os.close(folder)


def _check_own(descriptor: int, is_kind: Callable[[int], bool]) -> None:
    """Raise an error unless it is of a kind, owned by the user, and writable by nobody else."""
    status = os.fstat(descriptor)
    if not is_kind(status.st_mode) or status.st_uid != os.geteuid() or status.st_mode & _OTHERS:
        raise PermissionError("others may have written here")
