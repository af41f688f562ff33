"""Drawing and writing of the figures of a study, with their captions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from accelstudy.basics.units import angle_note, angles_in, attitude_unit
from accelstudy.basics.wording import comma_list
from accelstudy.files.outputs import whole_file
from accelstudy.study.figures.base import FigureEntry, Tables, figure_tables, get_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from accelstudy.study.config import StudyConfig


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

    with mpl.rc_context(STYLE), angles_in(angle_unit(study)):  # type: ignore[arg-type]
        return get_figure(name).draw(tables, study)


def captions(names: Iterable[str], study: StudyConfig) -> dict[str, str]:
    """Captions of figures by their names, with the notes on this study."""
    with angles_in(angle_unit(study)):
        return {entry.name: _caption(entry, study) for entry in map(get_figure, names)}


def _caption(entry: FigureEntry, study: StudyConfig) -> str:
    unit = f"{angle_note()}." if entry.angles else ""
    notes = " ".join(filter(None, [entry.note(study), unit]))
    return "\n".join(filter(None, [entry.caption, notes]))


def angle_unit(study: StudyConfig) -> str:
    """Unit of angles in figures: that of the study or, where it names none, of the user."""
    return study.angle_unit or attitude_unit()


def render(
    name: str, tables: Tables, study: StudyConfig, svg_path: str | Path, png_path: str | Path
) -> None:
    """Draw a figure and write it as SVG and PNG, each whole or not at all.

    The same tables give the same bytes. Parameters as in `draw`.
    """
    from accelstudy.drawing.saving import save
    from accelstudy.drawing.style import DPI

    save(draw(name, tables, study), svg_path, png_path, get_figure(name).title, DPI)


def draw_figures(
    study: StudyConfig, captions: Mapping[str, str], tables: Mapping[str, Any], folder: str | Path
) -> None:
    """Draw figures, and write each into a folder under its name: as SVG, as PNG, and its caption.

    It stops at the first figure that cannot be drawn; the error names that figure.

    Parameters
    ----------
    study : StudyConfig
    captions : mapping of the name of a figure to its caption
    tables : mapping of the name of a table to its path
    folder : str or Path
    """
    from accelstudy.files.tables import read_table

    read = {name: read_table(tables[name]) for name in figure_tables(*captions)}
    for name, caption in captions.items():
        path = Path(folder, name)
        try:
            render(name, read, study, path.with_suffix(".svg"), path.with_suffix(".png"))
        except Exception as error:
            error.add_note(
                f"The figure {name!r} could not be drawn, so all of its job are missing: "
                f"{comma_list([*captions])}."
            )
            raise
        with whole_file(path.with_suffix(".rst")) as written:
            written.write_text(f"{caption}\n", encoding="utf-8")
