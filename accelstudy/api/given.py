"""What a program gives, checked: one clear line where it is of a wrong type."""

from __future__ import annotations

from numbers import Real
from os import PathLike
from pathlib import Path
from typing import Any

from accelstudy.basics.errors import InputError, shown
from accelstudy.basics.units import Given


def of_type(name: str, value: Any, *types: type, expected: str) -> None:
    """Raise `InputError` if a value is none of the types."""
    if not isinstance(value, types):
        raise InputError(f"{name}: expected {expected}, not {shown(value)}")


def path_of(name: str, value: Any) -> Path:
    """Path that was given as one, or as text."""
    of_type(name, value, str, PathLike, expected="a path")
    return Path(value)


def quantity(name: str, value: Any, given: Given) -> float:
    """Quantity in SI: a number in SI, or text with a unit, as on the command line."""
    if not isinstance(value, bool) and isinstance(value, Real):
        value = f"{float(value)!r}{given.unit}"
    of_type(name, value, str, expected=f"a number in {given.unit} or a text with its unit")
    try:
        return given.read(value)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def table_html(title: str, verdict: str, table: Any) -> str:
    """Show a result in a notebook: what it is, its verdict, and its table."""
    from html import escape

    rows = table.to_html(border=0, float_format=lambda value: f"{value:.4g}")
    return f"<p><b>{escape(title)}</b>: {escape(verdict)}</p>{rows}"


def axes_of(ax: Any) -> Any:
    """Axes to draw in: those that are given, else those of a new figure of pyplot."""
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]
