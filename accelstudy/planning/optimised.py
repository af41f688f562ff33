"""Positions that are the best for what was asked, and the fewest of them that suffice."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
USUALLY, AT_LEAST = 0.6, 0.4
"""Parts of the number of evenly spread positions that the best positions need."""
ROUGHLY = 0.995
"""Accuracy of the best positions, of that of positions that were sought roughly."""
SURE = 0.99
"""Where one position less, of the same information each, misses the target by 1 % or more, it is
not tried."""


@dataclass(frozen=True)
class Sought:
    """Calibrations of which the fewest positions are sought.

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

    def candidate(self, n: int, rough: bool = False) -> Candidate | None:
        """Calibration in the best n positions; None if so many are not allowed, or too few.

        `rough` asks for positions near the best ones.
        """
        if not self.least <= n <= self.most:
            return None
        alone = replace(self.question, holds=(self.hold,))
        scheme = best_positions(self.request(n), rough)
        return next(of_scheme(alone, self.equipment, scheme, [get_model(self.model)]), None)

    def fewest(self, confidence: float | None, near: int) -> Candidate | None:
        """Calibration in the fewest positions that reach the target, by linear theory.

        The search begins near a number of positions, first roughly, and goes on as if each gave
        the same information. It ends where one position less is known to miss the target.
        """
        target, tried = self.question.target, {}
        near = self._roughly_fewest(confidence, near)
        if SURE**2 * near > self.most:
            return None
        low, high = self.least - 1, self.most + 1
        while high - low > 1:
            n = min(max(near, low + 1), high - 1)
            tried[n] = candidate = self.candidate(n)
            if candidate is None:
                low = n
                continue
            share = candidate.accuracy(confidence) / target
            near = math.ceil(n * share**2)
            if share > 1:
                low = n
            else:
                high = n
                if n > 1 and SURE * share * math.sqrt(n / (n - 1)) > 1:
                    break
        return tried.get(high)

    def _roughly_fewest(self, confidence: float | None, near: int) -> int:
        """Number of positions that reach the target by a rough search; the least is not tried."""
        tried: set[int] = set()
        while near > self.least and near not in tried:
            tried.add(near)
            n = min(near, self.most)
            candidate = self.candidate(n, rough=True)
            if candidate is None:
                break
            share = ROUGHLY * candidate.accuracy(confidence) / self.question.target
            near = math.ceil(n * share**2)
        return near


def cheapest(question: Question, good: Sequence[Candidate], confidence: float | None) -> Candidate:
    """Cheapest calibration: a known one, or one in the fewest of the best positions.

    Parameters
    ----------
    question : Question
    good : candidates with one equipment that reach the target, by time; their models are tried
    confidence : float, optional, see `Question`
    """
    best, hopes = good[0], []
    for model, hold in dict.fromkeys((c.model.name, c.hold) for c in good):
        first = next(c for c in good if (c.model.name, c.hold) == (model, hold))
        sought = Sought(question, first.equipment, model, hold)
        n = first.scheme.n_positions * (first.accuracy(confidence) / question.target) ** 2
        likely, least = (max(sought.least, math.ceil(part * n)) for part in (USUALLY, AT_LEAST))
        hopes.append((first.equipment.seconds(likely, hold), least, likely, sought))
    for _, least, likely, sought in sorted(hopes, key=lambda hope: hope[0]):
        if sought.equipment.seconds(least, sought.hold) <= best.seconds:
            no_longer = replace(question, most_seconds=best.seconds)  # else it is not the cheapest
            fewest = replace(sought, question=no_longer).fewest(confidence, likely)
            best = min(filter(None, [best, fewest]), key=lambda c: (c.seconds, c.rms))
    return best


def is_best(scheme: Scheme) -> bool:
    """Whether a scheme is one of `best_positions`."""
    return scheme.name.startswith(f"{MINIMAX}-")


def request_of(question: Question, candidate: Candidate) -> Request:
    """Request that finds the positions of a candidate that are the best."""
    sought = Sought(question, candidate.equipment, candidate.model.name, candidate.hold)
    return sought.request(candidate.scheme.n_positions)


@cache
def best_positions(request: Request, rough: bool = False) -> Scheme:
    """The best positions, or such as are near them, as a scheme that a study can have."""
    directions = request.find(bounded=False, rough=rough).directions.tolist()
    source = "accelstudy design"
    return remember(
        {"title": "minimax", "source": source, "directions": directions},
        f"{MINIMAX}-{request.positions}",
    )
