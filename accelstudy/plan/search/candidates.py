"""The candidates: all calibrations that a plan compares, by linear theory."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.progress import stage, track
from accelstudy.plan.search.question import Equipment, Question
from accelstudy.plan.search.theory import Expected, Theory, theory_of
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import MODELS, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

NINE = "bias-scale-nonorthogonality"
PLANNED_MODELS = (
    *MODELS,
    f"{NINE}-crossaxis+quadratic_scale",
    f"{NINE}-crossaxis+quadratic_scale+cubic_scale",
)
FAMILY = "fibonacci"
SIZES = (*range(9, 61), *range(65, 121, 5), *range(140, 401, 20))
"""Family of evenly spread positions, and the sizes of it that are tried."""
OPTIMAL = "i-optimal"
OPTIMAL_SIZES = (*range(9, 17), 18, 20, 22, 24, 27, 30, 33, 36, 40, 45, 50, 60, 70, 80, 100, 120)
"""Family of positions that are the best for leveling, and its sizes. Few of them are tried, since
each takes a search."""
LEAST_OPTIMAL = 0.6
"""Optimal schemes need about 2/3 of the positions of evenly spread ones; fewer than this part are
not tried."""
LEAST_REDUNDANCY = 0.25
"""Least share of redundant conditions; with fewer a wrong position would not be noticed."""


@dataclass(frozen=True)
class Candidate:
    """One calibration.

    Attributes
    ----------
    equipment : Equipment
    model : SensorModel
    scheme : Scheme
    hold : float, s
    sigma : float, m/s², of the mean of a position
    expected : Expected
    """

    equipment: Equipment
    model: SensorModel
    scheme: Scheme
    hold: float
    sigma: float
    expected: Expected

    @property
    def seconds(self) -> float:
        """Time in the field, s."""
        return self.equipment.seconds(self.scheme.n_positions, self.hold)

    @property
    def kind(self) -> tuple[str, str, str]:
        """Equipment, model and family of schemes; candidates of one kind differ in effort only."""
        return self.equipment.name, self.model.name, family_of(self.scheme.name)

    @cached_property
    def rms(self) -> float:
        """Larger rms of roll and pitch, rad."""
        return float(self.expected.rms.max())

    def accuracy(self, confidence: float | None) -> float:
        """Tilt accuracy by the measure that is asked for, rad."""
        if confidence is None:
            return self.rms
        return float(self.expected.quantile(confidence).max())

    def reaches(self, target: float, confidence: float | None) -> bool:
        """Whether the tilt accuracy is reached."""
        # Such a quantile is not much below the rms, which is faster to compute.
        if confidence is not None and confidence >= 0.7 and self.rms > target:
            return False
        return self.accuracy(confidence) <= target


def family_of(scheme: str) -> str:
    """Name of a scheme; of a family that is tried, without the number of positions."""
    found = re.fullmatch(r"(.+)-\d+", scheme)
    return found[1] if found and found[1] in (FAMILY, OPTIMAL) else scheme


def schemes_for(most_positions: int, more: Sequence[str] = ()) -> list[Scheme]:
    """Schemes of the literature, evenly spread ones, and more, in the order of their size."""
    names = {*scheme_names(), *(f"{FAMILY}-{n}" for n in SIZES), *more}
    schemes = [get_scheme(name) for name in sorted(names)]
    fitting = [scheme for scheme in schemes if scheme.n_positions <= most_positions]
    return sorted(fitting, key=lambda scheme: (scheme.n_positions, scheme.name))


def candidates(question: Question) -> list[Candidate]:
    """All calibrations whose positions determine their model and check it."""
    found: list[Candidate] = []
    for scheme in track(schemes_for(question.most_positions, question.schemes), "calibrations"):
        found += _with_scheme(question, scheme)
    for equipment in question.equipment:
        found += with_optimal(question, equipment, found, question.confidence)
    return found


def with_optimal(
    question: Question,
    equipment: Equipment,
    known: Sequence[Candidate],
    confidence: float | None,
) -> list[Candidate]:
    """Candidates with optimal positions, at most as many as the cheapest known candidate has.

    Bisection finds the smallest number that reaches the target by the measure of `confidence`.
    """

    def good(found: Iterable[Candidate]) -> list[Candidate]:
        reaching = (c for c in found if c.reaches(question.target, confidence))
        return sorted((c for c in reaching if c.equipment == equipment), key=lambda c: c.seconds)

    reached = good(known)
    most = reached[0].scheme.n_positions if reached else question.most_positions
    done = {c.scheme.name for c in known}
    least = LEAST_OPTIMAL * most if reached else 0.0
    fitting = (n for n in OPTIMAL_SIZES if least <= n <= most)
    sizes = [n for n in fitting if f"{OPTIMAL}-{n}" not in done]
    low, high = (0, len(sizes)) if reached else (max(len(sizes) - 1, 0), len(sizes))
    found: list[Candidate] = []
    with stage("optimal positions"):
        while low < high:
            middle = (low + high) // 2
            tried = _with_scheme(question, get_scheme(f"{OPTIMAL}-{sizes[middle]}"))
            found += tried
            low, high = (low, middle) if good(tried) else (middle + 1, high)
    return found


def shortest(question: Question) -> Candidate | None:
    """Quickest calibration without limits of time and positions; None if there is none."""
    free = replace(question, most_seconds=math.inf, most_positions=SIZES[-1])
    first: dict[str, Candidate] = {}
    for scheme in schemes_for(free.most_positions, free.schemes):
        for candidate in sorted(_with_scheme(free, scheme), key=lambda c: c.seconds):
            first.setdefault(candidate.equipment.name, candidate)
        if len(first) == len(question.equipment):
            break
    return min(first.values(), key=lambda c: c.seconds, default=None)


def _with_scheme(question: Question, scheme: Scheme) -> list[Candidate]:
    """Candidates in one scheme, with each equipment."""
    theory = theory_of(question.tilt_range)
    models = [get_model(name) for name in PLANNED_MODELS]
    return [
        candidate
        for equipment in question.equipment
        for candidate in _of_scheme(question, theory, equipment, scheme, models)
    ]


def _of_scheme(
    question: Question,
    theory: Theory,
    equipment: Equipment,
    scheme: Scheme,
    models: list[SensorModel],
) -> Iterator[Candidate]:
    directions, n = scheme.directions, scheme.n_positions
    at_unit: dict[str, Expected | None] = {}
    for hold in question.holds:
        if equipment.seconds(n, hold) > question.most_seconds:
            continue
        sigma = _tidy(question.sheet.sigma_mean(hold, n * (hold + equipment.moving)))
        rows: Array | None = None
        for model in models:
            if equipment.name == "gravity":  # with a single noise the result scales with it
                if model.name not in at_unit:
                    if rows is None:
                        rows = theory.rows(directions, "gravity", Noise(sigma_force=1.0))
                    at_unit[model.name] = theory.expected(rows, model, question.neglectable)
                unit = at_unit[model.name]
                expected = None if unit is None else unit.with_noise(sigma)
            else:
                if rows is None:
                    noise = Noise(sigma, question.sigma_angle)
                    rows = theory.rows(directions, equipment.name, noise)
                expected = theory.expected(rows, model, question.neglectable)
            if expected is None or expected.redundancy < LEAST_REDUNDANCY * expected.conditions:
                continue
            yield Candidate(equipment, model, scheme, hold, sigma, expected)


def _tidy(sigma: float) -> float:
    """Four digits, so that the names of cells stay short."""
    return float(f"{sigma:.4g}")
