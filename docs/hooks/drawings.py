"""The drawing of a session, made while the site is built; those of axes and robots are files."""

import io

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG

from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.drawing.style import ANGLE_COLOURS, FULL, INK, STYLE, new_figure
from accelstudy.sensors.models import get_model
from accelstudy.sequential.advisor import advise
from accelstudy.sequential.choice import DEFAULTS, candidates
from accelstudy.sequential.promise import Promise


def session():
    """The tilt accuracy of the session of guides/sequential.md, as its positions come in."""
    settings = {"scheme": "faces-edges-corners-26", "approach": "gravity", "seed": 3}
    campaign, _ = simulate_campaign(CampaignSettings(name="whole", **settings))
    promise = Promise(15 * MGON, 30 * GON)
    model, approach = get_model("bias-scale-nonorthogonality"), get_approach("gravity")
    directions = candidates(DEFAULTS.get("gravity", "grid"))
    numbers = [int(p) for p in campaign.positions]
    sessions = [campaign.without(dict.fromkeys(numbers[n:], "later")) for n in numbers]
    advice = [advise(each, model, approach, promise, directions) for each in sessions]
    known = [
        (n, *one.rms / MGON) for n, one in zip(numbers, advice, strict=True) if one.rms is not None
    ]
    n, roll, pitch = np.array(known).T
    stop = next(n for n, one in zip(numbers, advice, strict=True) if one.enough)
    figure = new_figure(FULL * 0.8, 62)
    ax = figure.subplots()
    for name, rms, marker in (("roll", roll, "o"), ("pitch", pitch, "s")):
        ax.plot(n, rms, marker=marker, color=ANGLE_COLOURS[name], label=name)
    ax.axhline(15, color=INK, linestyle="--", linewidth=0.8, label="wanted")
    ax.axvspan(0, n[0] - 0.5, color="#EEEEEE", linewidth=0)
    ax.text(n[0] / 2, 8, "not all parameters\nare determined", ha="center", va="center")
    ax.axvline(stop, color=INK, linewidth=0.8, linestyle=":")
    ax.text(stop + 0.2, 1, "you can stop")
    ax.set(xlim=(0, numbers[-1] + 0.5), ylim=(0, 18))
    ax.set(xlabel="positions so far", ylabel="tilt accuracy, rms / mgon")
    ax.legend(loc="lower right")
    return figure


def svg(draw):
    """A drawing as the text of an SVG file, the same each time."""
    buffer = io.StringIO()
    with mpl.rc_context({**STYLE, "font.size": 10}):
        FigureCanvasSVG(draw()).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()
