"""Schemes in YAML files, by their paths, and afterwards by their names."""

from __future__ import annotations

import os
import re
from pathlib import Path

from accelstudy.files.reading import read_layer
from accelstudy.positions.scheme import Scheme

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
    from accelstudy.positions.scheme_file import parse_scheme  # slow, and jobs read no schemes

    scheme = parse_scheme(read_layer(path), Path(path).stem, path)
    return _read.setdefault(scheme.name, scheme)


def known_scheme(name: str) -> Scheme | None:
    """Return a scheme that was read from a file before, by its name with the digest."""
    return _read.get(name)
