"""The fewest positions with which a kind of calibration reaches the target."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from accelstudy.approaches import get_approach
from accelstudy.basics.arguments import tidy
from accelstudy.basics.units import GON, MGON
from accelstudy.design.criteria import MINIMAX, get_criterion
from accelstudy.design.search import Search
from accelstudy.design.task import Task
from accelstudy.planning.candidates import (
    LEAST_REDUNDANCY,
    Candidate,
    in_scheme,
    sigma_of,
    sort_by_time,
)
from accelstudy.planning.question import Equipment, Question
from accelstudy.schemes.files import parse_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise


@dataclass(frozen=True)
class CalibrationKind:
    """Calibrations that differ by their positions alone.

    Attributes
    ----------
    question : Question
    equipment : Equipment
    model : SensorModel
    hold : float, s
    """

    question: Question
    equipment: Equipment
    model: SensorModel
    hold: float

    @classmethod
    def of(cls, question: Question, candidate: Candidate) -> CalibrationKind:
        """The kind of a candidate."""
        return cls(question, candidate.equipment, candidate.model, candidate.hold)

    @property
    def least(self) -> int:
        """Number of positions with which the model is determined and checked."""
        conditions = get_approach(self.equipment.name).n_conditions
        return math.ceil(self.model.n_parameters / (1 - LEAST_REDUNDANCY) / conditions)

    @property
    def most(self) -> int:
        """Largest number of positions that the question allows."""
        most = self.question.most_positions
        each = self.hold + self.equipment.moving
        left = self.question.most_seconds - self.equipment.setup
        return most if left >= most * each else math.floor(left / each + 1e-9)

    def search(self, n: int) -> Search:
        """Search for the best n positions, as `accelstudy design` makes it."""
        noise, question = Noise(), self.question
        if self.equipment.name != "gravity":  # with a single noise the best positions are the same
            angle = tidy(question.sigma_angle / MGON, 6) * MGON
            noise = Noise(sigma_of(question, self.equipment, n, self.hold), angle)
        tilt_range = tidy(question.tilt_range / GON, 6) * GON
        return _search(self.model.name, self.equipment.name, noise, tilt_range)

    def best(self, n: int, starts: int = 1) -> Candidate | None:
        """Calibration in the best n positions; None if so many are not allowed, or too few.

        Parameters
        ----------
        n : int
        starts : int, random sets from which the positions are searched
        """
        if not self.least <= n <= self.most:
            return None
        search = self.search(n)
        directions = search.optimum(n, starts, bounded=False).directions.tolist()
        content = {"title": MINIMAX, "source": "accelstudy design", "directions": directions}
        scheme = parse_scheme(content, f"{MINIMAX}-{n}")
        alone = replace(self.question, holds=(self.hold,), equipment=(self.equipment,))
        found = next(in_scheme(alone, scheme, [self.model]), None)
        return found and replace(found, search=search, starts=starts)

    def lower_bound(self, known: Candidate) -> int:
        """Number of positions below which none reach the target.

        By linear theory, from what a known calibration of this kind leaves, and how much its
        positions lack of the best.
        """
        n = known.scheme.n_positions
        search = self.search(n)
        measure = self.question.accuracy(known.tilt) / known.tilt.rms.max() / self.question.target
        variance = n * measure**2 * np.exp(search.least_value(known.scheme.directions))
        for fewer in range(self.least, n):
            sigma = sigma_of(self.question, self.equipment, fewer, self.hold)
            unit = search.task.noise.sigma_force
            if variance * (sigma / unit) ** 2 <= fewer:
                return fewer
        return n

    def fewest(self, known: Candidate) -> Candidate | None:
        """Calibration in the fewest positions that reach the target, by linear theory.

        The search begins at the lower bound by a known calibration, and goes on as if each position
        gave the same information.
        """
        n = self.lower_bound(known)
        low, high = n - 1, self.most + 1
        found: Candidate | None = None
        while high - low > 1:
            n = min(max(n, low + 1), high - 1)
            if (best := self.best(n)) is None:
                low = n
                continue
            low = max(low, self.lower_bound(best) - 1)
            share = self.question.accuracy(best.tilt) / self.question.target
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
    bounds = []
    for c in known.values():
        kind = CalibrationKind.of(question, c)
        bounds.append((c.equipment.seconds(kind.lower_bound(c), c.hold), c, kind))
    for least, c, kind in sorted(bounds, key=lambda bound: bound[0]):
        assert found is not None
        if least <= found.seconds:
            no_longer = replace(question, most_seconds=found.seconds)  # else it costs more
            fewest = replace(kind, question=no_longer).fewest(c)
            found = sort_by_time(filter(None, [found, fewest]))[0]
    return found
