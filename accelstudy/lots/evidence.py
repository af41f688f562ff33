"""The evidence of one campaign for everything that its model may lack, as a lot gathers it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.wording import words
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.posterior import Case
from accelstudy.diagnosis.decision.problem import Problem, fit_base, pose
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.evidence.noise_tests import LEVEL as LEVEL_OF_NOISE
from accelstudy.diagnosis.evidence.noise_tests import NOISES
from accelstudy.diagnosis.evidence.sets import weigh_sets
from accelstudy.diagnosis.evidence.size import Evidence, Level, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import Effect
from accelstudy.lots.noise import LEAST_SIGMA, SensorNoise, with_noise
from accelstudy.lots.sizes import visible
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

DRAWS = 1000
"""Sets of residuals without any effect, of each campaign."""
COLUMNS = ("angles", "yaw", "time", "temperature", "vibration")
"""What a position has beside its forces."""
MIN_VARIANCE = 1e-300
"""Variance that can be divided by."""
MAX_LOG_DIFFERENCE = 0.3
"""Largest difference of the logarithms of settings that are nearly the same."""
MAX_CONDITION_DIFFERENCE = 0.2
"""Largest difference of conditions that are the same, in parts of their range."""
MAX_DIRECTION_DIFFERENCE = 0.15
"""Largest difference of the directions of forces in positions that are the same."""


@dataclass(frozen=True)
class Shown:
    """The shapes of an effect in the residuals z of a campaign, in units of its noise.

    Attributes
    ----------
    specs : tuple of str, the effect in each of its shapes
    settings : (s, q) array, those of the shapes
    normal : (s, k, k) array, DᵀD of the derivatives D of z by the parameters
    right : (s, k) array, Dᵀz
    squares : (s, k) array, of what D would be if no parameter of the model were estimated
    """

    specs: tuple[str, ...]
    settings: Array
    normal: Array
    right: Array
    squares: Array

    @classmethod
    def of(cls, problem: Problem, effects: Sequence[Effect], variance: float) -> Shown:
        """Of shapes of an effect, by a campaign whose residuals have a variance of unit weight."""
        residuals = problem.residuals
        columns = residuals.whitened(problem.frame.signatures(effects))
        shape = (len(columns), len(effects), -1)
        d = residuals.project(columns).reshape(shape)
        return cls(
            specs=tuple(effect.spec for effect in effects),
            settings=np.array([[*effect.settings.values()] for effect in effects], dtype=float),
            normal=np.einsum("msk,msl->skl", d, d) / variance,
            right=np.einsum("msk,m->sk", d, residuals.z) / variance,
            squares=np.sum(columns.reshape(shape) ** 2, axis=0) / variance,
        )

    def nearest(self, settings: Array) -> int | None:
        """Place of the shape with these settings, or nearly so."""
        if not settings.size:
            return 0
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = np.max(abs(np.nan_to_num(np.log(self.settings / settings))), axis=1)
        best = int(np.argmin(apart))
        return best if apart[best] < MAX_LOG_DIFFERENCE else None


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
    redundancy : int
    residuals : (m,) array, m/s², of the means of the positions, equally uncertain
    freedom : int, redundancy of these
    square : float, ‖z‖² of all residuals, in units of the noise: of the type where it is known
    shown : dict of effect to what its shapes would show in the residuals, in the same units
    pair_specs : dict of two names to their best settings beside each other
    variance : float, (m/s²)², of a position mean, by the noise of the lot and the residuals
    """

    campaign: str
    p_value: float
    odds: dict[str, float]
    pairs: dict[tuple[str, str], float]
    classes: tuple[tuple[str, ...], ...]
    specs: dict[str, str]
    redundancy: int
    residuals: Array
    freedom: int = 0
    square: float = 0.0
    shown: dict[str, Shown] = field(default_factory=dict)
    pair_specs: dict[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    variance: float = 1.0

    def nearest(self, name: str, settings: Array) -> tuple[Shown, int] | None:
        """What is shown of an effect with these settings, or nearly so."""
        if name not in self.shown:
            return None
        place = self.shown[name].nearest(settings)
        return None if place is None else (self.shown[name], place)


@dataclass(frozen=True)
class AnythingOdds:
    """What tells whether anything is missing in a campaign.

    Attributes
    ----------
    names : tuple of str, candidates and the unknown as a whole, K
    odds : (1 + s, K) array, their log odds in the campaign, and in noise alone
    """

    names: tuple[str, ...]
    odds: NDArray[np.float32]


def sensor_evidence(
    campaign: Campaign,
    model: SensorModel | None,
    approach: Approach | None = None,
    seed: int = 1,
    noise: SensorNoise | None = None,
) -> tuple[SensorEvidence, AnythingOdds]:
    """Weigh everything that a model may lack to explain a campaign.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel; None for one that the campaign does not determine: then it says nothing
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    seed : int, of the draws
    noise : SensorNoise, in place of what the campaign says of its noise

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy.
    """
    if model is None:
        silent = SensorEvidence(campaign.name, 1.0, {}, {}, (), {}, 0, np.zeros(0))
        return silent, AnythingOdds((), np.zeros((1 + DRAWS, 0), dtype=np.float32))
    campaign = with_noise(campaign, noise)
    base = fit_base(campaign, model, approach or usual_approach(campaign))
    problem = pose(base if noise is None else replace(base, level=noise.level))
    chance = Chance(np.random.SeedSequence(seed), len(problem.base.solution.design), DRAWS)
    case = Case(problem, campaign, chance)
    detection = case.detection
    # A sensor with a noise of its own is no usual one.
    usual = detection.noise if noise is None else detection.noise[:1]
    nothing = float(np.logaddexp.reduce(usual))
    z, unknown, of_means = problem.residuals.z, problem.unknown, problem.residuals
    odds = {name: log - nothing for name, log in case.singles.densities.items()}
    odds |= {one.names[0]: one.log_weight - nothing for one in case.noises}
    if noise is not None and noise.said:
        doubted = Level((1.0,), (RULES.freedom_doubted,), known=True)
        any_level = Evidence(doubted, problem.evidence.redundancy)
        odds[LEVEL_OF_NOISE] = float(any_level.of_noise(z @ z)[0]) - nothing
    if unknown is not None:
        odds |= {
            called(place): log - nothing
            for place, log in unknown.by_place(problem.evidence, z).items()
        }
    pairs, pair_specs = {}, {}
    for pair in weigh_sets(case.singles.shapes, problem.residuals, problem.evidence, most=2):
        effects = sorted((h.effect for h in pair.best if h.effect), key=lambda e: e.name)
        if len(effects) == 2:
            one, other = effects
            pairs[one.name, other.name] = pair.log_density - nothing
            pair_specs[one.name, other.name] = one.spec, other.spec
    of_unit_weight = max(problem.evidence.variance(float(z @ z)), MIN_VARIANCE)
    variance = of_unit_weight if noise is None else 1.0
    evidence = SensorEvidence(
        campaign=campaign.name,
        p_value=detection.p_value,
        odds=odds,
        pairs=pairs,
        classes=tuple(one.members for one in case.classes),
        specs={
            name: best.effect.spec
            for name, best in case.singles.best.items()
            if best.effect is not None
        },
        pair_specs=pair_specs,
        redundancy=problem.residuals.redundancy,
        residuals=of_means.z * base.sigma,
        freedom=of_means.redundancy,
        variance=base.sigma**2 * of_unit_weight,
        square=float(z @ z) / variance,
        shown={
            name: Shown.of(problem, effects, variance)
            for name, shapes in problem.examined.candidates.items()
            if (effects := [h.effect for h in shapes if h.effect is not None])
            and not effects[0].sudden
        },
    )
    observed = [detection.densities[name] - nothing for name in problem.field.names]
    by_chance = _by_chance(problem, chance, noise)
    odds_of_all = np.concatenate([np.reshape(observed, (1, -1)), by_chance])
    return evidence, AnythingOdds(problem.field.names, odds_of_all.astype(np.float32))


def mean_sensor(
    campaigns: Sequence[Campaign],
    sensors: Sequence[SensorEvidence],
    noises: Sequence[SensorNoise | None],
) -> tuple[Campaign, SensorNoise] | None:
    """Average sensors that were in the same positions and conditions, in one order.

    What all of them have is as large in their mean, and the noise is smaller by the root of their
    number. Sensors whose noise is known by that of the lot have weights by it, and the others equal
    ones. The noise of the mean is told by their scatter about it. None if the positions differ.
    """
    if (n := len(campaigns)) < 2:
        return None
    first = campaigns[0]
    if not all(_alike(first, other) for other in campaigns[1:]):
        return None
    if len({each.residuals.shape for each in sensors}) > 1:
        return None
    table = np.array([each.residuals for each in sensors])
    variances = np.array([each.variance for each in sensors])
    alone = np.array([noise is None for noise in noises])
    if alone.any():  # an estimate of its own is no weight: one that is small by chance would count
        variances[alone] = variances[alone].mean()
    weights = variances.mean() / variances
    freedom = (n - 1) * min(each.freedom for each in sensors)
    apart = table - np.average(table, axis=0, weights=weights)
    within = float(np.sum(weights @ apart**2)) / freedom
    sigma = max(float(np.sqrt(within / weights.sum())), LEAST_SIGMA)
    columns: dict[str, Any] = {
        name: np.average([getattr(one, name) for one in campaigns], axis=0, weights=weights)
        for name in ("forces", *COLUMNS)
        if getattr(first, name) is not None
    }
    angle = None
    if first.sigma_angle is not None:
        angle = first.sigma_angle * float(np.linalg.norm(weights) / weights.sum())
    mean = replace(
        first, name="mean of the lot", sd=None, n_samples=None,
        sigma_force=sigma, sigma_angle=angle, **columns,
    )  # fmt: skip
    return mean, SensorNoise(sigma, min(float(freedom), RULES.freedom_given), doubt=0.0)


@dataclass(frozen=True)
class Joint:
    """An effect in all campaigns together.

    Attributes
    ----------
    odds : float, log odds that it is equally large in all sensors, against nothing
    spec : str, its most probable shape
    """

    odds: float
    spec: str


def together(used: Sequence[SensorEvidence]) -> dict[str, Joint]:
    """Weigh each effect by all campaigns as one: the normal equations of residuals are added.

    Settings of an effect are those of the first campaign that shows it, or nearly so.

    Parameters
    ----------
    used : of the sensors that count
    """
    redundancy = sum(each.redundancy for each in used)
    evidence = Evidence(Level((1.0,), (RULES.freedom_given,), known=True), redundancy)
    squares = sum(each.square for each in used)
    nothing = float(evidence.of_noise(squares)[0])
    joint = {}
    for name in sorted({name for each in used for name in each.shown}):
        first = next(each.shown[name] for each in used if name in each.shown)
        logs, specs = [], []
        for spec, settings in zip(first.specs, first.settings, strict=True):
            near = [each.nearest(name, settings) for each in used]
            shown = [one for one in near if one is not None]
            part, dim = _joint_part(shown)
            if 2 * len(shown) > len(used) and dim:
                logs.append(evidence.of_spaces(np.array([part]), [dim], squares)[0])
                specs.append(spec)
        if logs:
            odds = float(log_mean(np.array(logs))) - nothing
            joint[name] = Joint(odds, specs[int(np.argmax(logs))])
    return joint


def _joint_part(shown: Sequence[tuple[Shown, int]]) -> tuple[float, int]:
    """‖Qᵀz‖² of all residuals in the space of an effect with one size, and its dimension."""
    if not shown:
        return 0.0, 0
    normal = np.sum([one.normal[k] for one, k in shown], axis=0)
    right = np.sum([one.right[k] for one, k in shown], axis=0)
    whole = np.sum([one.squares[k] for one, k in shown], axis=0)
    directions, values = visible(normal, whole)
    return float(np.sum((right @ directions) ** 2 / values)), len(values)


def _alike(one: Campaign, other: Campaign) -> bool:
    """Whether two campaigns were in the same positions, in the same conditions."""
    if one.forces.shape != other.forces.shape:
        return False
    if any((getattr(one, name) is None) != (getattr(other, name) is None) for name in COLUMNS):
        return False
    for name in COLUMNS:
        column, its = getattr(one, name), getattr(other, name)
        if column is not None and np.max(abs(its - column)) > MAX_CONDITION_DIFFERENCE * np.ptp(
            column
        ):
            return False
    a, b = (c.forces / np.linalg.norm(c.forces, axis=1, keepdims=True) for c in (one, other))
    return bool(np.max(abs(a - b)) < MAX_DIRECTION_DIFFERENCE)


def called(place: tuple[str, str]) -> str:
    """Name of something without a name that is a function of a coordinate, in a target."""
    return f"{UNKNOWN}({place[0]} → {place[1]})"


COMMON = f"{UNKNOWN}(position → reading)"
"""Name of what the mean of all sensors shows, whatever it is."""


def shown(name: str) -> str:
    """Name in words."""
    if not name.startswith(UNKNOWN):
        return words(name)
    return f"something without a name {name.removeprefix(UNKNOWN)}"


def is_noise(name: str) -> bool:
    """Whether a name is a kind of wrong noise."""
    return name in NOISES


def _by_chance(problem: Problem, chance: Chance, noise: SensorNoise | None) -> Array:
    """Log odds of what is tested in noise alone, whose level is that of a sensor of the lot."""
    field, evidence = problem.field, problem.evidence
    of_levels = np.random.SeedSequence(chance.seed.entropy, spawn_key=(*chance.seed.spawn_key, 1))
    rng = np.random.default_rng(of_levels)

    def odds(errors: Array) -> Array:
        if noise is not None:
            half = noise.freedom / 2
            errors = errors * np.sqrt(half / rng.gamma(half, size=(len(errors), 1)))
        return field.odds(evidence, field.seen(errors))

    if not field.names:
        return np.zeros((DRAWS, 0))
    return chance.statistic(problem.residuals, odds)


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
