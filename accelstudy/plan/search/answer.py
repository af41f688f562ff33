"""The answer: the cheapest candidates that reach the target, checked by simulation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from accelstudy.basics.progress import track
from accelstudy.plan.search.candidates import Candidate, candidates, with_optimal
from accelstudy.plan.search.question import ROBOT, Question
from accelstudy.plan.search.simulated import Simulated, simulate, study_of

SHOWN = 8
"""Candidates in the table."""
SIMULATED = 5
"""Candidates that are simulated."""
OTHER_CONFIDENCE = 0.95
"""Share of the calibrations that the plan also quotes if the user asked for the rms."""
TRIES = 12
"""Candidates of one kind that are simulated until one reaches the target."""


@dataclass(frozen=True)
class Ranked:
    """A candidate in the table; those at the top are simulated."""

    candidate: Candidate
    simulated: Simulated | None = None


@dataclass(frozen=True)
class Answer:
    """The result of a plan.

    Attributes
    ----------
    question : Question
    compared : list of Candidate, all that were compared
    ranked : list of Ranked, for each equipment and model the cheapest that reaches the target, by
        the time they take; empty if none does
    stricter : Candidate, the cheapest with the same equipment as the first that reaches the target
        by the other measure (95 % of the calibrations, or the rms); None if there is none
    instead : Candidate, the cheapest with a robot, if only calibrations by hand were asked for and
        none reaches the target; None if a robot does not reach it either
    seed, replicates : int, of the simulation
    """

    question: Question
    compared: list[Candidate]
    ranked: list[Ranked]
    stricter: Candidate | None
    instead: Candidate | None
    seed: int
    replicates: int

    @property
    def first(self) -> Ranked:
        """The recommended candidate: by hand if that reaches the target, else with the robot."""
        checked = [r for r in self.ranked if r.simulated is not None]
        by_hand = [r for r in checked if r.candidate.equipment.name == "gravity"]
        return (by_hand or checked)[0]

    @property
    def best(self) -> Candidate | None:
        """The most accurate candidate, however long it takes."""
        return min(self.compared, key=self._accuracy, default=None)

    def _accuracy(self, candidate: Candidate) -> float:
        return candidate.accuracy(self.question.confidence)

    @property
    def study(self) -> dict[str, object]:
        """Configuration of the study whose cells are the simulated candidates."""
        chosen = [self.first, *(r for r in self.ranked if r.simulated and r is not self.first)]
        return study_of(self.question, [r.candidate for r in chosen], self.seed, self.replicates)


def answer(question: Question, seed: int = 1, replicates: int = 10_000) -> Answer:
    """Compare all calibrations, rank those that reach the target, and simulate the first."""
    compared = candidates(question)
    kinds: dict[tuple[str, str], list[Candidate]] = {}
    for c in by_time(c for c in compared if c.reaches(question.target, question.confidence)):
        kinds.setdefault(c.kind[:2], []).append(c)
    ranked: list[Ranked] = []
    for kind in track(_in_front(list(kinds)), "simulated calibrations"):
        checked = [r.candidate.equipment.name for r in ranked if r.simulated]
        if len(checked) >= SIMULATED and kind[0] in checked:
            ranked.append(Ranked(kinds[kind][0]))
        elif found_good := _checked(question, kinds[kind], seed, replicates):
            ranked.append(found_good)
    if not any(r.simulated for r in ranked):
        instead = _with_a_robot(question)
        return Answer(question, compared, [], None, instead, seed, replicates)
    table = _shown(ranked)
    found = Answer(question, compared, table, None, None, seed, replicates)
    equipment = found.first.candidate.equipment
    other = OTHER_CONFIDENCE if question.confidence is None else None
    compared += with_optimal(question, equipment, compared, other)
    mine = by_time(c for c in compared if c.equipment == equipment)
    stricter = next((c for c in mine if c.reaches(question.target, other)), None)
    return replace(found, stricter=stricter)


def _shown(ranked: list[Ranked]) -> list[Ranked]:
    """Rows of the table, by time: the simulated candidates, and the quickest of the others."""
    ranked = sorted(ranked, key=lambda r: _effort(r.candidate))
    others = [r for r in ranked if r.simulated is None]
    left_out = others[max(0, SHOWN - len(ranked) + len(others)) :]
    return [r for r in ranked if r not in left_out]


def _with_a_robot(question: Question) -> Candidate | None:
    """Cheapest candidate with a robot by linear theory, if only those by hand were compared."""
    if any(equipment.name != "gravity" for equipment in question.equipment):
        return None
    compared = candidates(replace(question, equipment=(ROBOT,)))
    good = (c for c in compared if c.reaches(question.target, question.confidence))
    return next(iter(by_time(good)), None)


def by_time(found: Iterable[Candidate]) -> list[Candidate]:
    """Candidates by the time they take."""
    return sorted(found, key=_effort)


def _effort(candidate: Candidate) -> tuple[float, float, int]:
    return candidate.seconds, candidate.rms, candidate.model.n_parameters


def _checked(
    question: Question, good: list[Candidate], seed: int, replicates: int
) -> Ranked | None:
    """Cheapest candidate of a kind that also reaches the target in simulation."""
    for candidate in good[:TRIES]:
        (result,) = simulate(study_of(question, [candidate], seed, replicates))
        if result.accuracy(question.confidence) <= question.target:
            return Ranked(candidate, result)
    return None


def _in_front(kinds: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Reorder kinds: the first kind of each equipment comes before all others."""
    first: dict[str, tuple[str, str]] = {}
    for kind in kinds:
        first.setdefault(kind[0], kind)
    return [*first.values(), *(kind for kind in kinds if kind not in first.values())]
