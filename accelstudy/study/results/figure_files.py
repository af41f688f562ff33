"""The figures of a study, from its tables to files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from accelstudy.basics.wording import comma_list
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import read_table
from accelstudy.study.config import StudyConfig
from accelstudy.study.figures import figure_tables, render


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
