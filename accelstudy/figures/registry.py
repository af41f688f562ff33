"""The registry of figures, and how one is drawn and written."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure

from accelstudy.errors import InputError
from accelstudy.figures.saving import save
from accelstudy.figures.style import DPI, STYLE
from accelstudy.registry import Registry, import_modules
from accelstudy.study.config import StudyConfig
from accelstudy.units import ANGLE_UNITS, angle_note, angles_in

ANGLE_UNIT_VARIABLE = "ACCELSTUDY_ANGLE_UNIT"
Tables = Mapping[str, pd.DataFrame]
Draw = Callable[[Tables, StudyConfig], Figure]

TABLES = ("cells", "summary", "correlations", "leveling", "quantiles", "sensitivity", "shapley")
"""What a figure may ask for."""


@dataclass(frozen=True)
class FigureEntry:
    """A registered figure.

    Attributes
    ----------
    name, title, category : str
    tables : tuple of str, those of `TABLES` that it draws
    when : callable, whether a study has this figure
    caption : str, name of the caption; figures of one kind share one
    note : callable, what the caption says of this study beside that
    angles : bool, whether it shows angles, whose unit the caption then explains
    draw : callable, takes the tables and the study
    """

    name: str
    title: str
    category: str
    tables: tuple[str, ...]
    when: Callable[[StudyConfig], bool]
    caption: str
    note: Callable[[StudyConfig], str]
    angles: bool
    draw: Draw


_registry: Registry[FigureEntry] = Registry("figure")


@cache
def _all_figures() -> Registry[FigureEntry]:
    """All figures; a module registers its own when it is imported, which takes a while."""
    import_modules(__package__, [str(Path(__file__).parent)])
    return _registry


def get_figure(name: str) -> FigureEntry:
    """Return the figure of that name; raise `UnknownNameError` if there is none."""
    return _all_figures().get(name)


def figure(
    name: str,
    *,
    title: str,
    category: str,
    tables: tuple[str, ...] = (),
    when: Callable[[StudyConfig], bool] = lambda study: True,
    caption: str | None = None,
    note: Callable[[StudyConfig], str] = lambda study: "",
    angles: bool = True,
) -> Callable[[Draw], Draw]:
    """Register the decorated function as a figure; the arguments are those of `FigureEntry`.

    Raises
    ------
    ValueError
        If the name is taken or a table is not one of `TABLES`.
    """
    _registry.check_free(name)
    if unknown := set(tables) - set(TABLES):
        raise ValueError(f"figure {name!r}: no such tables: {', '.join(sorted(unknown))}")

    def decorate(function: Draw) -> Draw:
        entry = FigureEntry(
            name, title, category, tables, when, caption or name, note, angles, function
        )
        _registry.add(name, entry)
        return function

    return decorate


def figure_names(study: StudyConfig) -> tuple[str, ...]:
    """Names of the figures that a study has."""
    return tuple(sorted(name for name in _all_figures().names() if get_figure(name).when(study)))


def figure_tables(name: str) -> tuple[str, ...]:
    """Names of the tables that a figure needs."""
    return get_figure(name).tables


def draw(name: str, tables: Tables, study: StudyConfig) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    name : str
    tables : mapping of table name to table, at least those of `figure_tables`
    study : StudyConfig
    """
    with mpl.rc_context(STYLE), angles_in(angle_unit(study)):  # type: ignore[arg-type]
        return get_figure(name).draw(tables, study)


def caption(name: str, text: str, study: StudyConfig) -> str:
    """Complete the caption of a figure by what it says of this study and by the unit of angles.

    Parameters
    ----------
    name : str
    text : str, what the caption says of the figure in every study
    study : StudyConfig
    """
    entry = get_figure(name)
    with angles_in(angle_unit(study)):
        parts = [text.strip(), entry.note(study), f"{angle_note()}." if entry.angles else ""]
    return " ".join(filter(None, parts)) + "\n"


def angle_unit(study: StudyConfig) -> str | None:
    """Unit of angles in figures: that of the study or, where it names none, of the user.

    Raises
    ------
    InputError
        If the environment variable of the user names no such unit.
    """
    unit = study.angle_unit or os.environ.get(ANGLE_UNIT_VARIABLE) or None
    if unit not in (None, *ANGLE_UNITS):
        known = " or ".join(ANGLE_UNITS)
        raise InputError(f"{ANGLE_UNIT_VARIABLE}: {unit!r} is no unit of angles; choose {known}")
    return unit


def render(
    name: str, tables: Tables, study: StudyConfig, svg_path: str | Path, png_path: str | Path
) -> None:
    """Draw a figure and write it as SVG and PNG, each whole or not at all.

    The same tables give the same bytes. Parameters as in `draw`.
    """
    save(draw(name, tables, study), svg_path, png_path, get_figure(name).title, DPI)
