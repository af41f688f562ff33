"""A sensor of a lot: the evidence of its campaign for everything that its model may lack."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import comma_list, words
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import BaseFit, Problem, fit_base, pose
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import LEVEL as LEVEL_OF_NOISE
from accelstudy.diagnosis.evidence.sets import weigh_sets
from accelstudy.diagnosis.evidence.size import Evidence, Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.lots.noise import NoisePrior
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

NAMELESS = "something without a name "
"""What is unknown, in words."""
COLUMNS = ("angles", "yaw", "time", "temperature", "vibration")
"""What a position has beside its forces."""
MAX_CONDITION_DIFFERENCE = 0.2
"""Largest difference of conditions that are the same, in parts of their range."""
MAX_DIRECTION_DIFFERENCE = 0.15
"""Largest difference of the directions of forces in positions that are the same."""
MIN_VARIANCE = 1e-12
"""Least variance of unit weight that is divided by."""


@dataclass(frozen=True)
class SensorEvidence:
    """Evidence of one campaign, as log odds against nothing missing.

    Attributes
    ----------
    campaign : str
    p_value : float, of anything missing in this campaign alone
    odds : dict of name to log odds: an effect, a kind of noise, a bumped position, or "unknown"
        with the coordinate and the target that something without a name has
    pairs : dict of two names in order to the log odds of both together
    classes : tuple of tuple of str, names that mean the same in this campaign
    specs : dict of effect to its best setting
    shapes : dict of lasting effects that show to their shapes
    base : BaseFit, of the campaign; None where it does not determine the model
    """

    campaign: str
    p_value: float = 1.0
    odds: dict[str, float] = field(default_factory=dict)
    pairs: dict[tuple[str, str], float] = field(default_factory=dict)
    classes: tuple[tuple[str, ...], ...] = ()
    specs: dict[str, str] = field(default_factory=dict)
    shapes: dict[str, tuple[str, ...]] = field(default_factory=dict)
    base: BaseFit | None = None

    @cached_property
    def frame(self) -> SessionFit | None:
        """The calibration of the campaign, in which effects are evaluated."""
        return None if self.base is None else SessionFit.of(self.base.solution)


@dataclass(frozen=True, eq=False)
class Sensor:
    """A sensor of a lot, and what its campaign is weighed with.

    Attributes
    ----------
    campaign : Campaign
    model : SensorModel; None for one that the campaign does not determine: then it says nothing
    approach : Approach
    seed : int, of the draws
    noise : NoisePrior, in place of what the campaign says of its noise
    """

    campaign: Campaign
    model: SensorModel | None
    approach: Approach
    seed: int = 1
    noise: NoisePrior | None = None

    @property
    def measured(self) -> Campaign:
        """The campaign, with the sigma that counts."""
        if self.noise is None:
            return self.campaign
        return self.campaign.with_sigma(self.noise.sigma)

    def fit(self) -> BaseFit:
        """Fit the model to the campaign.

        Raises
        ------
        InputError
            If the positions do not determine a model, or leave no redundancy.
        """
        if self.model is None:
            raise InputError(f"{self.campaign.name}: does not determine the model")
        base = fit_base(self.measured, self.model, self.approach)
        return base if self.noise is None else replace(base, level=self.noise.level)

    def evidence(self) -> SensorEvidence:
        """Weigh everything that the model may lack to explain the campaign; raises as `fit`."""
        return SensorEvidence(self.campaign.name) if self.model is None else _weighed(self)


def _weighed(sensor: Sensor) -> SensorEvidence:
    noise = sensor.noise
    problem = pose(sensor.fit(), np.random.SeedSequence(sensor.seed))
    detection, singles = problem.detection, problem.singles
    residuals, evidence = problem.residuals, problem.evidence
    square = float(residuals.z @ residuals.z)
    # A sensor with a noise of its own is no usual one.
    usual = detection.noise if noise is None else detection.noise[:1]
    nothing = float(np.logaddexp.reduce(usual))
    logs = dict(singles.densities)
    logs |= {one.names[0]: one.log_weight for one in problem.noises}
    if noise is not None and noise.said:
        doubted = Level((1.0,), (RULES.freedom_doubted,), known=True)
        logs[LEVEL_OF_NOISE] = float(
            Evidence(doubted, evidence.redundancy).noise_density(square)[0]
        )
    pairs = {}
    for pair in weigh_sets(singles.shapes, residuals, evidence, most=2):
        one, other = sorted(shape.name if shape.place is None else "" for shape in pair.best)
        if one:
            pairs[one, other] = pair.log_density - nothing
    return SensorEvidence(
        campaign=sensor.campaign.name,
        p_value=detection.p_value,
        odds={name: log - nothing for name, log in logs.items()} | unknown_odds(problem, nothing),
        pairs=pairs,
        classes=tuple(one.members for one in problem.classes),
        specs=best_settings(problem),
        shapes={
            name: tuple(effect.spec for effect in effects)
            for name, shapes in problem.frame.candidates.items()
            if (effects := [h.effect for h in shapes.hypotheses if h.place is None])
            and not effects[0].sudden
        },
        base=problem.base,
    )


def pose_mean(sensors: Sequence[Sensor], said: Sequence[SensorEvidence]) -> Problem | None:
    """Return the problem that the mean residuals of sensors pose, or None if they have no mean.

    What all sensors have is as large in the mean, and the noise is smaller by the root of their
    number. So it shows what has no name, too. Sensors that were in different positions or
    conditions have no mean, nor have those with something sudden in their models, which each has
    at a time of its own.

    Parameters
    ----------
    sensors : all but odd ones
    said : what they say
    """
    first, models = sensors[0].campaign, [sensor.model for sensor in sensors]
    sudden = any(effect.sudden for model in models if model for effect in model.effects)
    frames = [one.frame for one in said if one.frame is not None]
    alike = len({frame.residuals.z.shape for frame in frames}) == 1
    if sudden or not alike or not all(_alike(first, each.campaign) for each in sensors):
        return None
    weights = np.array([1 / one.base.sigma for one in said if one.base is not None])
    weights /= np.linalg.norm(weights)
    table = np.array([frame.residuals.z for frame in frames])
    z, freedom = weights @ table, float((len(said) - 1) * frames[0].residuals.redundancy)
    # The scatter about the mean tells the noise, whatever the campaigns state.
    apart = float(np.sum((table - np.outer(weights, z)) ** 2)) / freedom
    level = Level((1.0,), (min(freedom, RULES.freedom_given),), known=True)
    mean = replace(frames[0].residuals, errors=z / np.sqrt(max(apart, MIN_VARIANCE)))
    base = BaseFit(frames[0].solution, level, None)
    frame = replace(frames[0], residuals=mean)
    return Problem(base, frame, np.random.SeedSequence(sensors[0].seed))


def unknown_odds(problem: Problem, nothing: float) -> dict[str, float]:
    """Log odds of functions without a name against nothing, by their places."""
    if problem.unknown is None:
        return {}
    places = problem.unknown.place_densities(problem.evidence, problem.residuals.z).items()
    return {f"{UNKNOWN}({of} → {target})": float(log) - nothing for (of, target), log in places}


def best_settings(problem: Problem) -> dict[str, str]:
    """Effects in the settings that explain most."""
    best = problem.singles.best.items()
    return {name: one.effect.spec for name, one in best if one.place is None}


def _alike(one: Campaign, other: Campaign) -> bool:
    """Whether two campaigns were in the same positions, in the same conditions."""
    if one.forces.shape != other.forces.shape:
        return False
    for name in COLUMNS:
        column, its = getattr(one, name), getattr(other, name)
        if (column is None) != (its is None):
            return False
        if column is not None:
            apart = np.max(abs(its - column))
            if apart > MAX_CONDITION_DIFFERENCE * np.ptp(column):
                return False
    a, b = (c.forces / np.linalg.norm(c.forces, axis=1, keepdims=True) for c in (one, other))
    return bool(np.max(abs(a - b)) < MAX_DIRECTION_DIFFERENCE)


def lot_classes(sensors: Sequence[SensorEvidence]) -> dict[str, tuple[str, ...]]:
    """Names that mean the same in most of the campaigns that show them, most evidence first.

    The first one of each class has the most evidence, and stands for the others.
    """
    total: dict[str, float] = {}
    for each in sensors:
        for name, odds in each.odds.items():
            total[name] = total.get(name, 0.0) + odds
    left, classes = sorted(total, key=lambda name: (-round(total[name], 6), name)), {}
    while left:
        name, *left = left
        same = [other for other in left if _same(sensors, name, other)]
        left = [other for other in left if other not in same]
        classes[name] = (name, *same)
    return classes


def _same(sensors: Iterable[SensorEvidence], one: str, other: str) -> bool:
    """Whether most of the campaigns that show two names cannot tell them apart."""
    shown = [each for each in sensors if one in each.odds and other in each.odds]
    alike = sum(any({one, other} <= {*members} for members in e.classes) for e in shown)
    return 2 * alike > len(shown)


def either(names: Sequence[str]) -> str:
    """Names that mean the same, or something without a name, in words."""
    return comma_list([words(name).replace(UNKNOWN, NAMELESS, 1) for name in names], "or")
