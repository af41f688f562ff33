"""The figure of a plan: tilt accuracy over effort, with the front of the best candidates."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from accelstudy.basics.units import display_unit, to_display
from accelstudy.basics.wording import quantity_text
from accelstudy.drawing.style import (
    FULL,
    INK,
    approach_colour,
    approach_marker,
    log_ticks,
    new_figure,
)
from accelstudy.planning.answer import Answer, Ranked
from accelstudy.planning.candidates import Candidate
from accelstudy.planning.optimised import by_time

LABELS = {"gravity": "by hand, gravity alone", "robot": "with a robot"}


def plan_figure(answer: Answer) -> Figure:
    """Draw all candidates, the front of the best, and the simulated candidates of the table."""
    figure = new_figure(FULL, 95)
    draw_plan(figure.subplots(), answer)
    return figure


def draw_plan(ax: Axes, answer: Answer) -> None:
    """Draw what `plan_figure` shows."""
    question = answer.question
    for equipment in question.equipment:
        compared = [c for c in answer.compared if c.equipment == equipment]
        if compared:
            _draw_equipment(ax, compared, question.confidence)
    target = float(to_display(question.target, "rad"))
    ax.axhline(target, color=INK, linewidth=0.8, linestyle="--", zorder=1)
    ax.set_xscale("log")
    ax.set_yscale("log")
    shown = [c for c in answer.compared if _shown(c, question.confidence) < 8 * target]
    values = [_shown(c, question.confidence) for c in shown or answer.compared] or [target]
    low, high = min(*values, target) / 1.3, max(*values, target) * 1.2
    times = [c.seconds / 60 for c in shown or answer.compared] or [1.0, 10.0]
    ax.set_ylim(low, high)
    ax.set_xlim(min(times) / 1.2, max(times) * 1.2)
    log_ticks(ax.xaxis, min(times), max(times))
    log_ticks(ax.yaxis, low, high)
    wanted = f"wanted: {quantity_text(question.target, 'rad')}"
    ax.annotate(
        wanted, (1, target), xycoords=("axes fraction", "data"), xytext=(-2, 2),
        textcoords="offset points", ha="right", va="bottom",
    )  # fmt: skip
    simulated = {n: r for n, r in enumerate(answer.ranked, 1) if r.simulated is not None}
    above = dict.fromkeys(question.equipment, False)
    for number, ranked in simulated.items():
        equipment = ranked.candidate.equipment
        _draw_simulated(ax, str(number), ranked, above[equipment], question.confidence)
        above[equipment] = not above[equipment]  # neighbours have their numbers on either side
    ax.set_xlabel("time in the field / minutes")
    measure = (
        "rms"
        if question.confidence is None
        else f"both angles stay below in {100 * question.confidence:g} %"
    )
    ax.set_ylabel(f"tilt error left, {measure} / {display_unit('rad')}")
    ax.legend(handles=_handles(answer), loc="lower left", bbox_to_anchor=(0, 1), ncols=2)


def _draw_equipment(ax: Axes, compared: list[Candidate], confidence: float | None) -> None:
    colour = approach_colour(compared[0].equipment.name)
    times = np.array([c.seconds / 60 for c in compared])
    values = np.array([_shown(c, confidence) for c in compared])
    ax.scatter(times, values, s=3, color=colour, alpha=0.18, linewidth=0, rasterized=True, zorder=2)
    front_times, front, best = [], [], np.inf
    for candidate in by_time(compared):
        value = _shown(candidate, confidence)
        if value < best:
            best = value
            front_times.append(candidate.seconds / 60)
            front.append(value)
    ax.step(front_times, front, where="post", color=colour, zorder=3)


def _draw_simulated(
    ax: Axes, number: str, ranked: Ranked, above: bool, confidence: float | None
) -> None:
    candidate, simulated = ranked.candidate, ranked.simulated
    assert simulated is not None
    colour = approach_colour(candidate.equipment.name)
    value = float(to_display(simulated.accuracy(confidence), "rad"))
    time = candidate.seconds / 60
    ax.plot(
        [time], [value], marker=approach_marker(candidate.equipment.name), markersize=5,
        markerfacecolor="white", markeredgecolor=colour, linestyle="", zorder=5,
    )  # fmt: skip
    ax.annotate(
        number, (time, value), xytext=(0, 11 if above else -11), textcoords="offset points",
        ha="center", va="center", color=colour, zorder=6,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
    )  # fmt: skip


def _shown(candidate: Candidate, confidence: float | None) -> float:
    return float(to_display(candidate.accuracy(confidence), "rad"))


def _handles(answer: Answer) -> list[Line2D]:
    handles = [
        Line2D([], [], color=approach_colour(e.name), label=f"best {LABELS[e.name]}")
        for e in answer.question.equipment
    ]
    dot = Line2D(
        [], [], color="#777777", marker="o", markersize=2, linestyle="", alpha=0.6,
        label="other schemes, models, durations of a hold",
    )  # fmt: skip
    simulated = Line2D(
        [], [], color=INK, marker="o", markerfacecolor="white", linestyle="",
        label="simulated, with its number in the table",
    )  # fmt: skip
    return [*handles, dot, simulated]
