"""The figure of a plan: tilt accuracy over effort, with the front of the best candidates."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes

from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import quantity_text
from accelstudy.drawing.style import INK, approach_colour, log_ticks
from accelstudy.planning.candidates import sort_by_time

if TYPE_CHECKING:
    from accelstudy.planning.plan import Plan

GREY = "#bbbbbb"
IN_SIGHT = 8.0
"""Tilt error over the target up to which candidates are in the figure, if there are any."""


def draw_plan(ax: Axes, plan: Plan) -> None:
    """Draw all candidates, the front of the best, and the simulated candidates of the table."""
    question, target = plan.question, float(to_display(plan.question.target, "rad"))
    share, ordered = question.confidence, sort_by_time([*plan.candidates, *plan.ranked])
    left = to_display(np.array([question.accuracy(c.tilt) for c in ordered]), "rad")
    minutes = np.array([c.seconds / 60 for c in ordered])
    ax.plot(minutes, left, ".", ms=2, color=GREY, rasterized=True, zorder=2,
            label="schemes, models, durations of a hold")  # fmt: skip
    for equipment in question.equipment:
        chosen = np.flatnonzero([c.equipment == equipment for c in ordered])
        front = chosen[left[chosen] < np.minimum.accumulate([np.inf, *left[chosen]])[:-1]]
        ax.step(minutes[front], left[front], where="post", zorder=3,
                color=approach_colour(equipment.name), label=f"best {equipment.how}")  # fmt: skip
    for number, candidate in enumerate(plan.ranked, 1):
        assert candidate.simulated is not None
        colour = approach_colour(candidate.equipment.name)
        error = float(to_display(question.accuracy(candidate.simulated), "rad"))
        circle = {"boxstyle": "circle", "facecolor": "white", "edgecolor": colour}
        ax.text(candidate.seconds / 60, error, str(number), color=colour, bbox=circle,
                ha="center", va="center", zorder=5)  # fmt: skip
    ax.plot([], [], "o", mfc="white", color=INK, label="simulated, numbered as in the table")
    wanted = f"wanted: {quantity_text(question.target, 'rad')}"
    ax.axhline(target, color=INK, linewidth=0.8, linestyle="--", zorder=1, label=wanted)
    least = left.min() if len(left) else target
    low, high = min(target, least) / 1.3, max(IN_SIGHT * target, 2 * least)
    times = minutes[left < high] if len(left) else np.array([1.0, 10.0])
    measure = "rms" if share is None else f"both angles stay below in {100 * share:g} %"
    ax.set(xscale="log", yscale="log", xlabel="time in the field / minutes")
    ax.set(xlim=(times.min() / 1.2, times.max() * 1.2), ylim=(low, high))
    ax.set_ylabel(f"tilt error left, {measure} / {display_unit('rad')}")
    log_ticks(ax.xaxis, times.min(), times.max())
    log_ticks(ax.yaxis, low, high)
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2)
