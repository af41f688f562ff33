"""The candidates: all calibrations that a plan compares, by linear theory."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from accelstudy.approaches import get_approach
from accelstudy.basics.arguments import tidy
from accelstudy.basics.arrays import Array
from accelstudy.basics.progress import track
from accelstudy.design.information import Information, position_rows
from accelstudy.design.search import Search
from accelstudy.effects import HoldConditions
from accelstudy.leveling.distribution import Tilt
from accelstudy.leveling.error import TiltError, error_in_use
from accelstudy.planning.question import Equipment, Question
from accelstudy.schemes import Scheme, get_scheme, scheme_names
from accelstudy.sensors.models import MODELS, NINE, get_model
from accelstudy.sensors.sensor import SensorModel
from accelstudy.simulation.sessions import Noise

if TYPE_CHECKING:
    from accelstudy.planning.simulated import SimulatedTilt


PLANNED_MODELS = (
    *MODELS,
    f"{NINE}-crossaxis+quadratic_scale",
    f"{NINE}-crossaxis+quadratic_scale+cubic_scale",
)
OF_SENSOR = (
    "bias",
    "scale",
    "nonorthogonality",
    "cross_axis_misalignment",
    "quadratic_scale",
    "cubic_scale",
    "mounting_rotation",
)
OF_RIG = ("base_tilt", "encoder_scale", "encoder_offset", "gravity_error")
"""Effects of the sensor and of the rig that a plan considers."""
FAMILY = "fibonacci"
SIZES = (*range(4, 25), 27, *range(30, 61, 5), *range(70, 101, 10), *range(120, 401, 40))
"""Family of evenly spread positions, and the sizes of it that are tried. They show about how many
positions are needed; `accelstudy.planning.answer` seeks the fewest."""
LEAST_REDUNDANCY = 0.25
"""Least share of redundant conditions; with fewer a wrong position would not be noticed."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One calibration.

    Attributes
    ----------
    equipment : Equipment
    model : SensorModel
    scheme : Scheme
    hold : float, s
    sigma : float, m/s², of the mean of a position
    tilt : Tilt, that it leaves by linear theory
    redundancy : int
    search : Search that found its positions; None of a known scheme
    simulated : SimulatedTilt or None
    """

    equipment: Equipment
    model: SensorModel
    scheme: Scheme
    hold: float
    sigma: float
    tilt: Tilt
    redundancy: int
    search: Search | None = None
    simulated: SimulatedTilt | None = None

    @property
    def seconds(self) -> float:
        """Time in the field, s."""
        return self.equipment.seconds(self.scheme.n_positions, self.hold)


def sort_by_time(unsorted: Iterable[Candidate]) -> list[Candidate]:
    """Candidates by the time they take, and by what they leave after it."""
    return sorted(unsorted, key=lambda c: (c.seconds, c.tilt.rms.max(), c.model.n_parameters))


def candidates(question: Question) -> list[Candidate]:
    """All calibrations in known schemes whose positions determine their model and check it.

    They are schemes of the literature, and evenly spread ones, in the order of their size.
    """
    names = {*scheme_names(), *(f"{FAMILY}-{n}" for n in SIZES)}
    schemes = sorted(map(get_scheme, names), key=lambda scheme: (scheme.n_positions, scheme.name))
    fitting = [scheme for scheme in schemes if scheme.n_positions <= question.most_positions]
    return [c for scheme in track(fitting, "calibrations") for c in in_scheme(question, scheme)]


def shortest(question: Question) -> Candidate | None:
    """Quickest calibration without limits of time and positions; None if there is none."""
    free = replace(question, most_seconds=math.inf, most_positions=SIZES[-1])
    return next(iter(sort_by_time(candidates(free))), None)


def in_scheme(
    question: Question,
    scheme: Scheme,
    models: Sequence[SensorModel] | None = None,
) -> Iterator[Candidate]:
    """Candidates in one scheme, with each equipment, of `PLANNED_MODELS` or other models."""
    models = models or [get_model(name) for name in PLANNED_MODELS]
    for equipment in question.equipment:
        n, single = scheme.n_positions, equipment.name == "gravity"
        tilts = cache(partial(_tilts, question, equipment, scheme, models))
        for hold in question.holds:
            if equipment.seconds(n, hold) > question.most_seconds:
                continue
            sigma = sigma_of(question, equipment, n, hold)
            # With a single noise, errors are in proportion to it.
            for model, tilt, redundancy in tilts(1.0 if single else sigma):
                own = tilt.with_noise(sigma) if single else tilt
                yield Candidate(equipment, model, scheme, hold, sigma, own, redundancy)


def _tilts(
    question: Question,
    equipment: Equipment,
    scheme: Scheme,
    models: Sequence[SensorModel],
    sigma: float,
) -> list[tuple[SensorModel, Tilt, int]]:
    """What each model leaves that is determined and checked, and its redundancy."""
    information = information_of(question, equipment, scheme.directions, sigma)
    found = []
    for model in models:
        redundancy = information.conditions - model.n_parameters
        if redundancy >= LEAST_REDUNDANCY * information.conditions:
            tilt = tilt_of(question, information, model, question.sizes)
            found += [] if tilt is None else [(model, tilt, redundancy)]
    return found


@cache
def every_effect() -> tuple[SensorModel, dict[str, list[int]]]:
    """The model with every effect, and the columns of the parameters of each.

    What positions tell of all its parameters is computed once; a calibration with fewer effects
    estimates some of them, and neglects others.
    """
    model = get_model("+".join((*OF_SENSOR, *OF_RIG)))
    names = list(model.parameter_names)
    return model, {e.name: [names.index(p.name) for p in e.parameters] for e in model.effects}


@cache
def error_up_to(tilt_range: float) -> TiltError:
    """Tilt error up to a tilt, rad, by all parameters of `every_effect`."""
    return error_in_use(every_effect()[0], max_tilt=tilt_range)


def information_of(
    question: Question, equipment: Equipment, directions: Array, sigma: float
) -> Information:
    """What a calibration tells of the parameters of every effect."""
    model, approach = every_effect()[0], get_approach(equipment.name)
    noise = Noise(sigma, question.sigma_angle)
    hold = HoldConditions(yaw=np.zeros(len(directions)))
    return Information.of(position_rows(model, approach, noise, directions, hold=hold))


def tilt_of(
    question: Question, information: Information, model: SensorModel, sizes: Mapping[str, float]
) -> Tilt | None:
    """Tilt error that a model leaves beside effects of some sizes, SI; None if undetermined."""
    _, columns = every_effect()
    estimated = [i for effect in model.effect_names for i in columns[effect]]
    neglected = {effect: (columns[effect], size) for effect, size in sizes.items()}
    return information.tilt(error_up_to(question.tilt_range), estimated, neglected)


def sigma_of(question: Question, equipment: Equipment, n: int, hold: float) -> float:
    """Noise of the mean of a position, m/s², with four digits: so names of cells stay short."""
    return tidy(question.sheet.sigma_mean(hold, n * (hold + equipment.moving)), 4)
