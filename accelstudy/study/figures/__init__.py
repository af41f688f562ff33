"""Figures: each draws tables of a study.

To add one, write a function that draws it in a module next to this file, an entry in `entries`, and
a caption in `workflow/report/figures`.
"""

from accelstudy.study.figures.entries import FigureEntry, Tables
from accelstudy.study.figures.registry import (
    angle_unit,
    caption_notes,
    draw,
    figure_names,
    figure_tables,
    get_figure,
    render,
)

__all__ = [
    "FigureEntry",
    "Tables",
    "angle_unit",
    "caption_notes",
    "draw",
    "figure_names",
    "figure_tables",
    "get_figure",
    "render",
]
