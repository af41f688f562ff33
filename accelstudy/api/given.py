"""What a program gives, checked: one clear line where it is of a wrong type."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import isfinite
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, shown
from accelstudy.basics.names import check_file_name
from accelstudy.basics.units import Given

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GRAVITY = Given("m/s^2", "", bounds.GRAVITY.least, bounds.GRAVITY.most, True)
SIGMA_READING = Given("m/s^2", "", 0.0, bounds.SIGMA_READING.most, True)
START = Given("s", "", 0.0, bounds.TIME.most, True)
LAYOUT = (
    *("columns", "time", "time_unit", "rate", "delimiter", "variable"),
    *("unit", "scale", "offset", "frame"),
)
"""Keywords that say how a log is read."""


def of_type(name: str, value: Any, *types: type, expected: str) -> None:
    """Raise `InputError` if a value is none of the types."""
    if not isinstance(value, types):
        raise InputError(f"{name}: expected {expected}, not {shown(value)}")


def path_of(name: str, value: Any, expected: str = "a path") -> Path:
    """Path that was given as one, or as text."""
    of_type(name, value, str, PathLike, expected=expected)
    check_file_name(value)
    return Path(value)


def whole(name: str, value: Any, allowed: Range) -> int:
    """Whole number within a range."""
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise InputError(f"{name}: expected a whole number, not {shown(value)}")
    allowed.check_key(name, int(value))
    return int(value)


def quantity(name: str, value: Any, given: Given) -> float:
    """Quantity in SI: a number in SI, or text with a unit, as on the command line."""
    if not isinstance(value, bool) and isinstance(value, Real) and isfinite(value):
        value = f"{float(value)!r} {given.unit}"  # the unit may begin with a digit, as 1/K does
    of_type(name, value, str, expected=f"a number in {given.unit} or a text with its unit")
    try:
        return given.read(value)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def tidy(value: float) -> float:
    """Round a quantity in the unit of a file, so that 3.2 mgon stays that number."""
    return float(f"{value:.12g}")


def each(value: Any) -> Sequence[Any]:
    """One or several values as a sequence; a text is one."""
    several = not isinstance(value, str | bytes | Mapping) and hasattr(value, "__iter__")
    return tuple(value) if several else (value,)


def names(name: str, value: Any) -> tuple[str, ...]:
    """One name or several."""
    for one in each(value):
        of_type(name, one, str, expected="a name, or several")
    return tuple(each(value))


@contextmanager
def drawing(ax: Any, width: float, height_mm: float) -> Iterator[Axes]:
    """Draw in the style of all figures: into given axes, else into those of a new figure of pyplot.

    Parameters
    ----------
    ax : Axes, or None
    width, height_mm : float, of the new figure; the width in inches
    """
    import matplotlib as mpl

    from accelstudy.drawing.style import MM, STYLE

    figure = None
    if ax is None:
        import matplotlib.pyplot as plt

        # A notebook gets ready to show figures at its first one, and the style would undo that.
        figure = plt.figure(figsize=(width, height_mm * MM), layout="constrained")
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        ax = ax if figure is None else figure.add_subplot()
        yield ax
        for axis in (ax.xaxis, ax.yaxis):
            axis.get_major_ticks()  # made in this style, and not where the figure is shown
