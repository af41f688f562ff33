"""What a figure of a study is, the registry of figures, and how they are drawn and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from accelstudy.basics.registry import Registry
from accelstudy.basics.units import angle_note, angles_in
from accelstudy.drawing import style

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure
    import pandas as pd

    import accelstudy.study.config

# What figures are made of. These are only names for type checkers, as the workflow imports all
# figures whenever it starts: Matplotlib and pandas are imported within functions.
Axes: TypeAlias = "matplotlib.axes.Axes"
DataFrame: TypeAlias = "pd.DataFrame"
Figure: TypeAlias = "matplotlib.figure.Figure"
Study: TypeAlias = "accelstudy.study.config.Study"
Tables: TypeAlias = "Mapping[str, pd.DataFrame]"
Draw: TypeAlias = "Callable[..., Figure]"

_REGISTRY: Registry[FigureEntry] = Registry("figure")


@dataclass(frozen=True)
class FigureEntry:
    """A figure.

    Attributes
    ----------
    name, title : str
    caption : str, in reStructuredText
    draw : callable, draws it from its tables and the study
    category : str, heading under which a report lists it
    tables : tuple of str, names of the tables of the study that it draws
    when : callable, whether a study has this figure
    """

    name: str
    title: str
    caption: str
    draw: Draw
    category: str
    tables: tuple[str, ...]
    when: Callable[[Study], bool]


def register(
    name: str,
    *tables: str,
    category: str = "Study",
    when: Callable[[Study], bool] | None = None,
    **settings: Any,
) -> Callable[[Draw], Draw]:
    """Register the function that draws a figure; parameters as in `FigureEntry`.

    The first line of its docstring is the title, the rest the caption. Unless `when` says
    otherwise, studies of the paper have the figures of the category "Paper", and all studies have
    the others.
    A function that draws several figures takes `settings`, which its docstring names in braces.
    """

    def decorate(draw: Draw) -> Draw:
        text = cleandoc(draw.__doc__ or "").format(**settings)
        title, _, caption = text.partition(".\n\n")
        has_it = when or (lambda study: category != "Paper" or study.paper)
        drawn = partial(draw, **settings)
        entry = FigureEntry(name, title, caption, drawn, category, tables, has_it)
        _REGISTRY.add(name, entry, draw)
        return draw

    return decorate


def get_figure(name: str) -> FigureEntry:
    """Return the figure of that name; raise `UnknownNameError` if there is none."""
    return _REGISTRY.get(name)


def figure_names(study: Study | None = None) -> tuple[str, ...]:
    """Names of the figures that a study has, or of all that there are."""
    names = _REGISTRY.names()
    return tuple(sorted(name for name in names if study is None or get_figure(name).when(study)))


def caption(name: str, study: Study) -> str:
    """Caption of a figure, with the unit of angles in this study."""
    with angles_in(study.angle_unit):
        return f"{get_figure(name).caption}\n{angle_note()}."


def draw(name: str, tables: Tables, study: Study) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    name : str
    tables : mapping of table name to table, at least those that the figure draws
    study : Study
    """
    with style.in_style(), angles_in(study.angle_unit):
        return get_figure(name).draw(tables, study)


def write_figure(name: str, tables: Tables, study: Study, path: str | Path) -> None:
    """Draw a figure, and write it as SVG or PNG, by the ending of the path.

    The file is whole or not there at all, and the same tables give the same bytes. Parameters as in
    `draw`.
    """
    from accelstudy.drawing.saving import save

    save(draw(name, tables, study), path, get_figure(name).title, style.DPI)
