"""Positions that are the best for what was asked, and the fewest of them that suffice."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.arguments import tidy
from accelstudy.basics.units import GON, MGON
from accelstudy.design.criteria import MINIMAX
from accelstudy.planning.candidates import (
    LEAST_REDUNDANCY,
    Candidate,
    in_scheme,
    sigma_of,
    sort_by_time,
)
from accelstudy.planning.question import Equipment, Question
from accelstudy.proposal.request import Request
from accelstudy.schemes.files import remember
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

USUAL_SHARE, MIN_SHARE = 0.6, 0.4
"""Parts of the number of evenly spread positions that the best positions need."""
SURE_SHARE = 0.99
"""Where one position less, of the same information each, misses the target by 1 % or more, it is
not tried."""


@dataclass(frozen=True)
class CalibrationKind:
    """Calibrations that differ by their positions alone.

    Attributes
    ----------
    question : Question
    equipment : Equipment
    model : SensorModel
    hold : float, s
    starts : int, random sets from which positions are searched
    """

    question: Question
    equipment: Equipment
    model: SensorModel
    hold: float
    starts: int = 1

    @classmethod
    def of(cls, question: Question, candidate: Candidate, starts: int = 1) -> CalibrationKind:
        """The kind of a candidate."""
        return cls(question, candidate.equipment, candidate.model, candidate.hold, starts)

    @property
    def least(self) -> int:
        """Number of positions with which the model is determined and checked."""
        conditions = 1 if self.equipment.name == "gravity" else 3
        return math.ceil(self.model.n_parameters / (1 - LEAST_REDUNDANCY) / conditions)

    @property
    def most(self) -> int:
        """Largest number of positions that the question allows."""
        most = self.question.most_positions
        each = self.hold + self.equipment.moving
        left = self.question.most_seconds - self.equipment.setup
        return most if left >= most * each else math.floor(left / each + 1e-9)

    def seconds(self, needed: float) -> float:
        """Time that about so many positions take, s."""
        return self.equipment.seconds(max(self.least, math.ceil(needed)), self.hold)

    def request(self, n: int) -> Request:
        """Request for the best n positions, as `accelstudy design` takes it."""
        noise = Noise()
        if self.equipment.name != "gravity":  # with a single noise the best positions are the same
            angle = tidy(self.question.sigma_angle / MGON, 6) * MGON
            noise = Noise(sigma_of(self.question, self.equipment, n, self.hold), angle)
        tilt_range = tidy(self.question.tilt_range / GON, 6) * GON
        at = self.model.name, self.equipment.name, MINIMAX
        return Request(n, *at, tilt_range, noise, starts=self.starts)

    def best(self, n: int) -> Candidate | None:
        """Calibration in the best n positions; None if so many are not allowed, or too few."""
        if not self.least <= n <= self.most:
            return None
        request = self.request(n)
        content = {"title": "minimax", "source": "accelstudy design"}
        content["directions"] = _positions(request).tolist()
        scheme = remember(content, f"{MINIMAX}-{n}")
        alone = replace(self.question, holds=(self.hold,), equipment=(self.equipment,))
        return next(in_scheme(alone, scheme, [self.model], request), None)

    def fewest(self, needed: float) -> Candidate | None:
        """Calibration in the fewest positions that reach the target, by linear theory.

        The search begins near a number of positions, and goes on as if each gave the same
        information.
        """
        low, high = self.least - 1, self.most + 1
        found: Candidate | None = None
        while high - low > 1:
            n = min(max(math.ceil(needed), low + 1), high - 1)
            if (best := self.best(n)) is None:
                low = n
                continue
            share = self.question.accuracy(best.tilt) / self.question.target
            needed = n * share**2
            if share > 1:
                low = n
                continue
            high, found = n, best
            if share * _of_one_less(n) > 1:
                break
        return found


def _of_one_less(n: int) -> float:
    """Factor of an accuracy if there is one position less, of the same information each."""
    return max(1.0, SURE_SHARE * math.sqrt(n / max(n - 1, 0.5)))


@cache
def _positions(request: Request) -> NDArray[np.float64]:
    return request.search.optimum(request.starts, bounded=False).directions


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
    for c in sort_by_time(c for c in compared if question.reached_by(c.tilt)):
        first.setdefault((c.model.name, c.hold), c)
    hopes = []
    for c in first.values():
        kind = CalibrationKind.of(question, c)
        n = c.scheme.n_positions * (question.accuracy(c.tilt) / question.target) ** 2
        hopes.append((kind.seconds(USUAL_SHARE * n), kind.seconds(MIN_SHARE * n), n, kind))
    found = [*first.values()][:1]
    for _, least, n, kind in sorted(hopes, key=lambda hope: hope[0]):
        if least <= found[0].seconds:
            no_longer = replace(question, most_seconds=found[0].seconds)  # else it costs more
            fewest = replace(kind, question=no_longer).fewest(USUAL_SHARE * n)
            found = sort_by_time(filter(None, [*found, fewest]))
    return found[0] if found else None
