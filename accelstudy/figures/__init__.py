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
from accelstudy.registry import import_modules

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

# A module registers its figures when it is imported.
import_modules(__name__, __path__)
