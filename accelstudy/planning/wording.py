"""A plan in words: first the answer in plain sentences, then its table and reasons.

The sentences stand in `wording.txt.j2`, which has what it says them of as `w`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from accelstudy.basics.units import MGON, angle_note, display_unit
from accelstudy.basics.wording import amount, quantity_text, words
from accelstudy.effects import get_effect
from accelstudy.pages import render_lines
from accelstudy.planning import reasons
from accelstudy.planning.candidates import shortest
from accelstudy.planning.question import HOW, Question
from accelstudy.planning.simulated import QUOTED

if TYPE_CHECKING:
    from accelstudy.planning.plan import Plan, PlannedCalibration

SENTENCES = "planning/wording.txt.j2"


def part_lines(part: str, plan: Plan) -> list[str]:
    """Lines of a part of a plan: what to do (answer), reasons or assumptions."""
    known = {
        "reasons": reasons,
        "shortest": shortest,
        "assumed_sizes": assumed_sizes,
        "angle_note": angle_note,
        "QUOTED": QUOTED,
    }
    return render_lines(SENTENCES, part, plan, known)


def assumed_sizes(question: Question) -> list[str]:
    """Effects that are taken to have a usual size, as nothing is known of it, in words."""
    sizes = {
        effect: quantity_text(question.sizes[effect], get_effect(effect).unit)
        for effect in question.assumed
    }
    return [f"{words(effect)} ({size})" for effect, size in sizes.items()]


def table_lines(plan: Plan) -> list[str]:
    """The ranked candidates as a table, and what its columns mean."""
    unit = display_unit("rad")
    head = [
        "", "equipment", "model", "scheme", "positions", "s each", "minutes",
        f"roll/{unit}", f"pitch/{unit}", f"both/{unit}", "limited by",
    ]  # fmt: skip
    table = np.array([head, *map(_cells, plan.calibrations)])
    aligned = [
        (np.char.rjust if 4 <= i < 10 else np.char.ljust)(column, max(map(len, column)))
        for i, column in enumerate(table.T)
    ]
    return [
        *("  ".join(cells).rstrip() for cells in zip(*aligned, strict=True)),
        f"roll, pitch: rms of {plan.replicates} simulated calibrations each; both: what roll and",
        "pitch both stay below in 95 of 100 of them (over sensors, if effects are neglected)",
    ]


def _cells(c: PlannedCalibration) -> list[str]:
    tilt = c.roll_rms_simulated_mgon, c.pitch_rms_simulated_mgon, c.both_rms_q95_simulated_mgon
    return [
        f"{c.rank}.", HOW[c.equipment], c.model, c.scheme.partition("@")[0], str(c.n_positions),
        f"{c.hold_s:g}", f"{c.minutes:.1f}", *(amount(mgon * MGON, "rad") for mgon in tilt),
        c.limited_by,
    ]  # fmt: skip
