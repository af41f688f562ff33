"""The candidates: all calibrations that a plan compares, by linear theory."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.progress import track
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.design.information import Information
from accelstudy.planning.question import Equipment, Question
from accelstudy.planning.theory import Expected, Theory, theory_of
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import MODELS, NINE, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

Array = NDArray[np.float64]

PLANNED_MODELS = (
    *MODELS,
    f"{NINE}-crossaxis+quadratic_scale",
    f"{NINE}-crossaxis+quadratic_scale+cubic_scale",
)
ROTATIONS = {"cross_axis_misalignment", "mounting_rotation"}
"""Effects that have the rotation of the sensor against what tells its attitude."""
FAMILY = "fibonacci"
SIZES = (*range(4, 25), 27, *range(30, 61, 5), *range(70, 101, 10), *range(120, 401, 40))
"""Family of evenly spread positions, and the sizes of it that are tried. They show about how many
positions are needed; `accelstudy.planning.optimised` seeks the fewest."""
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
    def kind(self) -> tuple[str, str]:
        """Equipment and model; the cheapest candidate of each kind is sought."""
        return self.equipment.name, self.model.name

    @cached_property
    def rms(self) -> float:
        """Larger rms of roll and pitch, rad."""
        return float(self.expected.rms.max())

    def accuracy(self, confidence: float | None) -> float:
        """Tilt accuracy by the measure that is asked for, rad."""
        if confidence is None:
            return self.rms
        return self.expected.of_both(confidence)

    def reaches(self, target: float, confidence: float | None) -> bool:
        """Whether the tilt accuracy is reached."""
        # Such a quantile is not much below the rms, which is faster to compute.
        if confidence is not None and confidence >= 0.7 and self.rms > target:
            return False
        return self.accuracy(confidence) <= target


def schemes_for(most_positions: int, more: Sequence[str] = ()) -> list[Scheme]:
    """Schemes of the literature, evenly spread ones, and more, in the order of their size."""
    names = {*scheme_names(), *(f"{FAMILY}-{n}" for n in SIZES), *more}
    schemes = [get_scheme(name) for name in sorted(names)]
    fitting = [scheme for scheme in schemes if scheme.n_positions <= most_positions]
    return sorted(fitting, key=lambda scheme: (scheme.n_positions, scheme.name))


def candidates(question: Question) -> list[Candidate]:
    """All calibrations in known schemes whose positions determine their model and check it."""
    schemes = schemes_for(question.most_positions, question.schemes)
    return [c for scheme in track(schemes, "calibrations") for c in _with_scheme(question, scheme)]


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
    models = [get_model(name) for name in PLANNED_MODELS]
    return [
        candidate
        for equipment in question.equipment
        for candidate in of_scheme(question, equipment, scheme, models)
    ]


def of_scheme(
    question: Question, equipment: Equipment, scheme: Scheme, models: list[SensorModel]
) -> Iterator[Candidate]:
    """Candidates in one scheme with one equipment."""
    if equipment.reference is not None:  # the rotation between the sensors is unknown
        models = [model for model in models if ROTATIONS & {*names_of(model)}]

    @cache
    def expected(sigma: float) -> list[Expected | None]:
        """Errors that each of the models leaves."""
        theory = theory_of(question.tilt_range)
        information = information_of(question, equipment, theory, scheme.directions, sigma)
        return [theory.expected(information, names_of(m), question.neglectable) for m in models]

    n = scheme.n_positions
    for hold in question.holds:
        if equipment.seconds(n, hold) > question.most_seconds:
            continue
        sigma = sigma_of(question, equipment, n, hold)
        single = equipment.name == "gravity"  # with a single noise, errors are in proportion to it
        for model, each in zip(models, expected(1.0 if single else sigma), strict=True):
            if each is not None and each.redundancy >= LEAST_REDUNDANCY * each.conditions:
                own = each.with_noise(sigma) if single else each
                yield Candidate(equipment, model, scheme, hold, sigma, own)


def information_of(
    question: Question, equipment: Equipment, theory: Theory, directions: Array, sigma: float
) -> Information:
    """What a calibration tells of the parameters of every effect."""
    noise = Noise(sigma, angle_sigma(question, equipment))
    return theory.information(directions, equipment.approach, noise, equipment.reference)


def angle_sigma(question: Question, equipment: Equipment) -> float:
    """Noise of roll and pitch, rad, of a level position."""
    reference = equipment.reference
    return question.sigma_angle if reference is None else reference.sigma_mps2 / STANDARD_GRAVITY


def names_of(model: SensorModel) -> tuple[str, ...]:
    """Names of the effects of a model."""
    return tuple(effect.name for effect in model.effects)


def sigma_of(question: Question, equipment: Equipment, n: int, hold: float) -> float:
    """Noise of the mean of a position, m/s², with four digits: so names of cells stay short."""
    return float(f"{question.sheet.sigma_mean(hold, n * (hold + equipment.moving)):.4g}")
