"""What a lot lacks: whether anything, what, in how many of its sensors, and which ones are odd."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from multiprocessing import get_context

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.adjustment.random_effects import random_effects
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.campaign.calibration.fit import CampaignFit, fit_campaign, usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.decision.problem import fit_base
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import AXES, NOISES, TAILS
from accelstudy.diagnosis.evidence.noise_tests import LEVEL as LEVEL_OF_NOISE
from accelstudy.lots.evidence import (
    COMMON,
    DRAWS,
    Joint,
    LotNoise,
    SensorEvidence,
    is_noise,
    lot_classes,
    lot_noise,
    mean_sensor,
    sensor_evidence,
    together,
)
from accelstudy.lots.mixture import Mixture, Names, lot_odds
from accelstudy.lots.sizes import odds_with_sizes
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

LEVEL = 0.05
"""Level of the test whether anything is missing in a lot: half of it by what each campaign says of
its noise, and half by the noise of the type."""
LEFT = 0.01
"""Level of the test whether a lot lacks more than what was found."""
PASSES = 3
"""Most times that what was found is added to the model."""
FALSE_ODD = 0.05
"""False discovery rate of odd sensors."""
FEW = 0.1
"""Share of the sensors up to which what they lack makes them odd, and is no matter of the type."""
AGREE = 0.02
"""Relative change below which the noise of a type is found."""
REFITS = 8
"""Most calibrations of all sensors for it."""
WORTH = 3.0
"""Log odds from which the sizes of an effect are looked at."""
EFFECT = "effect"
WEIGHTS = {
    EFFECT: 1.0,
    UNKNOWN: priors.UNKNOWN,
    COMMON: priors.UNKNOWN,
    **dict.fromkeys(NOISES, priors.COLOUR),
    AXES: priors.AXES,
    TAILS: priors.TAILS,
}
"""Prior weights of what a lot may lack, relative to one effect of the catalogue."""
ODD = "odd"
"""Name of what a sensor lacks that the others do not."""
NEVER = -30.0
"""Log odds of what cannot be."""
HAS = 0.5
"""Posterior probability from which a sensor counts among those that lack an effect."""


@dataclass(frozen=True)
class Size:
    """A parameter of an effect, over the sensors that have it.

    Attributes
    ----------
    name, unit : str, SI
    mean, scatter : float, of the type
    sigma : float, of the mean
    each, sigma_each : (n,) arrays, of the sensors; NaN where a campaign cannot show it
    """

    name: str
    unit: str
    mean: float
    scatter: float
    sigma: float
    each: Array
    sigma_each: Array


@dataclass(frozen=True)
class Found:
    """Something that the lot lacks.

    Attributes
    ----------
    names : tuple of str, the names that mean the same in this lot
    posterior : float, given that the lot lacks anything
    share : float, of the sensors
    share_ci95 : tuple of two floats
    sizes : tuple of Size, of an effect
    """

    names: tuple[str, ...]
    posterior: float
    share: float
    share_ci95: tuple[float, float]
    sizes: tuple[Size, ...] = ()


@dataclass(frozen=True)
class Odd:
    """A sensor that lacks what the others do not."""

    campaign: str
    posterior: float
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Pass:
    """The evidence of all sensors together, with one model.

    Attributes
    ----------
    sensors : tuple of SensorEvidence
    mean : SensorEvidence, of their mean; None if they were in different positions
    noise : LotNoise, of the type; None where each campaign says its own
    together : mapping of effects to what all campaigns say of them together
    """

    sensors: tuple[SensorEvidence, ...]
    mean: SensorEvidence | None = None
    noise: LotNoise | None = None
    together: Mapping[str, Joint] = field(default_factory=dict)

    @cached_property
    def classes(self) -> list[tuple[str, ...]]:
        """Names that mean the same in this lot; the first one stands for them."""
        return lot_classes(self.sensors) + ([] if self.mean is None else [(COMMON,)])

    @cached_property
    def mixture(self) -> Mixture:
        """Posterior of all sets of effects."""
        # One sensor alone never shows what has neither a name nor a shape.
        unseen = [NEVER if members[0] == COMMON else 0.0 for members in self.classes]
        odds = [
            [
                each.odds.get(members[0], no)
                for members, no in zip(self.classes, unseen, strict=True)
            ]
            for each in self.sensors
        ]
        pairs: dict[Names, Array] = {}
        for i, each in enumerate(self.sensors):
            for both, log in self._pairs(each).items():
                pairs.setdefault(both, np.full(len(self.sensors), np.nan))[i] = log
        kinds = [_kind(members[0]) for members in self.classes]
        prior = np.array([WEIGHTS[kind] / kinds.count(kind) for kind in kinds])
        joint = {
            k: self.together[members[0]]
            for k, members in enumerate(self.classes)
            if members[0] in self.together
        }
        common: dict[Names, float] = {(k,): one.odds for k, one in joint.items()}
        if (mean := self.mean) is not None:
            # What is larger than noise in the mean is no noise.
            of_mean = {name: log for name, log in mean.odds.items() if not is_noise(name)}
            of_mean[COMMON] = mean.odds[LEVEL_OF_NOISE]
            common |= {
                (k,): of_mean[members[0]]
                for k, members in enumerate(self.classes)
                if members[0] in of_mean
            }
            common |= self._pairs(mean)
        table = np.array(odds)
        typical = {
            k: sized
            for k, one in joint.items()
            if common[k,] > WORTH and (sized := _with_sizes(one, table[:, k])) is not None
        }
        return Mixture.of(table, pairs, prior / prior.sum(), common, typical)

    def _pairs(self, each: SensorEvidence) -> dict[Names, float]:
        """Log odds of two classes together."""
        place = {name: k for k, members in enumerate(self.classes) for name in members}
        pairs: dict[Names, float] = {}
        for (one, other), log in each.pairs.items():
            if one in place and other in place and place[one] != place[other]:
                first, second = sorted((place[one], place[other]))
                pairs[first, second] = max(log, pairs.get((first, second), -np.inf))
        return pairs

    @cached_property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence."""
        names = sorted({name for each in self.sensors for name in each.tested})
        prior = np.array([priors.UNKNOWN if n == UNKNOWN else 1 / len(names) for n in names])

        def of_all(each: SensorEvidence, odds: Array) -> Array:
            known = dict(zip(each.tested, np.moveaxis(odds, -1, 0), strict=True))
            nothing = np.zeros(odds.shape[:-1])
            return np.stack([known.get(name, nothing) for name in names], axis=-1)

        prior /= prior.sum()
        seen = lot_odds((of_all(each, each.observed) for each in self.sensors), prior)
        by_chance = lot_odds((of_all(each, each.by_chance) for each in self.sensors), prior)
        return float((1 + np.sum(by_chance >= seen)) / (DRAWS + 1))

    @property
    def p_mean(self) -> float:
        """Probability that the mean of sensors without anything missing shows as much."""
        return 1.0 if self.mean is None else self.mean.p_value

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL / 2

    @cached_property
    def wrong(self) -> float:
        """Posterior probability that the lot lacks anything, or that a sensor is odd."""
        mixture = self.mixture
        nothing = 1 - mixture.missing
        none_odd = np.prod(1 - mixture.sensors_under(())[1]) if nothing > 0 else 1.0
        return float(max(1 - nothing * none_odd, 1e-300))

    @cached_property
    def found(self) -> list[tuple[int, Found]]:
        """What is missing and has a name that is sure enough, with its place in `classes`.

        What few sensors lack makes these odd.
        """
        if not self.missing:
            return []
        found = []
        for k in np.argsort(-self.given, kind="stable").tolist():
            if self.given[k] >= priors.SURE and not self._rare[k]:
                share, low, high = self.mixture.share(k)
                posterior = min(float(self.given[k]), 1.0)
                found.append((k, Found(self.classes[k], posterior, share, (low, high))))
        return found

    @cached_property
    def given(self) -> Array:
        """Posterior of each class to be one of the lot, given that anything is wrong, (K,)."""
        return np.asarray(self.mixture.of_effects / self.wrong)

    @cached_property
    def _rare(self) -> NDArray[np.bool_]:
        """Whether few sensors lack it, if it is one of the lot, (K,)."""
        of = np.maximum(self.mixture.of_effects, 1e-300)
        surely = [np.sum(self.mixture.lacking(k) > HAS * of[k]) for k in range(len(of))]
        return np.array(surely) <= max(1, FEW * len(self.sensors))

    @property
    def alternatives(self) -> list[tuple[tuple[str, ...], float]]:
        """The most probable classes with their posterior, given that anything is wrong."""
        order = np.argsort(-self.given, kind="stable")[:3]
        return [(self.classes[k], float(self.given[k])) for k in order]

    @cached_property
    def odd(self) -> list[Odd]:
        """Odd sensors, the surest first; of those that are told, 5 of 100 are told wrongly."""
        lacks, odd = self.mixture.sensors
        alone = sum((p for names, p in lacks.items() if any(self._rare[k] for k in names)), odd)
        order = np.argsort(-alone, kind="stable")
        wrong = np.cumsum(1 - alone[order]) / np.arange(1, len(alone) + 1)
        known = {k for k, _ in self.found}
        told = []
        for i in order[: int(np.sum(wrong <= FALSE_ODD))]:
            own = self.mixture.odds[i] + np.log(self.mixture.prior)
            k = max((k for k in range(len(own)) if k not in known), key=lambda k: own[k])
            told.append(Odd(self.sensors[i].campaign, float(alone[i]), self.classes[k]))
        return told

    def without_odd(self) -> Pass:
        """The same without the sensors that are odd."""
        if not (odd := {one.campaign for one in self.odd}):
            return self
        usual = [i for i, each in enumerate(self.sensors) if each.campaign not in odd]
        return replace(
            self,
            sensors=tuple(self.sensors[i] for i in usual),
            together={
                name: replace(joint, shown=tuple(joint.shown[i] for i in usual))
                for name, joint in self.together.items()
            },
        )

    @cached_property
    def each(self) -> list[tuple[tuple[str, ...], float]]:
        """Names of what a sensor lacks under the lot, and their posterior, for each sensor."""
        lacks, odd = self.mixture.sensors
        sets = [*lacks]
        table = np.array([*lacks.values(), odd])
        rows = []
        for i, k in enumerate(table.argmax(axis=0)):
            names = (ODD,) if k == len(sets) else tuple(self.classes[c][0] for c in sets[k])
            rows.append((names, float(table[k, i])))
        return rows

    def specs(self, places: Iterable[int]) -> dict[int, str]:
        """Effects of some classes, each in the setting that most sensors have as best."""
        specs = {}
        for k in places:
            counted: dict[str, float] = {}
            for each, weight in zip(self.sensors, self.mixture.lacking(k), strict=True):
                if (spec := each.specs.get(self.classes[k][0])) is not None:
                    counted[spec] = counted.get(spec, 0.0) + float(weight)
            if counted:
                specs[k] = max(counted, key=lambda spec: counted[spec])
        return specs


@dataclass(frozen=True, eq=False)
class Lot:
    """What a lot lacks.

    Attributes
    ----------
    passes : tuple of Pass: by what each campaign says of its noise; then, by the noise of the type,
        with the model and all that was found before, until nothing new is found
    model : SensorModel, with `effects`
    effects : tuple of (Found, spec or None), in the order in which they were found
    close : tuple of names, which come closest to what has no name
    explained : bool; if false, the sensors have something in common that no names explain
    """

    passes: tuple[Pass, ...]
    model: SensorModel
    effects: tuple[tuple[Found, str | None], ...] = ()
    close: tuple[tuple[str, ...], ...] = ()
    explained: bool = True

    @property
    def sensors(self) -> tuple[SensorEvidence, ...]:
        """Evidence of each campaign by itself."""
        return self.passes[0].sensors

    def model_of(self, i: int) -> SensorModel:
        """Model of the type for a sensor, with its own times of what is sudden."""
        return _own(self.model, self.passes, i)

    @property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence."""
        same = self.passes[:1] if self.passes[0].found else self.passes[:2]
        return min(2 * min(one.p_value for one in same), 1.0)

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL

    @property
    def alternatives(self) -> list[tuple[tuple[str, ...], float]]:
        """The most probable classes of what has no sure name, with their posterior."""
        return next((one for one in self.passes if one.missing), self.passes[-1]).alternatives

    @property
    def odd(self) -> list[Odd]:
        """Odd sensors, with all that was found in the model; the surest first."""
        return self.passes[-1].odd

    def usual(self, fits: Sequence[CampaignFit | InputError]) -> list[CampaignFit]:
        """Those of the `calibrations` that there are, without odd sensors."""
        odd = {one.campaign for one in self.odd}
        return [
            fit
            for fit, sensor in zip(fits, self.sensors, strict=True)
            if isinstance(fit, CampaignFit) and sensor.campaign not in odd
        ]

    def each(self) -> list[tuple[str, tuple[str, ...], float]]:
        """Campaign, names of what it lacks under the lot, and their posterior, for each sensor."""
        told = {found.names[0] for found, _ in self.effects}
        rows = []
        for i, sensor in enumerate(self.sensors):
            names, probability = tuple[str, ...](), 1.0
            for k, one in enumerate(self.passes, start=1):
                of_pass, posterior = one.each[i]
                kept = {*told, ODD} if k == len(self.passes) else told
                names += tuple(name for name in of_pass if name in kept)
                probability *= posterior
            rows.append((sensor.campaign, names, probability))
        return rows


def weigh_lot(
    campaigns: Sequence[Campaign],
    model: SensorModel,
    approach: Approach | None = None,
    seed: int = 1,
    cores: int = 1,
) -> Lot:
    """Say what sensors of one type lack together.

    Parameters
    ----------
    campaigns : of the sensors, two or more
    model : SensorModel
    approach : Approach; by default robot-aided where a campaign has the robot's angles
    seed : int, of the draws
    cores : int, processes that work at once; results do not depend on it

    Raises
    ------
    InputError
        If a campaign does not determine the model, or leaves no redundancy.
    """
    with _processes(cores) as mapped:
        return _weigh_lot(campaigns, model, approach, seed, mapped)


@contextmanager
def _processes(cores: int) -> Iterator[Callable[..., Iterator[SensorEvidence]]]:
    """What maps a function over campaigns, in as many processes as there are cores.

    Elsewhere than on Linux processes start anew, with all imports; there is one.
    """
    if cores == 1 or sys.platform != "linux":
        yield map
        return
    with ProcessPoolExecutor(cores, mp_context=get_context("fork")) as pool:
        yield partial(pool.map, chunksize=4)


def _weigh_lot(
    campaigns: Sequence[Campaign],
    model: SensorModel,
    approach: Approach | None,
    seed: int,
    mapped: Callable[..., Iterator[SensorEvidence]],
) -> Lot:
    def weighed(models: Sequence[SensorModel], with_: SensorModel, noise: LotNoise | None) -> Pass:
        n = len(campaigns)
        seeds = range(seed, seed + n)
        each = mapped(sensor_evidence, campaigns, models, [approach] * n, seeds, [noise] * n)
        sensors = list(track(each, "evidence of the sensors", n))
        odd, mean = {one.campaign for one in Pass(tuple(sensors)).odd}, None
        usual = [k for k, one in enumerate(sensors) if one.campaign not in odd]
        of_mean = None
        # What happens to each sensor at a time of its own has no mean.
        if not any(effect.sudden for effect in with_.effects):
            of_mean = mean_sensor([campaigns[k] for k in usual], [sensors[k] for k in usual])
        if of_mean is not None:
            with suppress(InputError):  # the positions do not determine the model
                mean = sensor_evidence(of_mean[0], with_, approach, seed - 1, of_mean[1])
        return Pass(tuple(sensors), mean, noise, together(sensors, usual))

    def again(with_: SensorModel) -> Pass:
        own = [_own(with_, passes, i) for i in range(len(campaigns))]

        def fits_of(measured: Sequence[Campaign]) -> list[Solution]:
            each = zip(measured, own, strict=True)
            return [_fitted(campaign, its, model, approach) for campaign, its in each]

        fits = fits_of(campaigns)
        return weighed([fit.model for fit in fits], with_, _settled(fits, fits_of, campaigns))

    passes: list[Pass] = []
    now, whole = weighed([model] * len(campaigns), model, None), model
    passes.append(now)
    effects: list[tuple[Found, str | None]] = []
    new = _new(now, whole, effects)
    for _ in range(PASSES):
        specs = now.specs(k for k, _ in new)
        effects += [(one, specs.get(k)) for k, one in new]
        whole = extended(whole, specs.values())
        now = again(whole)
        passes.append(now)
        if not (new := _new(now, whole, effects)):
            break
    nameless = any(spec is None and not is_noise(f.names[0]) for f, spec in effects)
    explained = not nameless and _explained(now, whole, again, len(effects))
    if not explained:
        close = tuple(found.names for found, spec in effects if spec is not None)
        return Lot(tuple(passes), model, close=close, explained=False)
    return Lot(tuple(passes), whole, tuple(effects))


def _settled(
    fits: Sequence[Solution],
    fits_of: Callable[[Sequence[Campaign]], list[Solution]],
    campaigns: Sequence[Campaign],
) -> LotNoise:
    """Noise of the type by the calibrations of its sensors.

    Beside angles the noise of the forces is not in proportion to the residuals, and is searched
    for: with it the residuals are as large as it says.
    """
    noise, before = lot_noise(fits), None
    for _ in range(REFITS if any(fit.approach.uses_angles for fit in fits) else 0):
        sigma = noise.sigma
        again = lot_noise(fits_of([replace(one, sigma_force=sigma) for one in campaigns]))
        off = float(np.log(again.sigma / sigma))
        if abs(off) < AGREE:
            return again
        step = off
        if before is not None and (off - before[1]) * (np.log(sigma) - before[0]) < 0:
            step = -off * (np.log(sigma) - before[0]) / (off - before[1])
        before = float(np.log(sigma)), off
        noise = replace(again, sigma=sigma * float(np.exp(np.clip(step, -2, 2))))
    return noise


def _own(whole: SensorModel, passes: Sequence[Pass], i: int) -> SensorModel:
    """Model of a sensor: what is sudden happened when the last pass that looked for it says."""
    specs: dict[str, str] = {}
    for one in passes:
        specs |= one.sensors[i].specs
    effects = [specs.get(e.name, e.spec) if e.sudden else e.spec for e in whole.effects]
    return compose(whole.name, tuple(effects))


def _fitted(
    campaign: Campaign, whole: SensorModel, model: SensorModel, approach: Approach | None
) -> Solution:
    """Calibrate a sensor with the whole model, or with a smaller one if it determines no more."""
    approach = approach or usual_approach(campaign)
    with suppress(InputError):
        return fit_base(campaign, whole, approach).solution
    return fit_base(campaign, model, approach).solution


def _new(
    now: Pass, whole: SensorModel, effects: Sequence[tuple[Found, str | None]]
) -> list[tuple[int, Found]]:
    """What a pass found that neither the model nor an earlier pass has."""
    known = {name for found, _ in effects for name in found.names}
    return [
        (k, one) for k, one in now.found if not _has(whole, one.names) and not known & {*one.names}
    ]


def _has(model: SensorModel, names: Sequence[str]) -> bool:
    """Whether a model has one of some effects."""
    return any(effect.name in names for effect in model.effects)


def _explained(
    now: Pass,
    whole: SensorModel,
    again: Callable[[SensorModel], Pass],
    known: int,
) -> bool:
    """Whether what was found explains the lot, with the most probable of what is not sure."""
    while (rest := now.without_odd()).p_value < LEFT or rest.p_mean < LEFT:
        best = int(np.argmax(rest.given))
        spec = rest.specs([best])
        if is_noise(rest.classes[best][0]) or _has(whole, rest.classes[best]):
            return True
        if not spec or known >= PASSES:
            return False
        whole, known = extended(whole, spec.values()), known + 1
        now = again(whole)
    return True


def _with_sizes(joint: Joint, own: Array) -> Array | None:
    """Odds of sensors with sizes of the type; None if sizes of their own explain them better."""
    at = [i for i, one in enumerate(joint.shown) if one is not None]
    shown = [one for one in joint.shown if one is not None]
    normal = np.array([one.normal[k] for one, k in shown])
    right = np.array([one.right[k] for one, k in shown])
    odds, log_likelihood = odds_with_sizes(normal, right)
    shares = np.linspace(0.02, 0.98, 49)[:, None]
    by_own = np.logaddexp(np.log1p(-shares), np.log(shares) + own[at]).sum(axis=1).max()
    if log_likelihood < by_own:
        return None
    table = own.copy()
    table[at] = odds
    return table


def _kind(name: str) -> str:
    """Which of `WEIGHTS` something has; things of one kind share it evenly."""
    if name in WEIGHTS:
        return name
    return UNKNOWN if name.startswith(UNKNOWN) else EFFECT


def extended(model: SensorModel, specs: Iterable[str]) -> SensorModel:
    """Model with further effects."""
    effects = (*(effect.spec for effect in model.effects), *specs)
    return compose(composition_name(compose("type", effects).effects), effects)


def calibrations(
    lot: Lot, campaigns: Sequence[Campaign], approach: Approach | None = None
) -> list[CampaignFit | InputError]:
    """Calibrate each sensor with the model of the type, or say why that cannot be done.

    Parameters
    ----------
    lot : Lot
    campaigns : of its sensors, in the same order
    approach : Approach, as in `weigh_lot`
    """
    fits: list[CampaignFit | InputError] = []
    for i, campaign in enumerate(campaigns):
        try:
            chosen = lot.model_of(i), approach or usual_approach(campaign)
            fits.append(fit_campaign(campaign, *chosen))
        except InputError as error:
            fits.append(error)
    return fits


def with_sizes(
    lot: Lot, fits: Sequence[CampaignFit | InputError], model: SensorModel
) -> list[Found]:
    """Find the sizes of what the lot lacks.

    Parameters
    ----------
    lot : Lot
    fits : of `calibrations`
    model : SensorModel, of the diagnosis
    """
    values, sigmas = np.full((2, len(fits), lot.model.n_parameters), np.nan)
    for i, fit in enumerate(fits):
        if isinstance(fit, CampaignFit):
            values[i], sigmas[i] = fit.parameters, fit.sigma
    lacks, first, results = lot.each(), model.n_parameters, []
    for found, spec in lot.effects:
        sizes = []
        if spec is not None:
            rows = np.array([found.names[0] in names for _, names, _ in lacks])
            for j, p in enumerate(compose(spec, (spec,)).parameters, start=first):
                of_type = random_effects(values[rows, j], sigmas[rows, j] ** 2)
                sizes.append(Size(p.name, p.unit, *of_type, values[:, j], sigmas[:, j]))
            first += len(sizes)
        results.append(replace(found, sizes=tuple(sizes)))
    return results
