"""Drawings that explain, made while the site is built: axes, positions on a globe, a robot."""

import io
from functools import partial

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.patches import Arc, Circle, Polygon

from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.drawing.style import ANGLE_COLOURS, FULL, INK, STYLE, new_figure
from accelstudy.schemes import get_scheme
from accelstudy.sensors.frames import Frame
from accelstudy.sensors.models import get_model
from accelstudy.sequential.advisor import advise
from accelstudy.sequential.choice import DEFAULTS, candidates
from accelstudy.sequential.promise import Promise

COLOURS = {"x": "#0072B2", "y": "#D55E00", "z": "#009E73"}
PALE = "#999999"
# The viewer of all drawings in space looks from the right rear, from above: axes forward, right
# and down as directions on the page, to the right and up, and towards the viewer.
_AWAY, _UP = np.radians(35.0), np.radians(22.0)
PAGE = np.array(
    [
        [np.cos(_AWAY), np.sin(_AWAY) * np.sin(_UP), -np.sin(_AWAY) * np.cos(_UP)],
        [np.sin(_AWAY), -np.cos(_AWAY) * np.sin(_UP), np.cos(_AWAY) * np.cos(_UP)],
        [0.0, -np.cos(_UP), -np.sin(_UP)],
    ]
)


def _axes(width, height_mm, columns=1):
    figure = new_figure(width, height_mm)
    axes = figure.subplots(1, columns, squeeze=False)[0]
    for ax in axes:
        ax.set_axis_off()
        ax.set_aspect("equal")
    return figure, axes


def _arrow(ax, start, end, colour, zorder=3):
    style = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", end, start, arrowprops=style, zorder=zorder)


def frames():
    """A sensor with its axes as frd and as flu, and what it reads at level."""
    figure, axes = _axes(FULL * 0.8, 62, 2)
    size = np.array([0.55, 0.4, 0.22])  # half of the box: forward, right, down
    words = {"f": "forward", "r": "right", "d": "down", "l": "left", "u": "up"}
    readings = {"frd": "$f$ = (0, 0, −$g$)", "flu": "$f$ = (0, 0, +$g$)"}
    for ax, (name, reading) in zip(axes, readings.items(), strict=True):
        for axis, sign in ((0, -1), (1, 1), (2, -1)):  # the three faces that are seen
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=float)
            face = np.insert(corners, axis, sign, axis=1) * size @ PAGE[:, :2]
            shade = {0: "#DDDDDD", 1: "#CCCCCC", 2: "#EEEEEE"}[axis]
            ax.add_patch(Polygon(face, facecolor=shade, edgecolor=PALE))
        for letter, along, direction in zip("xyz", name, Frame(name).matrix.T, strict=True):
            start, end = (direction * s @ PAGE[:, :2] for s in (size, 1.3))
            behind = direction @ PAGE[:, 2] < 0
            _arrow(ax, start, end, COLOURS[letter], zorder=0.5 if behind else 3)
            side = "left" if end[0] > 0.1 else "right" if end[0] < -0.1 else "center"
            place = end + np.array([0, 0.13 * np.sign(end[1])])
            text = f"${letter}$ {words[along]}"
            ax.text(*place, text, color=COLOURS[letter], ha=side, va="center")
        ax.text(0, 1.7, f"{name}: at level {reading}", ha="center")
        ax.set(xlim=(-1.8, 2.0), ylim=(-1.5, 1.9))
    return figure


def globe():
    """Positions of schemes on the sphere of directions of gravity, those behind it pale."""
    schemes = ("faces-6", "mclaren-24", "fibonacci-36", "xsens-38")
    figure, axes = _axes(FULL, 52, len(schemes))
    turn = np.linspace(0, 2 * np.pi, 181)
    circles = [
        np.column_stack(
            [np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), 0 * turn + z]
        )
        for z in (-0.5, 0.0, 0.5)
    ]
    circles += [
        np.column_stack([np.cos(turn) * np.cos(a), np.cos(turn) * np.sin(a), np.sin(turn)])
        for a in np.radians([0, 45, 90, 135])
    ]
    for ax, name in zip(axes, schemes, strict=True):
        ax.add_patch(Circle((0, 0), 1, facecolor="#F7F7F7", edgecolor=PALE))
        for circle in circles:
            x, y, towards = (circle @ PAGE).T
            ax.plot(*np.where(towards > 0, (x, y), np.nan), color="#CCCCCC", linewidth=0.6)
        scheme = get_scheme(name)
        x, y, towards = (scheme.directions @ PAGE).T
        for seen, style in ((False, {"color": "#BBBBBB"}), (True, {"color": COLOURS["x"]})):
            here = (towards > 0) == seen
            ax.plot(x[here], y[here], "o", markersize=4, markeredgecolor="white", **style)
        ax.text(0, 1.15, scheme.title, ha="center")
        ax.set(xlim=(-1.1, 1.1), ylim=(-1.1, 1.35))
    return figure


def robot():
    """An arm that holds a sensor: flange, angles against the vertical, gravity."""
    figure, (ax,) = _axes(FULL * 0.8, 78)
    joints = np.array([(0.0, 0.35), (0.0, 1.2), (1.15, 2.0), (2.0, 1.55)])
    ax.plot([-0.7, 5.5], [0, 0], color=INK)
    ax.add_patch(Polygon([(-0.4, 0), (0.4, 0), (0.25, 0.35), (-0.25, 0.35)], facecolor=PALE))
    ax.plot(*joints.T, color=PALE, linewidth=9, solid_joinstyle="round", solid_capstyle="round")
    ax.plot(*joints.T, "o", color="white", markeredgecolor=INK, markersize=7)
    tilt = np.radians(20)
    forward = np.array([np.cos(tilt), -np.sin(tilt)])
    down = np.array([-np.sin(tilt), -np.cos(tilt)])
    flange = joints[-1] + 0.15 * forward
    middle = flange + 0.42 * forward
    ax.plot(*np.array([flange - 0.3 * down, flange + 0.3 * down]).T, color=INK, linewidth=4)
    box = [
        middle + a * 0.36 * forward + b * 0.24 * down
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    ax.add_patch(Polygon(box, facecolor="#EEEEEE", edgecolor=INK))
    for letter, along, far in (("x", forward, 1.25), ("z", down, 0.9)):
        _arrow(ax, middle, middle + far * along, COLOURS[letter])
        ax.text(
            *(middle + (far + 0.15) * along),
            f"${letter}$",
            color=COLOURS[letter],
            ha="center",
            va="center",
        )
    level = np.array([middle, middle + np.array([1.6, 0])])
    ax.plot(*level.T, color=INK, linewidth=0.8, linestyle="--")
    ax.add_patch(Arc(middle, 2.2, 2.2, theta1=-np.degrees(tilt), theta2=0, color=INK))
    ax.text(middle[0] + 1.2, middle[1] - 0.2, "pitch, against\nthe horizontal", va="center")
    _arrow(ax, (5.2, 2.6), (5.2, 1.75), INK)
    ax.text(5.3, 2.2, "$g$", va="center")
    ax.text(-0.7, -0.32, "base: leveled; it turns about the vertical (yaw)", va="center")
    ax.text(flange[0] - 0.1, 2.3, "flange: roll and pitch are measured", va="center")
    ax.plot([flange[0] + 0.1, flange[0] + 0.15], [1.87, 2.15], color=INK, linewidth=0.6)
    ax.text(middle[0] + 0.3, 0.65, "sensor: may sit crooked on it", va="center")
    ax.set(xlim=(-0.8, 5.6), ylim=(-0.5, 2.8))
    return figure


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


DRAWINGS = {
    f"drawings/{draw.__name__}.svg": partial(svg, draw) for draw in (frames, globe, robot, session)
}
