"""The answer: the cheapest candidates that reach the target, in the fewest positions, simulated."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError, check_name
from accelstudy.basics.progress import begin, track
from accelstudy.data_sheets import get_data_sheet, sheet_of_sigma
from accelstudy.design.criteria import MINIMAX, get_criterion
from accelstudy.design.search import Search
from accelstudy.design.task import Task
from accelstudy.planning.candidates import (
    LEAST_REDUNDANCY,
    Candidate,
    candidates,
    in_scheme,
    sigma_of,
    sort_by_time,
)
from accelstudy.planning.plan import Plan, most_accurate
from accelstudy.planning.question import Equipment, Question
from accelstudy.planning.simulated import simulate_candidate
from accelstudy.positions.scheme_file import parse_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise

MAX_RANKED = 5
"""Candidates that are simulated and ranked, and more only for other equipment."""
STARTS = 3
"""Random sets from which the positions of the first calibration with each equipment are searched.
For the others one is enough: three find an rms that is 0.3 % lower on average, 4 % at most."""
MAX_TRIES = 12
"""Candidates of one kind that are simulated until one reaches the target."""


def plan_for(**keywords: Any) -> Plan:
    """Plan by the keywords of `accelstudy.plan`, checked."""
    sensor, sigma, max_time = keywords["sensor"], keywords["sigma"], keywords["max_time"]
    by_hand = Equipment("gravity", keywords["moving_time"], 0.0)
    robot = Equipment("robot", keywords["robot_moving_time"], keywords["robot_setup_time"])
    equipment = {"gravity": (by_hand,), "robot": (robot,), "both": (by_hand, robot)}
    check_name("equipment", keywords["equipment"], equipment)
    if (sensor is None) == (sigma is None):
        both = ", not both" if sensor else ""
        raise InputError(f"plan: give the sensor by `sensor`, or its noise by `sigma`{both}")
    sheet = get_data_sheet(sensor) if sigma is None else sheet_of_sigma(sigma)
    if keywords["history"] is not None:
        from accelstudy.data_sheets.measured import with_history  # slow to import

        sheet = with_history(sheet, keywords["history"])
    asked = Question(
        keywords["tilt_accuracy"],
        keywords["tilt_range"],
        sheet,
        equipment[keywords["equipment"]],
        keywords["robot_sigma"],
        keywords["max_positions"],
        keywords["confidence"],
        tuple(sorted({*keywords["holds"]})),
        math.inf if max_time is None else max_time,
    )
    begin("comparing calibrations, which takes some seconds ...")
    return answer(asked, keywords["seed"], keywords["replicates"])


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
    return replace(plan, ranked=sort_by_time(ranked))


def _with_most_positions(question: Question, known: Sequence[Candidate]) -> list[Candidate]:
    """Candidates, and calibrations in as many of the best positions as are allowed.

    There is one for each equipment with which no candidate reaches the target.
    """
    more = list[Candidate | None]()
    for equipment in question.equipment:
        possible = [c for c in known if c.equipment == equipment]
        best = most_accurate(question, possible)
        if best is not None and not any(question.reached_by(c.tilt) for c in possible):
            more.append(in_best_positions(question, best, most_positions(question, best)))
    return [*known, *filter(None, more)]


def _confirm(plan: Plan, candidate: Candidate, first: bool) -> Candidate | None:
    """The candidate, or one with a few more positions, that reaches the target in simulation.

    Parameters
    ----------
    plan : Plan, its question and simulation
    candidate : Candidate, that reaches it by linear theory
    first : bool, whether it is the first with its equipment: then its positions are searched with
        more care
    """
    question, starts = plan.question, STARTS if first else 1
    tried: Candidate | None = candidate
    if first and candidate.search is not None:
        tried = in_best_positions(question, candidate, candidate.scheme.n_positions, starts)
    for _ in range(MAX_TRIES):
        if tried is None:
            break
        simulated = simulate_candidate(question, tried, plan.seed, plan.replicates)
        if question.accuracy(simulated) <= question.target:
            return replace(tried, simulated=simulated)
        tried = in_best_positions(question, tried, tried.scheme.n_positions + 1, starts)
    return None


def in_best_positions(
    question: Question, like: Candidate, n: int, starts: int = 1
) -> Candidate | None:
    """Return a candidate in the best n positions; None if so many are not allowed, or too few.

    Parameters
    ----------
    question : Question
    like : Candidate, which differs from it by its positions alone
    n : int
    starts : int, random sets from which the positions are searched
    """
    if not least_positions(like) <= n <= most_positions(question, like):
        return None
    search = search_like(question, like, n)
    directions = search.optimum(n, starts).tolist()
    content = {"title": MINIMAX, "source": "accelstudy plan", "directions": directions}
    scheme = parse_scheme(content, f"{MINIMAX}-{n}")
    alone = replace(question, holds=(like.hold,), equipment=(like.equipment,))
    found = next(in_scheme(alone, scheme, [like.model]), None)
    return found and replace(found, search=search)


def search_like(question: Question, like: Candidate, n: int) -> Search:
    """Return the search for the best n positions of calibrations like a candidate."""
    noise = Noise()
    if like.equipment.name != "gravity":  # with a single noise the best positions are the same
        sigma = sigma_of(question, like.equipment, n, like.hold)
        noise = Noise(sigma, question.sigma_angle)
    return _search(like.model.name, like.equipment.name, noise, question.tilt_range)


def least_positions(like: Candidate) -> int:
    """Return the number of positions with which the model is determined and checked."""
    conditions = get_approach(like.equipment.name).n_conditions
    return math.ceil(like.model.n_parameters / (1 - LEAST_REDUNDANCY) / conditions)


def most_positions(question: Question, like: Candidate) -> int:
    """Return the largest number of positions that a question allows for such calibrations."""
    left = question.most_seconds - like.equipment.setup
    each = like.hold + like.equipment.moving
    return math.floor(min(question.most_positions, left / each + 1e-9))


def lower_bound(question: Question, known: Candidate) -> int:
    """Return the number of positions below which no calibration like one reaches the target.

    By linear theory, from what the known one leaves, and how much its positions lack of the best.
    """
    n = known.scheme.n_positions
    search = search_like(question, known, n)
    measure = question.accuracy(known.tilt) / known.tilt.rms.max() / question.target
    variance = n * measure**2 * np.exp(search.least_value(known.scheme.directions))
    for fewer in range(least_positions(known), n):
        sigma = sigma_of(question, known.equipment, fewer, known.hold)
        unit = search.task.noise.sigma_force
        if variance * (sigma / unit) ** 2 <= fewer:
            return fewer
    return n


def in_fewest_positions(question: Question, known: Candidate) -> Candidate | None:
    """Return a candidate in the fewest positions that reach the target, by linear theory.

    The search begins at the lower bound by a known one, and goes on as if each position gave the
    same information.
    """
    n = lower_bound(question, known)
    low, high = n - 1, most_positions(question, known) + 1
    found: Candidate | None = None
    while high - low > 1:
        n = min(max(n, low + 1), high - 1)
        if (best := in_best_positions(question, known, n)) is None:
            low = n
            continue
        low = max(low, lower_bound(question, best) - 1)
        share = question.accuracy(best.tilt) / question.target
        if share > 1:
            low = max(low, n)
        else:
            high, found = n, best
        n = math.ceil(n * share**2)
    return found


@cache
def _search(model: str, approach: str, noise: Noise, tilt_range: float) -> Search:
    task = Task(get_model(model), get_approach(approach), noise, tilt_range)
    return Search(task, get_criterion(MINIMAX, task))


def cheapest(question: Question, compared: Iterable[Candidate]) -> Candidate | None:
    """Cheapest calibration: a known one, or one in the fewest of the best positions.

    Parameters
    ----------
    question : Question
    compared : candidates with one equipment; models and holds of those that reach the target by
        linear theory are tried

    Returns
    -------
    Candidate, or None if none reaches the target
    """
    known: dict[tuple[str, float], Candidate] = {}
    for c in sort_by_time(c for c in compared if question.reached_by(c.tilt)):
        known.setdefault((c.model.name, c.hold), c)
    found = next(iter(known.values()), None)
    bounds = [(c.equipment.seconds(lower_bound(question, c), c.hold), c) for c in known.values()]
    for least, c in sorted(bounds, key=lambda bound: bound[0]):
        assert found is not None
        if least <= found.seconds:
            no_longer = replace(question, most_seconds=found.seconds)  # else it costs more
            fewest = in_fewest_positions(no_longer, c)
            found = sort_by_time(filter(None, [found, fewest]))[0]
    return found
