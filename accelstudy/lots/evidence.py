"""The evidence of one campaign for everything that its model may lack, as a lot gathers it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.wording import words
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.posterior import weigh
from accelstudy.diagnosis.decision.problem import Problem, fit_base, pose
from accelstudy.diagnosis.evidence.detection import Chance, detect
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import NOISES
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

DRAWS = 1000
"""Sets of residuals without any effect, of each campaign."""


@dataclass(frozen=True)
class SensorEvidence:
    """What one campaign says, as log odds against nothing.

    Attributes
    ----------
    campaign : str
    p_value : float, of anything missing in this campaign alone
    odds : dict of name to log odds: an effect, a kind of noise, a bumped position, or "unknown"
        with the coordinate and the target that something without a name has
    pairs : dict of two names to the log odds of both together
    classes : tuple of tuple of str, names that mean the same in this campaign
    specs : dict of effect to its best setting
    by_chance : (s, K) array, log odds of `tested` in noise alone
    tested : tuple of str, candidates and the unknown as a whole, K
    observed : (K,) array, their log odds in this campaign
    """

    campaign: str
    p_value: float
    odds: dict[str, float]
    pairs: dict[tuple[str, str], float]
    classes: tuple[tuple[str, ...], ...]
    specs: dict[str, str]
    by_chance: Array
    tested: tuple[str, ...]
    observed: Array


def sensor_evidence(
    campaign: Campaign, model: SensorModel, approach: Approach | None = None, seed: int = 1
) -> SensorEvidence:
    """Weigh everything that a model may lack to explain a campaign.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    seed : int, of the draws

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy.
    """
    problem = pose(fit_base(campaign, model, approach or usual_approach(campaign)))
    chance = Chance(np.random.SeedSequence(seed), len(problem.base.solution.design), DRAWS)
    detection = detect(problem.field, problem.evidence, problem.residuals, chance)
    weighing = weigh(problem, detection, chance)
    nothing = float(np.logaddexp.reduce(detection.noise))
    odds = {name: log - nothing for name, log in weighing.singles.densities.items()}
    odds |= {one.names[0]: one.log_weight - nothing for one in weighing.noises}
    z, unknown = problem.residuals.z, problem.field.unknown
    if unknown is not None:
        odds |= {
            called(place): log - nothing
            for place, log in unknown.by_place(problem.evidence, z).items()
        }
    pairs = {}
    for together in weighing.together:
        names = tuple(sorted(h.name for h in together.best))
        if len(names) == 2 and OUTLIER not in names:
            pairs[names[0], names[1]] = together.log_density - nothing
    names, by_chance = _by_chance(problem, chance)
    return SensorEvidence(
        campaign=campaign.name,
        p_value=detection.p_value,
        odds=odds,
        pairs=pairs,
        classes=tuple(members for _, members in weighing.classes),
        specs={
            name: best.effect.spec
            for name, best in weighing.singles.best.items()
            if best.effect is not None
        },
        by_chance=by_chance,
        tested=names,
        observed=np.array([detection.densities[name] - nothing for name in names]),
    )


def called(place: tuple[str, str]) -> str:
    """Name of something without a name that is a function of a coordinate, in a target."""
    return f"{UNKNOWN}({place[0]} → {place[1]})"


def shown(name: str) -> str:
    """Name in words."""
    if not name.startswith(UNKNOWN):
        return words(name)
    return f"something without a name {name.removeprefix(UNKNOWN)}"


def is_noise(name: str) -> bool:
    """Whether a name is a kind of wrong noise."""
    return name in NOISES


def _by_chance(problem: Problem, chance: Chance) -> tuple[tuple[str, ...], Array]:
    field, evidence = problem.field, problem.evidence

    def odds(errors: Array) -> Array:
        return field.odds(evidence, field.parts(errors), np.sum(errors**2, axis=-1))

    if not field.names:
        return (), np.zeros((DRAWS, 0))
    return field.names, chance.statistic(problem.residuals, odds).astype(np.float32)


def lot_classes(sensors: Sequence[SensorEvidence]) -> list[tuple[str, ...]]:
    """Names that mean the same in most of the campaigns that show them.

    The first one of each class has the most evidence, and stands for the others.
    """
    total: dict[str, float] = {}
    for each in sensors:
        for name, odds in each.odds.items():
            total[name] = total.get(name, 0.0) + odds
    left, classes = sorted(total, key=lambda name: (-round(total[name], 6), name)), []
    while left:
        name, *left = left
        same = [other for other in left if _same(sensors, name, other)]
        left = [other for other in left if other not in same]
        classes.append((name, *same))
    return classes


def _same(sensors: Iterable[SensorEvidence], one: str, other: str) -> bool:
    """Whether most of the campaigns that show two names cannot tell them apart."""
    shown = [each for each in sensors if one in each.odds and other in each.odds]
    alike = sum(any({one, other} <= {*members} for members in e.classes) for e in shown)
    return 2 * alike > len(shown)
