"""Where numbers come from, and where they can be written."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.basics.errors import InputError


def config_hash(config: Mapping[str, Any]) -> str:
    """Hash of everything in a configuration that the numbers of a study depend on.

    Parameters
    ----------
    config : mapping, the whole configuration with its defaults, as plain data
    """
    unused = {"angle_unit"} if config.get("schemes") else {"angle_unit", "schemes"}
    content = {key: value for key, value in config.items() if key not in unused}
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:16]


def check_writable(folder: str | Path) -> None:
    """Check that a folder and those in it can be written to, or that it can be made.

    Raises
    ------
    InputError
        If it, a folder in it, or the nearest folder above it that exists, is not writable, or is no
        folder.
    """
    folder = Path(folder)
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{folder}: cannot hold results: {nearest} is not a folder")
    inside = (Path(path) for path, _, _ in os.walk(folder))  # of the folder itself, if it is there
    for path in (nearest, *inside):
        if not os.access(path, os.W_OK | os.X_OK):
            raise InputError(f"{folder}: cannot hold results: {path} is not writable")
