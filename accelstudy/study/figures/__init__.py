"""Figures: each draws tables of a study.

To add one, write a module next to this file with a function under `register`.
"""

from accelstudy.basics.registry import import_modules
from accelstudy.study.figures.base import (
    FigureEntry,
    Tables,
    figure_names,
    figure_tables,
    get_figure,
    register,
)
from accelstudy.study.figures.rendering import angle_unit, captions, draw, draw_figures, render

__all__ = [
    "FigureEntry",
    "Tables",
    "angle_unit",
    "captions",
    "draw",
    "draw_figures",
    "figure_names",
    "figure_tables",
    "get_figure",
    "register",
    "render",
]

# A module registers its figures when it is imported.
import_modules(__name__, __path__)
