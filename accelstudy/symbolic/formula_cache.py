"""What is made of formulas, kept on disk: processes with the same model trace it once.

It is kept under a key of everything on which it depends: what the formulas are of, the files of
this package that have a part in them, and the versions of Python, SymPy and NumPy, whose functions
gave the formulas their numbers.
"""

from __future__ import annotations

import hashlib
import marshal
import sys
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import accelstudy
from accelstudy.files.cache import cached

KIND = "formulas"
"""Under which it is kept."""
ROOMS = (
    *("basics", "files", "symbolic", "effects", "leveling", "approaches"),
    *("sensors", "adjustment", "kernel"),
)
"""Folders of the package with all that formulas, and what is made of them, depend on."""

Made = TypeVar("Made")


def key_of(*parts: Callable[..., Any] | str) -> str | None:
    """Key of what is made of some classes or functions; None if not all are of this package.

    Of a class that was made while the program ran, the key has the attributes. A class of somebody
    else may depend on anything, so nothing of it is kept.
    """
    described = [_described(part) for part in parts]
    if None in described:
        return None
    return hashlib.sha256("\n".join((*_versions(), *map(str, described))).encode()).hexdigest()


def cached_by_key(key: str | None, name: str, make: Callable[[], Made]) -> Made:
    """Return what `make` makes, or what it made before of the same key.

    It is made of tuples, numbers, texts and code objects.
    """
    if key is None:
        return make()
    dumped = lambda: marshal.dumps(make())  # type: ignore[arg-type]  # noqa: E731
    module: Made = cached(KIND, f"{key}-{name}", dumped, marshal.loads)
    return module


def _described(part: Callable[..., Any] | str) -> str | None:
    if isinstance(part, str):
        return part
    classes = part.__mro__[:-1] if isinstance(part, type) else (part,)
    texts = []
    for each in classes:
        own = vars(each)
        functions = [each, *(value for value in own.values() if callable(value))]
        if any(f.__module__.split(".")[0] != accelstudy.__name__ for f in functions):
            return None
        data = {k: v for k, v in own.items() if isinstance(v, str | int | float | tuple)}
        texts.append(f"{each.__module__} {each.__qualname__} {data}")
    return "\n".join(texts)


@cache
def _versions() -> tuple[str, ...]:
    """All on which formulas depend, beside what they are of."""
    root = Path(accelstudy.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(path for room in ROOMS for path in (root / room).rglob("*.py")):
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    # NumPy rounds its functions in as many ways as there are processors.
    processor = np.show_config(mode="dicts").get("SIMD Extensions")
    return digest.hexdigest(), sys.version, version("sympy"), np.__version__, str(processor)
