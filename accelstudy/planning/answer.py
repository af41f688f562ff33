"""The answer: the cheapest candidates that reach the target, checked by simulation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.progress import begin, track
from accelstudy.data_sheets import get_data_sheet, sheet_of_sigma
from accelstudy.planning.candidates import Candidate, candidates, sort_by_time
from accelstudy.planning.fewest import CalibrationKind, cheapest
from accelstudy.planning.plan import Plan, most_accurate
from accelstudy.planning.question import Equipment, Question
from accelstudy.planning.simulated import simulate_candidate

MAX_RANKED = 5
"""Candidates that are simulated and ranked, and more only for other equipment."""
STARTS = 3
"""Random sets from which the positions of the first calibration with each equipment are searched.
For the others one is enough: three find an rms that is 0.3 % lower on average, 4 % at most."""
MAX_TRIES = 12
"""Candidates of one kind that are simulated until one reaches the target."""


def plan_for(**given: Any) -> Plan:
    """Plan by the keywords of `accelstudy.plan`, checked."""
    sensor, sigma, max_time = given["sensor"], given["sigma"], given["max_time"]
    by_hand = Equipment("gravity", given["moving_time"], 0.0)
    robot = Equipment("robot", given["robot_moving_time"], given["robot_setup_time"])
    equipment = {"gravity": (by_hand,), "robot": (robot,), "both": (by_hand, robot)}
    if given["equipment"] not in equipment:
        raise UnknownNameError("equipment", given["equipment"], equipment)
    if (sensor is None) == (sigma is None):
        both = ", not both" if sensor else ""
        raise InputError(f"plan: give the sensor by `sensor`, or its noise by `sigma`{both}")
    sheet = get_data_sheet(sensor) if sigma is None else sheet_of_sigma(sigma)
    if given["history"] is not None:
        from accelstudy.data_sheets.measured import with_history  # slow to import

        sheet = with_history(sheet, given["history"])
    asked = Question(
        given["tilt_accuracy"],
        given["tilt_range"],
        sheet,
        equipment[given["equipment"]],
        given["confidence"],
        tuple(sorted({*given["holds"]})),
        given["robot_sigma"],
        math.inf if max_time is None else max_time,
        given["max_positions"],
    )
    begin("comparing calibrations, which takes some seconds ...")
    return answer(asked, given["seed"], given["replicates"])


def answer(question: Question, seed: int = 1, replicates: int = 200) -> Plan:
    """Compare all calibrations, rank those that reach the target, and simulate the first."""
    compared = _with_most_positions(question, candidates(question))
    plan = Plan(question, seed, replicates, compared)
    kinds: dict[tuple[str, str], list[Candidate]] = {}
    for c in compared:
        kinds.setdefault((c.equipment.name, c.model.name), []).append(c)
    quickest = sort_by_time(filter(None, (cheapest(question, kind) for kind in kinds.values())))
    # The first of each equipment comes before all others.
    front = {c.equipment.name: c for c in reversed(quickest)}.values()
    in_order = sorted(quickest, key=lambda c: c not in front)
    ranked = list[Candidate]()
    for candidate in track(in_order, "simulated calibrations"):
        new = candidate.equipment not in [c.equipment for c in ranked]
        confirmed = _confirm(plan, candidate, new) if new or len(ranked) < MAX_RANKED else None
        ranked += [confirmed] if confirmed else []
    known = [next((r for r in ranked if r == c), c) for c in compared]
    known += [r for r in ranked if r not in known]
    return replace(plan, candidates=known, ranked=sort_by_time(ranked))


def _with_most_positions(question: Question, known: Sequence[Candidate]) -> list[Candidate]:
    """Candidates, and calibrations in as many of the best positions as are allowed.

    There is one for each equipment with which no candidate reaches the target.
    """
    more = list[Candidate | None]()
    for equipment in question.equipment:
        possible = [c for c in known if c.equipment == equipment]
        best = most_accurate(question, possible)
        if best is not None and not any(question.reached_by(c.tilt) for c in possible):
            kind = CalibrationKind.of(question, best)
            more.append(kind.best(kind.most))
    return [*known, *filter(None, more)]


def _confirm(plan: Plan, candidate: Candidate, first: bool) -> Candidate | None:
    """The candidate, or one with a few more positions, that reaches the target in simulation.

    Parameters
    ----------
    plan : Plan, its question and simulation
    candidate : Candidate, that reaches it by linear theory
    first : bool, whether it is the first with its equipment: then its positions are searched with
        more care, and one position less is simulated, too, until it does not suffice
    """
    question, n, reached, missed = plan.question, candidate.scheme.n_positions, None, None
    kind, starts = CalibrationKind.of(question, candidate), STARTS if first else 1
    tried = candidate if candidate.starts in (0, starts) else kind.best(n, starts)
    for _ in range(MAX_TRIES):
        if tried is None:
            break
        simulated = simulate_candidate(question, tried, plan.seed, plan.replicates)
        if question.accuracy(simulated) <= question.target:
            reached = replace(tried, simulated=simulated)
        else:
            missed = simulated
        if reached is not None and (missed is not None or not first):
            break
        n += -1 if missed is None else 1
        tried = kind.best(n, starts)
    return None if reached is None else replace(reached, fewer=missed)
