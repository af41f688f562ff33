"""The grammar of the figures: panels of tidy tables, whose numbers are in the units shown.

A figure makes a table for each panel, and one function that draws such a table. What panels have in
common is here: axes and their labels, what stands where there is nothing to draw, marks, numbers on
fields, and the entries of legends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import GON, to_attitude
from accelstudy.drawing.style import (
    FULL,
    INK,
    Style,
    approach_colour,
    approach_marker,
    inks_on,
    new_figure,
    say_empty,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D

Array = NDArray[np.float64]
DARK: Style = {"linestyle": "", "color": INK}
"""Marks of a legend that are of no approach."""


@dataclass(frozen=True)
class Panel:
    """What a panel shows.

    Attributes
    ----------
    data : what the figure draws in it: a table, or an array
    title, xlabel, ylabel : str, the labels with the units of the data
    nothing : str, what the panel says if the data have no rows
    """

    data: Any
    title: str = ""
    xlabel: str = ""
    ylabel: str = ""
    nothing: str = "no estimable cell"


def panels(
    grid: Sequence[Sequence[Panel]],
    draw: Callable[[Axes, Any], object],
    height_mm: float = 0.0,
    *,
    width: float = FULL,
    figure: Figure | SubFigure | None = None,
    loc: str = "center",
    **shared: Any,
) -> tuple[Any, Any]:
    """Draw panels in rows and columns.

    Parameters
    ----------
    grid : rows of panels
    draw : function that draws the data of a panel into its axes
    height_mm, width : of a new figure, the width in inches
    figure : figure to draw into, instead of a new one
    loc : where titles stand, "center" or "left"
    **shared : as for `Figure.subplots`, such as sharex

    Returns
    -------
    Figure or SubFigure, and an array of its Axes, (rows, columns)
    """
    drawn: Any = figure or new_figure(width, height_mm)
    axes = drawn.subplots(len(grid), max(map(len, grid)), squeeze=False, **shared)
    for ax in axes.flat:
        ax.set_axis_off()
    # An empty panel has no numbers of its own, but those of a row or column may stand at it.
    numbered = bool(shared) and any(len(panel.data) for row in grid for panel in row)
    for row, places in zip(grid, axes, strict=True):
        for panel, ax in zip(row, places, strict=False):
            ax.set_axis_on()
            ax.set_title(panel.title, loc=loc)
            ax.set_xlabel(panel.xlabel)
            ax.set_ylabel(panel.ylabel)
            if len(panel.data):
                draw(ax, panel.data)
            else:
                say_empty(ax, panel.nothing)
                ax.grid(False)
                ax.tick_params(which="both", length=0)
                if not numbered:
                    ax.tick_params(which="both", labelbottom=False, labelleft=False)
    return drawn, axes


def by_cell(table: pd.DataFrame, column: str) -> dict[str, float]:
    """Numbers of a table that has one row per cell, or none at all, by the names of the cells."""
    return {} if table.empty else dict(zip(table["cell"], table[column], strict=True))


def points(ax: Axes, rows: pd.DataFrame, x: str = "x", y: str = "y", **style: Any) -> None:
    """Draw a point for each row in the colour and with the marker of its approach."""
    for approach, its in rows.groupby("approach", observed=True):
        usual = {"marker": approach_marker(str(approach)), "linestyle": ""}
        colour = approach_colour(str(approach))
        ax.plot(its[x].to_numpy(), its[y].to_numpy(), **{**usual, "color": colour, **style})


def key(label: str, **style: Any) -> Line2D:
    """Entry of a legend."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **style)


def surface(ax: Axes, roll: ArrayLike, pitch: ArrayLike, values: Array, **limits: Any) -> QuadMesh:
    """Draw values (pitch, roll) over attitudes, which are given in gon."""
    x, y = (to_attitude(np.asarray(angle) * GON) for angle in (roll, pitch))
    ax.grid(False)
    return ax.pcolormesh(x, y, values, shading="gouraud", cmap="viridis", rasterized=True, **limits)


def matrix(ax: Axes, values: Array, **colours: Any) -> AxesImage:
    """Draw a matrix as fields, none where it is NaN."""
    ax.grid(False)
    ax.tick_params(length=0)
    return ax.imshow(values, interpolation="none", **colours)


def write_values(
    ax: Axes,
    image: AxesImage,
    values: Array,
    text: Callable[[float], str],
    down: float = 0.0,
    size: float = 7.0,
) -> None:
    """Write numbers onto the fields of a matrix, unless NaN, in the ink of more contrast."""
    fields: Array = np.ma.filled(np.ma.asarray(image.get_array(), float), np.nan)
    style: Style = {"ha": "center", "va": "center", "fontsize": size, "in_layout": False}
    inks = inks_on(image, fields)
    for i, j in np.argwhere(np.isfinite(values)):
        ax.text(j, i + down, text(values[i, j]), color=inks[i, j], **style)
