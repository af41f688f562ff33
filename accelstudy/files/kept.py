"""What takes long to make and depends on nothing but itself: kept on disk for the next process."""

from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path

_DIGEST = hashlib.sha256().digest_size


def kept_in(kind: str) -> Path:
    """Where things of a kind are kept: under `accelstudy` in the user's folder of caches."""
    caches = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(caches) / "accelstudy" / kind


def kept_or_made(kind: str, key: str, make: Callable[[], bytes]) -> bytes:
    """Return what was made before, or make it and keep it."""
    content = _kept(kind, key)
    if content is None:
        content = make()
        _keep(kind, key, content)
    return content


def _kept(kind: str, key: str) -> bytes | None:
    """Return what was made before, if it is there and whole."""
    try:
        stored = (kept_in(kind) / key).read_bytes()
    except (OSError, RuntimeError):  # there is no home folder
        return None
    digest, content = stored[:_DIGEST], stored[_DIGEST:]
    return content if hashlib.sha256(content).digest() == digest else None


def _keep(kind: str, key: str, content: bytes) -> None:
    """Keep it for the next process, where that can be written.

    It appears whole or not at all: processes that start together each write their own file and
    give it the name.
    """
    with contextlib.suppress(OSError, RuntimeError):
        folder = kept_in(kind)
        folder.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=folder)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(hashlib.sha256(content).digest() + content)
            os.replace(name, folder / key)
        except OSError:
            os.unlink(name)
            raise
