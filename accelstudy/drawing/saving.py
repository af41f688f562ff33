"""Figures as files and as parts of pages."""

from __future__ import annotations

import html
from collections.abc import Callable, Collection, Mapping
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from accelstudy.basics.progress import failure
from accelstudy.drawing.style import in_style
from accelstudy.files.outputs import whole_file

PAGE_DPI = 150
"""Dots per inch of the figures of a page, which shows them as SVG."""
COMPRESSION = 4
"""Level of zlib. The default takes up to twice as long, and saves a twentieth."""
MAX_VECTOR_POINTS = 1000
"""An artist with more points or lines is drawn as an image inside of the SVG."""


def save(figure: Figure, path: str | Path, title: str, dpi: int) -> None:
    """Write a figure as SVG or PNG, by the ending of the path, whole or not at all.

    The same figure gives the same bytes. The canvases are called directly, because
    `Figure.savefig` would draw each of them twice.

    Parameters
    ----------
    figure : Figure
    path : str or Path
    title : str, for the metadata
    dpi : int, of a PNG
    """
    with in_style(), whole_file(path) as part:
        if Path(path).suffix == ".svg":
            metadata = {"Date": None, "Creator": None, "Title": title}
            FigureCanvasSVG(figure).print_svg(part, metadata=metadata)  # type: ignore[no-untyped-call]
        else:
            figure.set_dpi(dpi)
            FigureCanvasAgg(figure).print_png(  # type: ignore[no-untyped-call]
                part,
                metadata={"Software": None, "Title": title},
                pil_kwargs={"compress_level": COMPRESSION},
            )
    figure.set_layout_engine("none")  # laid out once, alike in all files


def save_all(
    figures: Mapping[str, Callable[[], Figure]],
    folder: Path,
    kinds: Collection[str] = ("svg", "png"),
) -> dict[str, str]:
    """Draw the figures of a page and write them under their names; returns elements for the page.

    If a figure fails, the others are drawn all the same. A line on the page and a warning on stderr
    name the error.

    Parameters
    ----------
    figures : mapping of name to a function that draws the figure
    folder : Path
    kinds : endings of the files; without svg there are no elements
    """
    return {name: _element(draw, folder, name, kinds) for name, draw in figures.items()}


def _element(draw: Callable[[], Figure], folder: Path, name: str, kinds: Collection[str]) -> str:
    """Return the element of one figure, or what is said in its place."""
    try:
        with in_style():
            figure = draw()
        _simplify(figure)
        for kind in kinds:
            save(figure, folder / f"{name}.{kind}", name, PAGE_DPI)
        text = (folder / f"{name}.svg").read_text("utf-8") if "svg" in kinds else ""
        return text[text.find("<svg") :]
    except OSError:  # such as a full disk, which is no failure of the figure
        raise
    except Exception as error:
        said = failure(f"The figure {name!r} could not be drawn", error)
        return f'<p class="failed">{html.escape(said)}</p>'


def _simplify(figure: Figure) -> None:
    """Draw artists of very many points as images, or a page would have many megabytes."""
    drawn = [artist for axes in figure.axes for artist in (*axes.lines, *axes.collections)]
    lines = [
        a for a in drawn if isinstance(a, Line2D) and np.size(a.get_xdata()) > MAX_VECTOR_POINTS
    ]
    collections = [
        a for a in drawn if isinstance(a, LineCollection) and len(a.get_paths()) > MAX_VECTOR_POINTS
    ]
    for artist in (*lines, *collections):
        artist.set_rasterized(True)
    if lines or collections:
        figure.set_dpi(PAGE_DPI)
