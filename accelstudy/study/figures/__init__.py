"""Figures: each draws tables of a study.

To add one, write a module next to this file with a function under `register`.
"""

from accelstudy.basics.registry import import_modules
from accelstudy.study.figures.registry import (
    caption,
    draw,
    figure_names,
    get_figure,
    write_figure,
)

__all__ = ["caption", "draw", "figure_names", "get_figure", "write_figure"]

# A module registers its figures when it is imported.
import_modules(__name__, __path__)
