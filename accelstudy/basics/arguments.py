"""What a program gives, checked: one clear line where it is of a wrong type."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from io import IOBase
from math import isfinite
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any

from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, brief, locate_errors
from accelstudy.basics.names import check_file_name, matches
from accelstudy.basics.units import InputQuantity


def check_type(name: str, value: Any, *types: type, expected: str) -> None:
    """Raise `InputError` if a value is none of the types."""
    if not isinstance(value, types):
        raise InputError(f"{name}: expected {expected}, not {brief(value)}")


def path_of(name: str, value: Any, expected: str = "a path") -> Path:
    """Path that was given as one, or as text."""
    check_type(name, value, str, PathLike, expected=expected)
    check_file_name(value)
    return Path(value)


def whole_number(name: str, value: Any, allowed: Range) -> int:
    """Whole number within a range, also as text, as on the command line."""
    if isinstance(value, str) and re.fullmatch(r"\s*[+-]?\d{1,30}\s*", value):
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"{name}: expected a whole number, not {brief(value)}")
    allowed.check_key(name, int(value))
    return int(value)


def quantity(name: str, value: Any, kind: InputQuantity) -> float:
    """Quantity in SI: a number in SI, or text with a unit, as on the command line."""
    if not isinstance(value, bool) and isinstance(value, Real) and isfinite(value):
        # The unit may begin with a digit, as 1/K does; a share has none.
        kind, value = replace(kind, bare=True), f"{float(value)!r} {kind.unit}".removesuffix(" 1")
    check_type(name, value, str, expected=f"a number in {kind.unit} or a text with its unit")
    with locate_errors(name):
        return kind.read(value)


def tidy(value: float, digits: int = 12) -> float:
    """Round a quantity in the unit of a file, so that 3.2 mgon stays that number."""
    return float(f"{value:.{digits}g}") + 0.0  # -0.0 becomes 0.0


def to_python(value: Any) -> Any:
    """Scalar of NumPy as that of Python; anything else as it is."""
    return value.item() if getattr(value, "shape", None) == () else value


def as_sequence(value: Any) -> Sequence[Any]:
    """One or several values as a sequence; a text is one, and so is an open file."""
    one = isinstance(value, str | bytes | Mapping | IOBase) or not hasattr(value, "__iter__")
    return (value,) if one else tuple(map(to_python, value))


def paths_of(given: Any, what: str, wanted: Callable[[str], bool]) -> list[Any]:
    """Paths in place of the patterns that they match; anything else stands for itself.

    Raises
    ------
    InputError
        If there is none, or a path is given twice, of which each stands for one thing.
    """
    each: list[Any] = []
    for one in as_sequence(given):
        matching = matches(Path(one), wanted) if isinstance(one, str | PathLike) else None
        if matching == []:
            raise InputError(f"{one}: no {what} there")
        each += [one] if matching is None else map(Path, matching)
    if not each:
        raise InputError(f"expected one {what} or several")
    seen = set()
    for path in (one for one in each if isinstance(one, str | PathLike)):
        if (place := os.path.realpath(path)) in seen:
            raise InputError(f"{path}: is given twice; each {what} counts once")
        seen.add(place)
    return each
