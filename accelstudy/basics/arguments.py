"""What a program gives, checked: one clear line where it is of a wrong type."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import isfinite
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any

from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, brief, locate_errors
from accelstudy.basics.names import check_file_name
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
        value = f"{float(value)!r} {kind.unit}"  # the unit may begin with a digit, as 1/K does
    check_type(name, value, str, expected=f"a number in {kind.unit} or a text with its unit")
    with locate_errors(name):
        return kind.read(value)


def tidy(value: float, digits: int = 12) -> float:
    """Round a quantity in the unit of a file, so that 3.2 mgon stays that number."""
    return float(f"{value:.{digits}g}") + 0.0  # -0.0 becomes 0.0


def as_sequence(value: Any) -> Sequence[Any]:
    """One or several values as a sequence; a text is one."""
    several = not isinstance(value, str | bytes | Mapping) and hasattr(value, "__iter__")
    return tuple(value) if several else (value,)


def check_once(paths: Sequence[Any], what: str) -> None:
    """Raise `InputError` if a path is given twice of which each stands for one thing."""
    seen = set()
    for path in (one for one in paths if isinstance(one, str | PathLike)):
        if (place := Path(path).resolve()) in seen:
            raise InputError(f"{path}: is given twice; each {what} counts once")
        seen.add(place)
