"""Figures: each draws tables of a study.

To add one, write a module next to this file with a function under `register`.
"""

from accelstudy.basics.registry import import_modules
from accelstudy.study.figures.registry import (
    FigureEntry,
    Tables,
    angle_unit,
    captions,
    draw,
    figure_names,
    figure_tables,
    get_figure,
    register,
    write_figure,
)

__all__ = [
    "FigureEntry",
    "Tables",
    "angle_unit",
    "captions",
    "draw",
    "figure_names",
    "figure_tables",
    "get_figure",
    "register",
    "write_figure",
]

# A module registers its figures when it is imported.
import_modules(__name__, __path__)
