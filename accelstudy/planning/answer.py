"""The answer: the cheapest candidates that reach the target, checked by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from accelstudy.basics.progress import track
from accelstudy.planning.best_positions import CalibrationKind, cheapest
from accelstudy.planning.candidates import Candidate, candidates, sort_by_time
from accelstudy.planning.question import ROBOT, Question
from accelstudy.planning.simulated import simulate_candidates, study_of

MAX_SHOWN = 8
"""Candidates in the table."""
MAX_SIMULATED = 5
"""Candidates that are simulated."""
STARTS = 3
"""Random sets from which the positions of the first calibration with each equipment are searched.
For the others one is enough: three find an rms that is 0.3 % lower on average, 4 % at most."""
MAX_TRIES = 12
"""Candidates of one kind that are simulated until one reaches the target."""


@dataclass(frozen=True)
class Answer:
    """The result of a plan.

    Attributes
    ----------
    question : Question
    seed, replicates : int, of the simulation
    compared : list of Candidate, all that were compared
    ranked : list of Candidate, for each equipment and model the cheapest that reaches the target,
        by the time they take; empty if none does
    instead : Candidate, the cheapest with a robot, if only calibrations by hand were asked for and
        none reaches the target; None if a robot does not reach it either
    """

    question: Question
    seed: int
    replicates: int
    compared: list[Candidate]
    ranked: list[Candidate] = field(default_factory=list)
    instead: Candidate | None = None

    @property
    def simulated_candidates(self) -> list[Candidate]:
        """Candidates in the table that are simulated, the recommended one first.

        That is by hand if that reaches the target, else with the robot.
        """
        simulated = [c for c in self.ranked if c.simulated is not None]
        first = [c for c in simulated if c.equipment.name == "gravity"][:1] or simulated[:1]
        return first + [c for c in simulated if c is not first[0]]

    @property
    def first(self) -> Candidate:
        """The recommended candidate."""
        return self.simulated_candidates[0]

    def best(self, equipment: str = "") -> Candidate | None:
        """The most accurate candidate, of all or with one equipment, however long it takes."""
        chosen = [c for c in self.compared if equipment in ("", c.equipment.name)]
        return _most_accurate(self.question, chosen)

    @property
    def study(self) -> dict[str, object]:
        """Configuration of the study whose cells are the simulated candidates."""
        return study_of(self.question, self.simulated_candidates, self.seed, self.replicates)


def answer(question: Question, seed: int = 1, replicates: int = 200) -> Answer:
    """Compare all calibrations, rank those that reach the target, and simulate the first."""
    compared = _with_most_positions(question, candidates(question))
    plan = Answer(question, seed, replicates, compared)
    kinds: dict[tuple[str, str], list[Candidate]] = {}
    for c in plan.compared:
        kinds.setdefault((c.equipment.name, c.model.name), []).append(c)
    quickest = sort_by_time(filter(None, (cheapest(question, kind) for kind in kinds.values())))
    # The first of each equipment comes before all others.
    front = {c.equipment.name: c for c in reversed(quickest)}.values()
    in_order = sorted(quickest, key=lambda c: c not in front)
    ranked = list[Candidate]()
    for candidate in track(in_order, "simulated calibrations"):
        checked = [c.equipment for c in ranked if c.simulated]
        new = candidate.equipment not in checked
        if len(checked) >= MAX_SIMULATED and not new:
            ranked.append(candidate)
        elif good := _confirm(plan, candidate, new):
            ranked.append(good)
    if not any(c.simulated for c in ranked):
        return replace(plan, instead=_with_a_robot(question))
    known = [next((r for r in ranked if r == c), c) for c in plan.compared]
    known += [r for r in ranked if r not in known]
    return replace(plan, compared=known, ranked=_table_rows(ranked))


def _most_accurate(question: Question, chosen: Sequence[Candidate]) -> Candidate | None:
    return min(chosen, key=lambda c: question.accuracy(c.tilt), default=None)


def _with_most_positions(question: Question, known: Sequence[Candidate]) -> list[Candidate]:
    """Candidates, and calibrations in as many of the best positions as are allowed.

    There is one for each equipment with which no candidate reaches the target.
    """
    more = list[Candidate | None]()
    for equipment in question.equipment:
        possible = [c for c in known if c.equipment == equipment]
        best = _most_accurate(question, possible)
        if best is not None and not any(question.reached_by(c.tilt) for c in possible):
            kind = CalibrationKind.of(question, best)
            more.append(kind.best(kind.most))
    return [*known, *filter(None, more)]


def _table_rows(ranked: list[Candidate]) -> list[Candidate]:
    """Rows of the table, by time: the simulated candidates, and the quickest of the others."""
    ranked = sort_by_time(ranked)
    others = [c for c in ranked if c.simulated is None]
    left_out = others[max(0, MAX_SHOWN - len(ranked) + len(others)) :]
    return [c for c in ranked if c not in left_out]


def _with_a_robot(question: Question) -> Candidate | None:
    """Cheapest candidate with a robot by linear theory, if only those by hand were compared."""
    if any(equipment.name != "gravity" for equipment in question.equipment):
        return None
    robot = replace(question, equipment=(ROBOT,))
    return cheapest(robot, candidates(robot))


def _confirm(plan: Answer, candidate: Candidate, first: bool) -> Candidate | None:
    """The candidate, or one with a few more positions, that reaches the target in simulation.

    Parameters
    ----------
    plan : Answer, its question and simulation
    candidate : Candidate, that reaches it by linear theory
    first : bool, whether it is the first with its equipment: then its positions are searched with
        more care, and one position less is simulated, too, until it does not suffice
    """
    question, n, reached, missed = plan.question, candidate.scheme.n_positions, None, None
    kind = CalibrationKind.of(question, candidate, STARTS if first else 1)
    tried = candidate if candidate.request is None else kind.best(n)
    for _ in range(MAX_TRIES):
        if tried is None:
            break
        config = study_of(question, [tried], plan.seed, plan.replicates)
        (simulated,) = simulate_candidates(question, config)
        if question.accuracy(simulated) <= question.target:
            reached = replace(tried, simulated=simulated)
            if missed is not None or not first:
                break
            n -= 1
        else:
            missed = simulated
            if reached is not None:
                break
            n += 1
        tried = kind.best(n)
    return None if reached is None else replace(reached, fewer=missed)
