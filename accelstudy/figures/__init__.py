"""Figures: each draws tables of a study.

To add one, write a module next to this file with a function under `figure`.
"""

from accelstudy.figures.registry import (
    FigureEntry,
    Tables,
    angle_unit,
    caption,
    draw,
    figure,
    figure_names,
    figure_tables,
    get_figure,
    render,
)

__all__ = [
    "FigureEntry",
    "Tables",
    "angle_unit",
    "caption",
    "draw",
    "figure",
    "figure_names",
    "figure_tables",
    "get_figure",
    "render",
]
