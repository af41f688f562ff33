"""Schemes in YAML files, such as `accelstudy design` writes.

A scheme of a file has the name that the file gives, with a digest of its directions. So results
depend on the content of the file, and not on its path.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.names import check_path_name, path_name
from accelstudy.files.reading import read_layer
from accelstudy.positions.scheme import Scheme

KEYS = ("scheme", "title", "source", "directions", "positions", "design")
"""Keys of a file. Only `directions` is required; the last two are for people and not read."""

_read: dict[str, Scheme] = {}


def is_scheme_file(text: str) -> bool:
    """Whether a text that names a scheme is a path: it has a separator or ends in .yaml or .yml."""
    return re.fullmatch(rf".*(?:\.ya?ml|[/{re.escape(os.sep)}].*)", text) is not None


def scheme_of_file(path: str | Path) -> Scheme:
    """Read a scheme; from then on `known_scheme` finds it by its name.

    Raises
    ------
    InputError
        One line that names the file, the key, what is wrong and what would be right.
    """
    content = read_layer(path)
    try:
        scheme = parse_scheme(content, Path(path).stem)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return _read.setdefault(scheme.name, scheme)


def known_scheme(name: str) -> Scheme | None:
    """Return a scheme that was read from a file before, by its name with the digest."""
    return _read.get(name)


def parse_scheme(content: Mapping[str, Any], name: str) -> Scheme:
    """Make a scheme of the content of a file.

    Parameters
    ----------
    content : mapping
    name : str, of the scheme if the content gives none
    """
    for key in content:
        if key not in KEYS:
            raise UnknownNameError("key", key, KEYS)
    texts = {
        "scheme": path_name(name, "scheme"),
        "title": "of a file",
        "source": "",
        **{key: content[key] for key in KEYS[:3] if content.get(key) is not None},
    }
    for key, text in texts.items():
        if not isinstance(text, str):
            raise InputError(f"{key}: must be a text")
    try:
        check_path_name(texts["scheme"])
    except InputError as error:
        raise InputError(f"scheme: {error}") from None
    directions = _directions(content.get("directions"))
    unnamed = Scheme("", "", directions, "generated", "")
    digest = hashlib.sha256(unnamed.directions.tobytes()).hexdigest()[:8]
    return Scheme(
        name=f"{texts['scheme']}@{digest}",
        title=f"{len(directions)} {texts['title']}",
        directions=unnamed.directions,
        status="generated",
        source=texts["source"],
    )


def _directions(entry: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    wrong = "directions: must be a list of rows of three numbers, gravity in the body frame"
    if not isinstance(entry, Sequence) or isinstance(entry, str) or not entry:
        raise InputError(wrong)
    for number, row in enumerate(entry, start=1):
        numbers = isinstance(row, Sequence) and all(
            isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e100 for x in row
        )
        if not numbers or len(row) != 3 or not np.linalg.norm(row) > 0:
            raise InputError(f"{wrong}; row {number} is not")
    return np.asarray(entry, dtype=float)
