"""The figures by their names, and how one is drawn and written."""

from __future__ import annotations

import os
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Registry
from accelstudy.basics.units import ANGLE_UNITS, angle_note, angles_in
from accelstudy.study.figures.entries import FigureEntry, Tables, all_figures

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

ANGLE_UNIT_VARIABLE = "ACCELSTUDY_ANGLE_UNIT"


@cache
def _registry() -> Registry[FigureEntry]:
    registry: Registry[FigureEntry] = Registry("figure")
    for entry in all_figures():
        registry.add(entry.name, entry)
    return registry


def get_figure(name: str) -> FigureEntry:
    """Return the figure of that name; raise `UnknownNameError` if there is none."""
    return _registry().get(name)


def figure_names(study: StudyConfig) -> tuple[str, ...]:
    """Names of the figures that a study has."""
    return tuple(sorted(name for name in _registry().names() if get_figure(name).when(study)))


def figure_tables(*names: str) -> tuple[str, ...]:
    """Names of the tables that some figures need."""
    return tuple(dict.fromkeys(table for name in names for table in get_figure(name).tables))


def draw(name: str, tables: Tables, study: StudyConfig) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    name : str
    tables : mapping of table name to table, at least those of `figure_tables`
    study : StudyConfig
    """
    import matplotlib as mpl

    from accelstudy.drawing.style import STYLE

    entry = get_figure(name)
    with mpl.rc_context(STYLE), angles_in(angle_unit(study)):  # type: ignore[arg-type]
        return entry.draw(tables, study, **entry.settings)


def caption_notes(names: Iterable[str], study: StudyConfig) -> dict[str, str]:
    """What captions say of a study, by their names: what it varies, and the unit of angles.

    Parameters
    ----------
    names : names of figures; the notes of those that share a caption are joined
    study : StudyConfig
    """
    notes: dict[str, list[str]] = {}
    angles: dict[str, str] = {}
    with angles_in(angle_unit(study)):
        for entry in map(get_figure, names):
            notes.setdefault(entry.caption, []).append(entry.note(study))
            if entry.angles:
                angles[entry.caption] = f"{angle_note()}."
    return {name: " ".join(filter(None, [*its, angles.get(name)])) for name, its in notes.items()}


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
    from accelstudy.drawing.saving import save
    from accelstudy.drawing.style import DPI

    save(draw(name, tables, study), svg_path, png_path, get_figure(name).title, DPI)
