"""The registry of figures, and how one is drawn and written."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import pandas as pd
from matplotlib.figure import Figure

from accelstudy.figures.saving import save
from accelstudy.figures.style import DPI, STYLE
from accelstudy.registry import Registry
from accelstudy.study.config import StudyConfig
from accelstudy.units import angle_note, angles_in

Tables = Mapping[str, pd.DataFrame]
Draw = Callable[[Tables, StudyConfig], Figure]

TABLES = ("cells", "summary", "correlations", "leveling", "sensitivity", "estimates")
"""What a figure may ask for; of the estimates it gets those of the paper's two cells only."""


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
get_figure = _registry.get


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
    return tuple(sorted(name for name in _registry.names() if get_figure(name).when(study)))


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
    with mpl.rc_context(STYLE), _angles_of(study):  # type: ignore[arg-type]
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
    with _angles_of(study):
        parts = [text.strip(), entry.note(study), f"{angle_note()}." if entry.angles else ""]
    return " ".join(filter(None, parts)) + "\n"


def _angles_of(study: StudyConfig) -> AbstractContextManager[None]:
    """Show angles in the unit of the study or, where it names none, of the user."""
    return angles_in(study.angle_unit or os.environ.get("ACCELSTUDY_ANGLE_UNIT"))


def render(
    name: str, tables: Tables, study: StudyConfig, svg_path: str | Path, png_path: str | Path
) -> None:
    """Draw a figure and write it as SVG and PNG, each whole or not at all.

    The same tables give the same bytes. Parameters as in `draw`.
    """
    save(draw(name, tables, study), svg_path, png_path, get_figure(name).title, DPI)
