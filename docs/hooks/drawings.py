"""The drawing of a session, made while the site is built; those of axes and robots are files."""

import io

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG

import accelstudy
from accelstudy.basics.units import MGON
from accelstudy.drawing.style import ANGLE_COLOURS, FULL, INK, STYLE, new_figure


def session():
    """The session of guides/sequential.md as SVG: the tilt accuracy as its positions come in."""
    scheme, positions = "faces-edges-corners-26", range(1, 27)
    whole = accelstudy.simulate_campaign(scheme=scheme, approach="gravity", seed=3)
    sessions = [whole.without(dict.fromkeys(positions[n:], "later")) for n in positions]
    advice = [accelstudy.advise(each, tilt_accuracy="15mgon").advice for each in sessions]
    known = [
        (n, *one.rms / MGON)
        for n, one in zip(positions, advice, strict=True)
        if one.rms is not None
    ]
    n, *angles = np.array(known).T
    stop = next(n for n, one in zip(positions, advice, strict=True) if one.enough)
    with mpl.rc_context({**STYLE, "font.size": 10}):
        figure = new_figure(FULL * 0.8, 62)
        ax = figure.subplots()
        for (name, colour), rms, marker in zip(ANGLE_COLOURS.items(), angles, "os", strict=True):
            ax.plot(n, rms, marker=marker, color=colour, label=name)
        ax.axhline(15, color=INK, linestyle="--", linewidth=0.8, label="wanted")
        ax.axvspan(0, n[0] - 0.5, color="#EEEEEE", linewidth=0)
        ax.text(n[0] / 2, 8, "not all parameters\nare determined", ha="center", va="center")
        ax.axvline(stop, color=INK, linewidth=0.8, linestyle=":")
        ax.text(stop + 0.2, 1, "you can stop")
        ax.set(xlim=(0, len(advice) + 0.5), ylim=(0, 18))
        ax.set(xlabel="positions so far", ylabel="tilt accuracy, rms / mgon")
        ax.legend(loc="lower right")
        buffer = io.StringIO()
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
