"""The figures of a study, from its tables to files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from accelstudy.basics.wording import comma_list
from accelstudy.files.tables import read_table
from accelstudy.study.config import StudyConfig
from accelstudy.study.figures import figure_tables, render


def draw_figures(
    study: StudyConfig, names: Sequence[str], tables: Mapping[str, Any], folder: str | Path
) -> None:
    """Draw figures from tables given by their paths, as SVG and PNG by their names in a folder.

    The first that cannot be drawn ends it; the error names that figure.
    """
    read = {name: read_table(tables[name]) for name in figure_tables(*names)}
    for name in names:
        path = Path(folder, name)
        try:
            render(name, read, study, path.with_suffix(".svg"), path.with_suffix(".png"))
        except Exception as error:
            error.add_note(
                f"The figure {name!r} could not be drawn, so all of its job are missing: "
                f"{comma_list(names)}."
            )
            raise
