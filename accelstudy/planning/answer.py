"""The answer: the cheapest candidates that reach the target, checked by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from accelstudy.basics.progress import track
from accelstudy.planning.candidates import Candidate, candidates
from accelstudy.planning.optimised import Sought, by_time, cheapest, effort
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
    stricter : Ranked, the cheapest with the same equipment as the first that reaches the target
        by the other measure (95 % of the calibrations, or the rms); None if there is none
    instead : Candidate, the cheapest with a robot, if only calibrations by hand were asked for and
        none reaches the target; None if a robot does not reach it either
    seed, replicates : int, of the simulation
    beside : Candidate, the cheapest with a calibrated sensor beside it that reaches the target by
        linear theory, or the most accurate if none does; None if the question has no such sensor
    """

    question: Question
    compared: list[Candidate]
    ranked: list[Ranked]
    stricter: Ranked | None
    instead: Candidate | None
    seed: int
    replicates: int
    beside: Candidate | None = None

    @property
    def first(self) -> Ranked:
        """The recommended candidate: by hand if that reaches the target, else with the robot."""
        checked = [r for r in self.ranked if r.simulated is not None]
        by_hand = [r for r in checked if r.candidate.equipment.name == "gravity"]
        return (by_hand or checked)[0]

    def best(self, equipment: str = "") -> Candidate | None:
        """The most accurate candidate, of all or with one equipment, however long it takes."""
        chosen = [c for c in self.compared if equipment in ("", c.equipment.name)]
        confidence = self.question.confidence
        return min(chosen, key=lambda c: c.accuracy(confidence), default=None)

    @property
    def study(self) -> dict[str, object]:
        """Configuration of the study whose cells are the simulated candidates."""
        chosen = [self.first, *(r for r in self.ranked if r.simulated and r is not self.first)]
        return study_of(self.question, [r.candidate for r in chosen], self.seed, self.replicates)


def answer(question: Question, seed: int = 1, replicates: int = 200) -> Answer:
    """Compare all calibrations, rank those that reach the target, and simulate the first."""
    confidence = question.confidence
    compared = _with_most_positions(question, candidates(question), confidence)
    kinds: dict[tuple[str, str], list[Candidate]] = {}
    for c in compared:
        kinds.setdefault(c.kind, []).append(c)
    quickest = (cheapest(question, kind, confidence) for kind in kinds.values())
    simulation = Simulation(question, confidence, seed, replicates)
    ranked: list[Ranked] = []
    in_front = _in_front(by_time(c for c in quickest if c is not None))
    for candidate in track(in_front, "simulated calibrations"):
        checked = [r.candidate.equipment.name for r in ranked if r.simulated]
        if len(checked) >= MAX_SIMULATED and candidate.equipment.name in checked:
            ranked.append(Ranked(candidate))
        elif good := simulation.confirmed(candidate, candidate.equipment.name not in checked):
            ranked.append(good)
    beside = _beside(question)
    if not any(r.simulated for r in ranked):
        instead = _with_a_robot(question)
        return Answer(question, compared, [], None, instead, seed, replicates, beside)
    compared += [r.candidate for r in ranked if r.candidate not in compared]
    plan = Answer(question, compared, _shown(ranked), None, None, seed, replicates, beside)
    same = replace(question, equipment=(plan.first.candidate.equipment,))
    other = OTHER_CONFIDENCE if confidence is None else None
    alike = _with_most_positions(
        same, [c for c in compared if c.equipment in same.equipment], other
    )
    stricter = cheapest(same, alike, other)
    if stricter is None:
        return plan
    return replace(plan, stricter=Simulation(same, other, seed, replicates).confirmed(stricter))


def _with_most_positions(
    question: Question, compared: Sequence[Candidate], confidence: float | None
) -> list[Candidate]:
    """Candidates, and calibrations in as many of the best positions as are allowed.

    There is one for each equipment with which no candidate reaches the target.
    """
    more: list[Candidate | None] = []
    for equipment in question.equipment:
        possible = [c for c in compared if c.equipment == equipment]
        if possible and not any(c.reaches(question.target, confidence) for c in possible):
            best = min(possible, key=lambda c: c.accuracy(confidence))
            sought = Sought(question, equipment, best.model.name, best.hold)
            more.append(sought.candidate(sought.most))
    return [*compared, *(c for c in more if c is not None)]


def _shown(ranked: list[Ranked]) -> list[Ranked]:
    """Rows of the table, by time: the simulated candidates, and the quickest of the others."""
    ranked = sorted(ranked, key=lambda r: effort(r.candidate))
    others = [r for r in ranked if r.simulated is None]
    left_out = others[max(0, MAX_SHOWN - len(ranked) + len(others)) :]
    return [r for r in ranked if r not in left_out]


def _with_a_robot(question: Question) -> Candidate | None:
    """Cheapest candidate with a robot by linear theory, if only those by hand were compared."""
    if any(equipment.name != "gravity" for equipment in question.equipment):
        return None
    robot = replace(question, equipment=(ROBOT,))
    return cheapest(robot, candidates(robot), question.confidence)


def _beside(question: Question) -> Candidate | None:
    """Calibration with a sensor beside it, by linear theory; see `Answer`."""
    if question.beside is None:
        return None
    alone, confidence = replace(question, equipment=(question.beside,)), question.confidence
    compared = _with_most_positions(alone, candidates(alone), confidence)
    most_accurate = min(compared, key=lambda c: c.accuracy(confidence), default=None)
    return cheapest(alone, compared, confidence) or most_accurate


@dataclass(frozen=True)
class Simulation:
    """The check of candidates by simulation.

    Attributes
    ----------
    question : Question
    confidence : float, optional, the measure by which they must reach the target
    seed, replicates : int
    """

    question: Question
    confidence: float | None
    seed: int
    replicates: int

    def of(self, candidate: Candidate) -> Simulated:
        """Simulated calibrations."""
        study = study_of(self.question, [candidate], self.seed, self.replicates)
        levels = [] if self.confidence is None else [self.confidence]
        return simulate(study, levels)[0]

    def confirmed(self, candidate: Candidate, and_no_fewer: bool = True) -> Ranked | None:
        """The candidate, or one with a few more positions, that reaches the target in simulation.

        Parameters
        ----------
        candidate : Candidate, that reaches it by linear theory
        and_no_fewer : bool, whether one position less is simulated, too, until it does not suffice
        """
        n, target = candidate.scheme.n_positions, self.question.target
        sought = Sought(self.question, candidate.equipment, candidate.model.name, candidate.hold)
        reached, missed = None, None
        for _ in range(MAX_TRIES):
            tried = candidate if n == candidate.scheme.n_positions else sought.candidate(n)
            if tried is None:
                break
            simulated = self.of(tried)
            if simulated.accuracy(self.confidence) <= target:
                reached = tried, simulated
                if missed is not None or not and_no_fewer:
                    break
                n -= 1
            else:
                missed = simulated
                if reached is not None:
                    break
                n += 1
        return None if reached is None else Ranked(*reached, missed)


def _in_front(best: Sequence[Candidate]) -> list[Candidate]:
    """Reorder candidates: the first of each equipment comes before all others."""
    first: dict[str, Candidate] = {}
    for candidate in best:
        first.setdefault(candidate.equipment.name, candidate)
    return [*first.values(), *(c for c in best if c not in first.values())]
