"""The evidence of one campaign for everything that its model may lack, as a lot gathers it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, stats

from accelstudy.adjustment.quality import Solution
from accelstudy.approaches import Approach
from accelstudy.basics.wording import words
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.posterior import weigh
from accelstudy.diagnosis.decision.problem import Problem, fit_base, pose
from accelstudy.diagnosis.evidence.detection import Chance, detect
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import LEVEL as LEVEL_OF_NOISE
from accelstudy.diagnosis.evidence.noise_tests import NOISES
from accelstudy.diagnosis.evidence.size import AS_GIVEN, DOUBTED, Evidence, Level, log_mean
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.diagnosis.space.residuals import VISIBLE
from accelstudy.effects import Effect
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

LEAST_SIGMA = 1e-9
"""m/s², of readings that are their own model."""
DRAWS = 1000
"""Sets of residuals without any effect, of each campaign."""
FREEDOMS = (AS_GIVEN, 60.0, 20.0, 8.0, DOUBTED)
"""ν of a type, the most first."""
ALIKE = 1.0
"""Difference of log likelihoods that says nothing."""
ODD_SHARE, ODD_FREEDOM = 0.1, 1.0
"""Share of sensors whose variance may be anything, and ν of these."""
COLUMNS = ("angles", "yaw", "time", "temperature", "vibration")
"""What a position has beside its forces."""
SMALLEST = 1e-300
"""Variance that can be divided by."""
NEAR = 0.3
"""Largest difference of the logarithms of settings that are nearly the same."""
LIKE = 0.2
"""Largest difference of conditions that are the same, in parts of their range."""
SAME = 0.15
"""Largest difference of the directions of forces in positions that are the same."""


@dataclass(frozen=True)
class LotNoise:
    """The noise of a type: variances of its sensors are σ² times an inverse-gamma(ν/2, ν/2).

    Attributes
    ----------
    sigma : float, m/s², of a position mean
    freedom : float, ν: few where sensors differ in noise
    doubt : float, prior probability that a sensor has a noise of its own
    """

    sigma: float
    freedom: float
    doubt: float = 0.02

    @classmethod
    def of(cls, sigmas: Array, redundancies: Array) -> LotNoise:
        """Of the variances s² of calibrations, of which s²/σ² is of F(r, ν), but for odd ones.

        Of the ν that explain them equally well the largest one is taken.

        Parameters
        ----------
        sigmas, redundancies : (n,) arrays, s in m/s² and r, of the sensors
        """
        squares = np.square(sigmas)

        def less_likely(log: float, freedom: float) -> float:
            ratios = squares / np.exp(log)
            usual, odd = (stats.f.logpdf(ratios, redundancies, nu) for nu in (freedom, ODD_FREEDOM))
            usual, odd = usual + np.log(1 - ODD_SHARE), odd + np.log(ODD_SHARE)
            return float(len(squares) * log - np.sum(np.logaddexp(usual, odd)))

        middle = float(np.median(np.log(squares)))
        best = [
            optimize.minimize_scalar(less_likely, (middle - 0.2, middle + 0.2), args=(nu,))
            for nu in FREEDOMS
        ]
        least = min(one.fun for one in best)
        log, freedom = next(
            (one.x, nu) for one, nu in zip(best, FREEDOMS, strict=True) if one.fun < least + ALIKE
        )
        return cls(float(np.exp(log / 2)), freedom)

    @property
    def level(self) -> Level:
        """What a campaign knows of its noise by that of the others."""
        if not self.doubt:
            return Level((1.0,), (self.freedom,), known=True)
        return Level((1 - self.doubt, self.doubt), (self.freedom, DOUBTED), known=True)


@dataclass(frozen=True)
class Shown:
    """The shapes of an effect in the residuals z of a campaign, in units of its noise.

    Attributes
    ----------
    settings : (s, q) array, those of the shapes
    normal : (s, k, k) array, DᵀD of the derivatives D of z by the parameters
    right : (s, k) array, Dᵀz
    squares : (s, k) array, of what D would be if no parameter of the model were estimated
    """

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
        return best if apart[best] < NEAR else None


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
    redundancy : int
    residuals : (m,) array, m/s², equally uncertain
    square : float, ‖z‖² of the residuals, in units of the noise: of the type where it is known
    shown : dict of effect to what its shapes would show in the residuals, in the same units
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
    redundancy: int
    residuals: Array
    square: float = 0.0
    shown: dict[str, Shown] = field(default_factory=dict)

    def nearest(self, name: str, settings: Array) -> tuple[Shown, int] | None:
        """What is shown of an effect with these settings, or nearly so."""
        if name not in self.shown:
            return None
        place = self.shown[name].nearest(settings)
        return None if place is None else (self.shown[name], place)


def sensor_evidence(
    campaign: Campaign,
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
    noise: LotNoise | None = None,
) -> SensorEvidence:
    """Weigh everything that a model may lack to explain a campaign.

    Parameters
    ----------
    campaign : Campaign
    model : SensorModel
    approach : Approach; by default robot-aided if the campaign has the robot's angles
    seed : int, of the draws
    noise : LotNoise, in place of what the campaign says of its noise

    Raises
    ------
    InputError
        If the positions do not determine the model, or leave no redundancy.
    """
    if noise is not None:
        campaign = replace(campaign, sigma_force=noise.sigma)
    base = fit_base(campaign, model, approach or usual_approach(campaign))
    problem = pose(base if noise is None else replace(base, level=noise.level))
    chance = Chance(np.random.SeedSequence(seed), len(problem.base.solution.design), DRAWS)
    detection = detect(problem.field, problem.evidence, problem.residuals, chance)
    weighing = weigh(problem, detection, chance)
    # A sensor with a noise of its own is no usual one.
    usual = detection.noise if noise is None else detection.noise[:1]
    nothing = float(np.logaddexp.reduce(usual))
    z, unknown = problem.residuals.z, problem.field.unknown
    odds = {name: log - nothing for name, log in weighing.singles.densities.items()}
    odds |= {one.names[0]: one.log_weight - nothing for one in weighing.noises}
    if noise is not None:
        any_level = Evidence(Level((1.0,), (DOUBTED,), known=True), problem.evidence.redundancy)
        odds[LEVEL_OF_NOISE] = float(any_level.of_noise(z @ z)[0]) - nothing
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
    variance = max(problem.evidence.variance(float(z @ z)), SMALLEST) if noise is None else 1.0
    names, by_chance = _by_chance(problem, chance, noise)
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
        redundancy=problem.residuals.redundancy,
        residuals=z * _sigma_stated(base.solution),
        square=float(z @ z) / variance,
        shown={
            name: Shown.of(problem, effects, variance)
            for name, shapes in problem.field.candidates.items()
            if (effects := [h.effect for h in shapes if h.effect is not None])
            and not effects[0].sudden
        },
    )


def _sigma_stated(fit: Solution) -> float:
    return float(np.mean(np.asarray(fit.observed.sigma_force)))


def mean_sensor(
    campaigns: Sequence[Campaign], sensors: Sequence[SensorEvidence]
) -> tuple[Campaign, LotNoise] | None:
    """Average sensors that were in the same positions and conditions, in one order.

    What all of them lack is as large in their mean, and the noise is smaller by the root of their
    number. It is told by their scatter about the mean. None if the positions differ.
    """
    first, n = campaigns[0], len(campaigns)
    if n < 2 or not all(_alike(first, other) for other in campaigns[1:]):
        return None
    if len({each.residuals.shape for each in sensors}) > 1:
        return None
    table = np.array([each.residuals for each in sensors])
    freedom = (n - 1) * min(each.redundancy for each in sensors)
    within = float(np.sum((table - table.mean(axis=0)) ** 2)) / freedom
    sigma = max(float(np.sqrt(within / n)), LEAST_SIGMA)
    columns = {
        name: np.mean([getattr(one, name) for one in campaigns], axis=0)
        for name in ("forces", *COLUMNS)
        if getattr(first, name) is not None
    }
    angle = None if first.sigma_angle is None else first.sigma_angle / np.sqrt(n)
    mean = replace(
        first, name="mean of the lot", sd=None, n_samples=None, slope=None, sd_slope=None,
        sigma_force=sigma, sigma_angle=angle, **columns,
    )  # fmt: skip
    return mean, LotNoise(sigma, min(float(freedom), AS_GIVEN), doubt=0.0)


@dataclass(frozen=True)
class Joint:
    """An effect in all campaigns together.

    Attributes
    ----------
    odds : float, log odds that it is equally large in all sensors, against nothing
    shown : tuple of (Shown, int) or None: for each sensor, what it shows of the most probable shape
    """

    odds: float
    shown: tuple[tuple[Shown, int] | None, ...]


def together(sensors: Sequence[SensorEvidence], counted: Sequence[int]) -> dict[str, Joint]:
    """Weigh each effect by all campaigns as one: the normal equations of residuals are added.

    Settings of an effect are those of the first campaign that shows it, or nearly so.

    Parameters
    ----------
    sensors : SensorEvidence of each
    counted : places of the sensors that count
    """
    used = [sensors[i] for i in counted]
    redundancy = sum(each.redundancy for each in used)
    evidence = Evidence(Level((1.0,), (AS_GIVEN,), known=True), redundancy)
    squares = sum(each.square for each in used)
    nothing = float(evidence.of_noise(squares)[0])
    joint = {}
    for name in sorted({name for each in used for name in each.shown}):
        first = next(each.shown[name] for each in used if name in each.shown)
        logs, shapes = [], []
        for settings in first.settings:
            near = [each.nearest(name, settings) for each in sensors]
            shown = [near[i] for i in counted]
            part, dim = _joint_part([one for one in shown if one is not None])
            if 2 * sum(one is not None for one in shown) > len(used) and dim:
                logs.append(evidence.of_spaces(np.array([part]), [dim], squares)[0])
                shapes.append(tuple(near))
        if logs:
            odds = float(log_mean(np.array(logs))) - nothing
            joint[name] = Joint(odds, shapes[int(np.argmax(logs))])
    return joint


def _joint_part(shown: Sequence[tuple[Shown, int]]) -> tuple[float, int]:
    """‖Qᵀz‖² of all residuals in the space of an effect with one size, and its dimension."""
    if not shown:
        return 0.0, 0
    normal = np.sum([one.normal[k] for one, k in shown], axis=0)
    right = np.sum([one.right[k] for one, k in shown], axis=0)
    whole = np.sum([one.squares[k] for one, k in shown], axis=0)
    scale = np.sqrt(np.where(whole > 0, whole, 1.0))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    seen = values > VISIBLE**2
    part = float(np.sum((vectors.T @ (right / scale))[seen] ** 2 / values[seen]))
    return part, int(seen.sum())


def _alike(one: Campaign, other: Campaign) -> bool:
    """Whether two campaigns were in the same positions, in the same conditions."""
    if one.forces.shape != other.forces.shape:
        return False
    if any((getattr(one, name) is None) != (getattr(other, name) is None) for name in COLUMNS):
        return False
    for name in COLUMNS:
        column, its = getattr(one, name), getattr(other, name)
        if column is not None and np.max(abs(its - column)) > LIKE * np.ptp(column):
            return False
    a, b = (c.forces / np.linalg.norm(c.forces, axis=1, keepdims=True) for c in (one, other))
    return bool(np.max(abs(a - b)) < SAME)


def lot_noise(fits: Sequence[Solution]) -> LotNoise:
    """Noise of a type by the calibrations of its sensors."""
    redundancies = np.array([fit.redundancy for fit in fits])
    factors = np.sqrt(np.array([fit.omega for fit in fits]) / redundancies)
    sigmas = np.array([_sigma_stated(fit) for fit in fits]) * factors
    return LotNoise.of(np.maximum(sigmas, LEAST_SIGMA), redundancies)


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


def _by_chance(
    problem: Problem, chance: Chance, noise: LotNoise | None
) -> tuple[tuple[str, ...], Array]:
    """Log odds of what is tested in noise alone, whose level is that of a sensor of the lot."""
    field, evidence = problem.field, problem.evidence
    of_levels = np.random.SeedSequence(chance.seed.entropy, spawn_key=(*chance.seed.spawn_key, 1))
    rng = np.random.default_rng(of_levels)

    def odds(errors: Array) -> Array:
        if noise is not None:
            half = noise.freedom / 2
            errors = errors * np.sqrt(half / rng.gamma(half, size=(len(errors), 1)))
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
