"""Figures: each draws tables of a study.

To add one, write a module next to this file with a function under `figure`.
"""

from importlib import import_module
from pkgutil import iter_modules

from accelstudy.figures.registry import (
    FigureEntry,
    Tables,
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
    "draw",
    "figure",
    "figure_names",
    "figure_tables",
    "get_figure",
    "render",
]

# A module registers its figures when it is imported.
for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
