"""The figure of a plan: tilt accuracy over effort, with the front of the best candidates."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import quantity_text
from accelstudy.drawing.style import (
    INK,
    approach_colour,
    approach_marker,
    log_ticks,
)
from accelstudy.planning.candidates import sort_by_time

if TYPE_CHECKING:
    from accelstudy.planning.plan import Plan

LABELS = {"gravity": "by hand, gravity alone", "robot": "with a robot"}
IN_SIGHT = 8.0
"""Tilt error over the target up to which candidates are in the figure, if there are any."""


def draw_plan(ax: Axes, plan: Plan) -> None:
    """Draw all candidates, the front of the best, and the simulated candidates of the table."""
    question, target = plan.question, float(to_display(plan.question.target, "rad"))
    share, ordered = question.confidence, sort_by_time([*plan.candidates, *plan.ranked])
    left = to_display(np.array([question.accuracy(c.tilt) for c in ordered]), "rad")
    minutes = np.array([c.seconds / 60 for c in ordered])
    for equipment in question.equipment:
        chosen = np.flatnonzero([c.equipment == equipment for c in ordered])
        colour = approach_colour(equipment.name)
        at = minutes[chosen], left[chosen]
        ax.scatter(*at, s=3, alpha=0.18, linewidth=0, rasterized=True, color=colour, zorder=2)
        front = chosen[left[chosen] < np.minimum.accumulate([np.inf, *left[chosen]])[:-1]]
        ax.step(minutes[front], left[front], where="post", color=colour, zorder=3)
    for number, candidate in enumerate(plan.ranked, 1):
        assert candidate.simulated is not None
        name, time = candidate.equipment.name, candidate.seconds / 60
        place = time, float(to_display(question.accuracy(candidate.simulated), "rad"))
        ax.plot(*place, marker=approach_marker(name), ms=5, mfc="white",
                mec=approach_colour(name), ls="", zorder=5)  # fmt: skip
        ax.annotate(
            str(number), place, xytext=(0, -11 if number % 2 else 11), textcoords="offset points",
            ha="center", va="center", color=approach_colour(name), zorder=6,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )  # fmt: skip
    wanted = f"wanted: {quantity_text(question.target, 'rad')}"
    ax.axhline(target, color=INK, linewidth=0.8, linestyle="--", zorder=1)
    ax.annotate(wanted, (1, target), xycoords=("axes fraction", "data"), xytext=(-2, 2),
                textcoords="offset points", ha="right", va="bottom")  # fmt: skip
    shown = left < IN_SIGHT * target if (left < IN_SIGHT * target).any() else left < np.inf
    times = minutes[shown] if len(minutes) else np.array([1.0, 10.0])
    low, high = min(target, *left[shown]) / 1.3, max(target, *left[shown]) * 1.2
    ax.set(xscale="log", yscale="log", ylim=(low, high))
    ax.set_xlim(times.min() / 1.2, times.max() * 1.2)
    log_ticks(ax.xaxis, times.min(), times.max())
    log_ticks(ax.yaxis, low, high)
    measure = "rms" if share is None else f"both angles stay below in {100 * share:g} %"
    ax.set_xlabel("time in the field / minutes")
    ax.set_ylabel(f"tilt error left, {measure} / {display_unit('rad')}")
    looks: list[dict[str, Any]] = [
        {"color": approach_colour(e.name), "label": f"best {LABELS[e.name]}"}
        for e in question.equipment
    ]
    looks.append({"color": "#777777", "marker": "o", "ms": 2, "ls": "", "alpha": 0.6,
                  "label": "other schemes, models, durations of a hold"})  # fmt: skip
    looks.append({"color": INK, "marker": "o", "mfc": "white", "ls": "",
                  "label": "simulated, with its number in the table"})  # fmt: skip
    handles = [Line2D([], [], **look) for look in looks]
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
