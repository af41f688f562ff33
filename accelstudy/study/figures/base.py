"""What a figure of a study is, and the registry of figures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from inspect import cleandoc
from typing import TYPE_CHECKING, TypeAlias

from accelstudy.basics.registry import Registry

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig

Tables: TypeAlias = "Mapping[str, pd.DataFrame]"
Draw: TypeAlias = "Callable[[Tables, StudyConfig], Figure]"

TABLES = (
    *("cells", "summary", "correlations", "leveling", "quantiles"),
    *("sensitivity", "shapley"),
)
"""Names of the tables that a figure may need."""

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
    tables : tuple of str, those of `TABLES` that it draws
    when : callable, whether a study has this figure
    note : callable, returns what the caption adds for this study
    angles : bool, whether it shows angles; then the caption explains their unit
    """

    name: str
    title: str
    caption: str
    draw: Draw
    category: str
    tables: tuple[str, ...]
    when: Callable[[StudyConfig], bool]
    note: Callable[[StudyConfig], str]
    angles: bool


def register(
    name: str,
    title: str,
    caption: str,
    *,
    category: str = "Study",
    tables: tuple[str, ...] = (),
    when: Callable[[StudyConfig], bool] = lambda study: True,
    note: Callable[[StudyConfig], str] = lambda study: "",
    angles: bool = True,
) -> Callable[[Draw], Draw]:
    """Register the function that draws a figure; parameters as in `FigureEntry`.

    The workflow imports all figures whenever it starts. So Matplotlib and pandas are imported
    within functions.

    Raises
    ------
    ValueError
        If the name is taken, or if there is no such table.
    """
    if unknown := set(tables) - set(TABLES):
        raise ValueError(f"figure {name!r}: no such tables: {', '.join(sorted(unknown))}")

    def decorate(draw: Draw) -> Draw:
        text = cleandoc(caption)
        entry = FigureEntry(name, title, text, draw, category, tables, when, note, angles)
        _REGISTRY.add(name, entry)
        return draw

    return decorate


def of_the_paper(study: StudyConfig) -> bool:
    """Whether a study draws the figures of the paper."""
    return study.paper


def get_figure(name: str) -> FigureEntry:
    """Return the figure of that name; raise `UnknownNameError` if there is none."""
    return _REGISTRY.get(name)


def figure_names(study: StudyConfig | None = None) -> tuple[str, ...]:
    """Names of the figures that a study has, or of all that there are."""
    names = _REGISTRY.names()
    return tuple(sorted(name for name in names if study is None or get_figure(name).when(study)))


def figure_tables(*names: str) -> tuple[str, ...]:
    """Names of the tables that some figures need."""
    return tuple(dict.fromkeys(table for name in names for table in get_figure(name).tables))
