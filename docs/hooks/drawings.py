"""The drawing of a session, made while the site is built; those of axes and robots are files."""

import io
import re
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG

from accelstudy.drawing.style import ANGLE_COLOURS, FULL, INK, STYLE, new_figure

ADVICE = Path(__file__).parents[2] / "tests/golden/advise/guide.txt"
"""What `advise` says in the session of guides/sequential.md, as the golden set has it."""


def session():
    """The tilt accuracy as the positions of the session come in, as SVG."""
    said = ADVICE.read_text(encoding="utf-8").split("positions: ")[1:]
    left = [re.search(r"left: roll ([\d.]+) mgon, pitch ([\d.]+)", block) for block in said]
    rms = np.array([found.groups() if found else (np.nan, np.nan) for found in left], dtype=float)
    first = next(n for n, found in enumerate(left) if found)
    stop = next(n for n, block in enumerate(said) if "YOU CAN STOP" in block)
    with mpl.rc_context({**STYLE, "font.size": 10}):
        figure = new_figure(FULL * 0.8, 62)
        ax = figure.subplots()
        for (name, colour), column, marker in zip(ANGLE_COLOURS.items(), rms.T, "os", strict=True):
            ax.plot(column, marker=marker, color=colour, label=name)
        ax.axhline(15, color=INK, linestyle="--", linewidth=0.8, label="wanted")
        ax.axvspan(0, first - 0.5, color="#EEEEEE", linewidth=0)
        ax.text(first / 2, 8, "not all parameters\nare determined", ha="center", va="center")
        ax.axvline(stop, color=INK, linewidth=0.8, linestyle=":")
        ax.text(stop + 0.2, 1, "you can stop")
        ax.set(xlim=(0, len(said) - 0.5), ylim=(0, 18))
        ax.set(xlabel="positions so far", ylabel="tilt accuracy, rms / mgon")
        ax.legend(loc="lower right")
        buffer = io.StringIO()
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
