"""What a figure of a study is, the registry of figures, and how they are drawn and written."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from accelstudy.basics.registry import Registry
from accelstudy.basics.units import angle_note, angles_in, attitude_unit
from accelstudy.files.outputs import whole_file

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from accelstudy.study.config import Study

Tables: TypeAlias = "Mapping[str, pd.DataFrame]"
Draw: TypeAlias = "Callable[[Tables, Study], Figure]"

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
    when: Callable[[Study], bool]
    note: Callable[[Study], str]
    angles: bool


def register(
    name: str,
    *,
    title: str = "",
    caption: str = "",
    category: str = "Study",
    tables: tuple[str, ...] = (),
    when: Callable[[Study], bool] = lambda study: True,
    note: Callable[[Study], str] = lambda study: "",
    angles: bool = True,
) -> Callable[[Draw], Draw]:
    """Register the function that draws a figure; parameters as in `FigureEntry`.

    The first line of its docstring is the title and the rest the caption, unless they are given.
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
        head, _, text = cleandoc(draw.__doc__ or "").partition("\n\n")
        said = title or head.rstrip("."), cleandoc(caption) or text
        entry = FigureEntry(name, *said, draw, category, tables, when, note, angles)
        _REGISTRY.add(name, entry)
        return draw

    return decorate


def of_the_paper(study: Study) -> bool:
    """Whether a study draws the figures of the paper."""
    return study.paper


def get_figure(name: str) -> FigureEntry:
    """Return the figure of that name; raise `UnknownNameError` if there is none."""
    return _REGISTRY.get(name)


def figure_names(study: Study | None = None) -> tuple[str, ...]:
    """Names of the figures that a study has, or of all that there are."""
    names = _REGISTRY.names()
    return tuple(sorted(name for name in names if study is None or get_figure(name).when(study)))


def figure_tables(*names: str) -> tuple[str, ...]:
    """Names of the tables that some figures need."""
    return tuple(dict.fromkeys(table for name in names for table in get_figure(name).tables))


def angle_unit(study: Study) -> str:
    """Unit of angles in figures: that of the study or, where it names none, of the user."""
    return study.angle_unit or attitude_unit()


def captions(names: Iterable[str], study: Study) -> dict[str, str]:
    """Captions of figures by their names, with the notes on this study."""
    texts = {}
    with angles_in(angle_unit(study)):
        for figure in map(get_figure, names):
            unit = f"{angle_note()}." if figure.angles else ""
            notes = " ".join(filter(None, [figure.note(study), unit]))
            texts[figure.name] = "\n".join(filter(None, [figure.caption, notes]))
    return texts


def draw(name: str, tables: Tables, study: Study) -> Figure:
    """Draw a figure.

    Parameters
    ----------
    name : str
    tables : mapping of table name to table, at least those of `figure_tables`
    study : Study
    """
    import matplotlib as mpl

    from accelstudy.drawing.style import STYLE

    with mpl.rc_context(STYLE), angles_in(angle_unit(study)):  # type: ignore[arg-type]
        return get_figure(name).draw(tables, study)


def write_figure(name: str, tables: Tables, study: Study, folder: str | Path) -> None:
    """Draw a figure, and write it into a folder under its name: as SVG, as PNG, and its caption.

    Each file is whole or not there at all, and the same tables give the same bytes. Parameters as
    in `draw`; an error that arises names the figure.
    """
    from accelstudy.drawing.saving import save
    from accelstudy.drawing.style import DPI

    svg, png, rst = (Path(folder, f"{name}.{kind}") for kind in ("svg", "png", "rst"))
    try:
        save(draw(name, tables, study), svg, png, get_figure(name).title, DPI)
    except Exception as error:
        error.add_note(f"The figure {name!r} could not be drawn.")
        raise
    with whole_file(rst) as path:
        path.write_text(f"{captions([name], study)[name]}\n", encoding="utf-8")
