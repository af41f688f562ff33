"""A plan in words: first the answer in plain sentences, then its table and reasons.

The sentences stand in `wording.txt.j2`; here are the phrases of which it makes them, as `w`.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import GON, MGON, angle_note, display_unit, to_display  # noqa: F401
from accelstudy.basics.wording import amount, interval, number, quantity_text, words
from accelstudy.design.criteria import MINIMAX
from accelstudy.pages import render_lines
from accelstudy.planning import reasons
from accelstudy.planning.candidates import Candidate, shortest  # noqa: F401
from accelstudy.planning.question import Question
from accelstudy.sensors.models import NINE
from accelstudy.sensors.sensor import SensorModel

if TYPE_CHECKING:
    from accelstudy.planning.plan import Plan

SENTENCES = "planning/wording.txt.j2"
QUOTED = 0.95
"""Share of the calibrations that is quoted where the rms is asked for."""

HERE = sys.modules[__name__]


def part_lines(part: str, plan: Plan) -> list[str]:
    """Lines of a part of a plan: what to do (answer), how_to, reasons or assumptions."""
    return render_lines(SENTENCES, part, plan, HERE)


def assumed_sizes(question: Question) -> list[str]:
    """Effects that are taken to have a usual size, as nothing is known of it, in words."""
    sizes = {
        effect: quantity_text(question.sizes[effect], reasons.effect_unit(effect))
        for effect in question.assumed
    }
    return [f"{reasons.PLAIN[effect]} ({size})" for effect, size in sizes.items()]


def table_lines(plan: Plan) -> list[str]:
    """The ranked candidates as a table, and what its columns mean."""
    unit = display_unit("rad")
    head = [
        "", "equipment", "model", "scheme", "positions", "s each", "minutes",
        f"roll/{unit}", f"pitch/{unit}", f"both/{unit}", "limited by",
    ]  # fmt: skip
    table = np.array([head, *(_row(plan, i, c) for i, c in enumerate(plan.ranked, 1))])
    aligned = [
        (np.char.rjust if 4 <= i < 10 else np.char.ljust)(column, max(map(len, column)))
        for i, column in enumerate(table.T)
    ]
    return [
        *("  ".join(cells).rstrip() for cells in zip(*aligned, strict=True)),
        "model: number of parameters, and effects besides bias, scale and angles between axes;",
        "roll, pitch: rms, and interval with 95 of 100 calibrations of each angle by itself, from",
        f"{plan.replicates} simulated ones each;",
        "both: what roll and pitch both stay below in 95 of 100 calibrations",
    ]


def _row(plan: Plan, rank: int, candidate: Candidate) -> list[str]:
    left = candidate.simulated
    assert left is not None
    ends = (left.rms, left.quantile(0.025), left.quantile(0.975))
    cells = [
        f"{number(rms)} ({interval(low, high)})"
        for rms, low, high in zip(*(to_display(v, "rad") for v in ends), strict=True)
    ]
    return [
        f"{rank}.",
        candidate.equipment.how,
        model_words(candidate.model),
        candidate.scheme.name.partition("@")[0],
        str(candidate.scheme.n_positions),
        f"{candidate.hold:g}",
        f"{candidate.seconds / 60:.1f}",
        *cells,
        amount(left.quantile_of_both(QUOTED), "rad"),
        reasons.limits(plan.question, candidate),
    ]


def model_words(model: SensorModel) -> str:
    """A model by its number of parameters and its effects besides the usual nine parameters."""
    nine = {"bias", "scale", "nonorthogonality"}
    effects = [effect.name for effect in model.effects]
    more = [words(name.removesuffix("_scale")) for name in effects if name not in nine]
    less = [] if nine <= set(effects) else ["no angles between axes"]
    short = [name.replace("cross axis misalignment", "cross-axis") for name in (*more, *less)]
    return " + ".join([str(model.n_parameters), *short])


def positions_command(candidate: Candidate) -> str:
    """The command that shows, or finds again, the positions of a candidate."""
    if candidate.search is None:
        return f"accelstudy scheme {candidate.scheme.name}"
    task = candidate.search.task
    options = {
        "positions": str(candidate.scheme.n_positions),
        "approach": candidate.equipment.name,
        "model": candidate.model.name,
        "criterion": MINIMAX,
        "tilt-range": f"{task.tilt_range / GON:.6g}gon",
        "sigma": f"{task.noise.sigma_force:.4g}m/s2",
        "robot-sigma": f"{task.noise.sigma_angle / MGON:.6g}mgon",
        "starts": str(candidate.starts),
        "out": "positions.yaml",
    }
    usual = {"model": NINE, "sigma": "0.002m/s2", "robot-sigma": "3.2mgon", "approach": "robot"}
    given = (f"--{name} {text}" for name, text in options.items() if text != usual.get(name))
    return " ".join(["accelstudy design", *given])
