"""The answer: the cheapest candidates that reach the target, checked by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from accelstudy.basics.progress import track
from accelstudy.planning.candidates import Candidate, candidates
from accelstudy.planning.optimised import Sought, by_time, cheapest
from accelstudy.planning.question import ROBOT, Question
from accelstudy.planning.simulated import Simulated, simulate, study_of

MAX_SHOWN = 8
"""Candidates in the table."""
MAX_SIMULATED = 5
"""Candidates that are simulated."""
OTHER_CONFIDENCE = 0.95
"""Share of the calibrations that the plan also quotes if the user asked for the rms."""
MAX_TRIES = 12
"""Candidates of one kind that are simulated until one reaches the target."""


@dataclass(frozen=True)
class Ranked:
    """A candidate in the table; those at the top are simulated.

    Attributes
    ----------
    candidate : Candidate
    simulated : Simulated or None
    fewer : Simulated or None, of the best positions of which there is one less, and which miss the
        target
    """

    candidate: Candidate
    simulated: Simulated | None = None
    fewer: Simulated | None = None


@dataclass(frozen=True)
class Answer:
    """The result of a plan.

    Attributes
    ----------
    question : Question
    compared : list of Candidate, all that were compared
    ranked : list of Ranked, for each equipment and model the cheapest that reaches the target, by
        the time they take; empty if none does
    seed, replicates : int, of the simulation
    beside : Candidate, the cheapest with a calibrated sensor beside it that reaches the target by
        linear theory, or the most accurate if none does; None if the question has no such sensor
    stricter : Ranked, the cheapest with the same equipment as the first that reaches the target
        by the other measure (95 % of the calibrations, or the rms); None if there is none
    instead : Candidate, the cheapest with a robot, if only calibrations by hand were asked for and
        none reaches the target; None if a robot does not reach it either
    """

    question: Question
    compared: list[Candidate]
    ranked: list[Ranked]
    seed: int
    replicates: int
    beside: Candidate | None = None
    stricter: Ranked | None = None
    instead: Candidate | None = None

    @property
    def first(self) -> Ranked:
        """The recommended candidate: by hand if that reaches the target, else with the robot."""
        checked = [r for r in self.ranked if r.simulated is not None]
        by_hand = [r for r in checked if r.candidate.equipment.name == "gravity"]
        return (by_hand or checked)[0]

    def best(self, equipment: str = "") -> Candidate | None:
        """The most accurate candidate, of all or with one equipment, however long it takes."""
        chosen = [c for c in self.compared if equipment in ("", c.equipment.name)]
        return _most_accurate(self.question, chosen)

    @property
    def study(self) -> dict[str, object]:
        """Configuration of the study whose cells are the simulated candidates."""
        chosen = [self.first, *(r for r in self.ranked if r.simulated and r is not self.first)]
        return study_of(self.question, [r.candidate for r in chosen], self.seed, self.replicates)


def answer(question: Question, seed: int = 1, replicates: int = 200) -> Answer:
    """Compare all calibrations, rank those that reach the target, and simulate the first."""
    compared = _with_most_positions(question, candidates(question))
    kinds: dict[tuple[str, str], list[Candidate]] = {}
    for c in compared:
        kinds.setdefault((c.equipment.name, c.model.name), []).append(c)
    quickest = by_time(filter(None, (cheapest(question, kind) for kind in kinds.values())))
    # The first of each equipment comes before all others.
    front = [
        next(c for c in quickest if c.equipment == e) for e in {c.equipment: c for c in quickest}
    ]
    in_order = [*front, *(c for c in quickest if c not in front)]
    simulation, ranked = (seed, replicates), list[Ranked]()
    for candidate in track(in_order, "simulated calibrations"):
        checked = [r.candidate.equipment for r in ranked if r.simulated]
        new = candidate.equipment not in checked
        if len(checked) >= MAX_SIMULATED and not new:
            ranked.append(Ranked(candidate))
        elif good := _confirmed(question, candidate, *simulation, and_no_fewer=new):
            ranked.append(good)
    plan = Answer(question, compared, [], *simulation, _beside(question))
    if not any(r.simulated for r in ranked):
        return replace(plan, instead=_with_a_robot(question))
    compared += [r.candidate for r in ranked if r.candidate not in compared]
    plan = replace(plan, ranked=_shown(ranked))
    other = OTHER_CONFIDENCE if question.confidence is None else None
    same = replace(question, equipment=(plan.first.candidate.equipment,), confidence=other)
    alike = [c for c in compared if c.equipment in same.equipment]
    stricter = cheapest(same, _with_most_positions(same, alike))
    if stricter is None:
        return plan
    return replace(plan, stricter=_confirmed(same, stricter, *simulation))


def _most_accurate(question: Question, chosen: Sequence[Candidate]) -> Candidate | None:
    return min(chosen, key=lambda c: c.accuracy(question.confidence), default=None)


def _with_most_positions(question: Question, compared: Sequence[Candidate]) -> list[Candidate]:
    """Candidates, and calibrations in as many of the best positions as are allowed.

    There is one for each equipment with which no candidate reaches the target.
    """
    more = list[Candidate | None]()
    for equipment in question.equipment:
        possible = [c for c in compared if c.equipment == equipment]
        best = _most_accurate(question, possible)
        if best is not None and not any(c.reaches(question) for c in possible):
            sought = Sought.like(question, best)
            more.append(sought.candidate(sought.most))
    return [*compared, *filter(None, more)]


def _shown(ranked: list[Ranked]) -> list[Ranked]:
    """Rows of the table, by time: the simulated candidates, and the quickest of the others."""
    ranked = sorted(ranked, key=lambda r: r.candidate.effort)
    others = [r for r in ranked if r.simulated is None]
    left_out = others[max(0, MAX_SHOWN - len(ranked) + len(others)) :]
    return [r for r in ranked if r not in left_out]


def _with_a_robot(question: Question) -> Candidate | None:
    """Cheapest candidate with a robot by linear theory, if only those by hand were compared."""
    if any(equipment.name != "gravity" for equipment in question.equipment):
        return None
    robot = replace(question, equipment=(ROBOT,))
    return cheapest(robot, candidates(robot))


def _beside(question: Question) -> Candidate | None:
    """Calibration with a sensor beside it, by linear theory; see `Answer`."""
    if question.beside is None:
        return None
    alone = replace(question, equipment=(question.beside,))
    compared = _with_most_positions(alone, candidates(alone))
    return cheapest(alone, compared) or _most_accurate(alone, compared)


def _confirmed(
    question: Question, candidate: Candidate, seed: int, replicates: int, and_no_fewer: bool = True
) -> Ranked | None:
    """The candidate, or one with a few more positions, that reaches the target in simulation.

    Parameters
    ----------
    question : Question
    candidate : Candidate, that reaches it by linear theory
    seed, replicates : int, of the simulation
    and_no_fewer : bool, whether one position less is simulated, too, until it does not suffice
    """
    n, reached, missed = candidate.scheme.n_positions, None, None
    for _ in range(MAX_TRIES):
        tried: Candidate | None = candidate
        if n != candidate.scheme.n_positions:
            tried = Sought.like(question, candidate).candidate(n)
        if tried is None:
            break
        simulated = simulate(question, study_of(question, [tried], seed, replicates))[0]
        if simulated.accuracy(question.confidence) <= question.target:
            reached = Ranked(tried, simulated)
            if missed is not None or not and_no_fewer:
                break
            n -= 1
        else:
            missed = simulated
            if reached is not None:
                break
            n += 1
    return None if reached is None else replace(reached, fewer=missed)
