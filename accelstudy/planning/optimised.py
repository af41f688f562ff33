"""Positions that are the best for what was asked, and the fewest of them that suffice."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

from accelstudy.basics.units import GON, MGON
from accelstudy.design.criteria import MINIMAX
from accelstudy.planning.candidates import (
    LEAST_REDUNDANCY,
    Candidate,
    angle_sigma,
    of_scheme,
    sigma_of,
)
from accelstudy.planning.question import Equipment, Question
from accelstudy.proposal.request import Request
from accelstudy.schemes import Scheme
from accelstudy.schemes.files import remember
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise

STARTS = 1
"""Random sets from which a search starts; more find designs that are better by 0.1 % at most."""
USUAL_SHARE, MIN_SHARE = 0.6, 0.4
"""Parts of the number of evenly spread positions that the best positions need."""
REFINED_SHARE = 0.95
"""About as many of refined positions suffice as of others."""
SURE_PROBABILITY = 0.99
"""Where one position less, of the same information each, misses the target by 1 % or more, it is
not tried."""


@dataclass(frozen=True)
class Sought:
    """Calibrations in the best positions, of which the fewest are sought.

    Attributes
    ----------
    question : Question
    equipment : Equipment
    model : str
    hold : float, s
    """

    question: Question
    equipment: Equipment
    model: str
    hold: float

    @classmethod
    def like(cls, question: Question, candidate: Candidate) -> Sought:
        """Calibrations of the kind of a candidate."""
        return cls(question, candidate.equipment, candidate.model.name, candidate.hold)

    @property
    def least(self) -> int:
        """Number of positions with which the model is determined and checked."""
        conditions = 1 if self.equipment.name == "gravity" else 3
        unknown = get_model(self.model).n_parameters
        return math.ceil(unknown / (1 - LEAST_REDUNDANCY) / conditions)

    @property
    def most(self) -> int:
        """Largest number of positions that the question allows."""
        most = self.question.most_positions
        each = self.hold + self.equipment.moving
        left = self.question.most_seconds - self.equipment.setup
        return most if left >= most * each else math.floor(left / each + 1e-9)

    def request(self, n: int) -> Request:
        """Request for the best n positions, as `accelstudy design` takes it."""
        noise = Noise()
        if self.equipment.name != "gravity":  # with a single noise the best positions are the same
            angle = angle_sigma(self.question, self.equipment)
            sigma_angle = float(f"{angle / MGON:.6g}") * MGON
            noise = Noise(sigma_of(self.question, self.equipment, n, self.hold), sigma_angle)
        tilt_range = float(f"{self.question.tilt_range / GON:.6g}") * GON
        return Request(
            n, self.model, self.equipment.approach, MINIMAX, tilt_range, noise, starts=STARTS
        )

    def candidate(self, n: int, refined: bool = True) -> Candidate | None:
        """Calibration in the best n positions, or in some near them if these are not refined.

        None if so many are not allowed, or too few.
        """
        if not self.least <= n <= self.most:
            return None
        alone, request = replace(self.question, holds=(self.hold,)), self.request(n)
        scheme, models = best_positions(request, refined), [get_model(self.model)]
        return next(of_scheme(alone, self.equipment, scheme, models, request), None)

    def fewest(self, needed: float) -> Candidate | None:
        """Calibration in the fewest positions that reach the target, by linear theory.

        The search begins near a number of positions, and goes on as if each gave the same
        information; first among positions that are not refined, which takes a fifth of the time.
        """
        found = None
        for refined in (False, True):
            low, high, found = self.least - 1, self.most + 1, None
            while high - low > 1:
                n = min(max(math.ceil(needed), low + 1), high - 1)
                candidate = self.candidate(n, refined)
                share = math.inf
                if candidate is not None:
                    share = candidate.accuracy(self.question.confidence) / self.question.target
                    needed = n * share**2
                if share > 1:
                    low = n
                else:
                    high, found = n, candidate
                    if SURE_PROBABILITY * share * math.sqrt(n / max(n - 1, 0.5)) > 1:
                        break
            needed *= REFINED_SHARE
            if needed > self.most:
                return None
        return found


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
    first: dict[tuple[str, float], Candidate] = {}
    for c in by_time(c for c in compared if c.reaches(question)):
        first.setdefault((c.model.name, c.hold), c)
    best, hopes = next(iter(first.values()), None), []
    for c in first.values():
        sought = Sought.like(question, c)
        n = c.scheme.n_positions * (c.accuracy(question.confidence) / question.target) ** 2
        likely, least = (
            max(sought.least, math.ceil(part * n)) for part in (USUAL_SHARE, MIN_SHARE)
        )
        hopes.append((c.equipment.seconds(likely, c.hold), least, likely, sought))
    for _, least, likely, sought in sorted(hopes, key=lambda hope: hope[0]):
        assert best is not None
        if sought.equipment.seconds(least, sought.hold) <= best.seconds:
            no_longer = replace(question, most_seconds=best.seconds)  # else it is not the cheapest
            fewest = replace(sought, question=no_longer).fewest(likely)
            best = by_time(filter(None, [best, fewest]))[0]
    return best


def by_time(unsorted: Iterable[Candidate]) -> list[Candidate]:
    """Candidates by the time they take, and by what they leave after it."""
    return sorted(unsorted, key=lambda c: c.effort)


@cache
def best_positions(request: Request, refined: bool = True) -> Scheme:
    """The best positions, as a scheme that a study can have."""
    directions = request.find(bounded=False, refined=refined).directions.tolist()
    source = "accelstudy design"
    return remember(
        {"title": "minimax", "source": source, "directions": directions},
        f"{MINIMAX}-{request.positions}",
    )
