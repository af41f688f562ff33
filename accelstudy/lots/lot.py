"""What a lot lacks: whether anything, what, in how many of its sensors, and which ones are odd."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.random_effects import random_effects
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision import priors
from accelstudy.diagnosis.evidence.field import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import AXES, NOISES, TAILS
from accelstudy.lots.evidence import DRAWS, SensorEvidence, is_noise, lot_classes
from accelstudy.lots.mixture import Mixture, lot_odds
from accelstudy.sensors.models import compose, composition_name
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

LEVEL = 0.05
"""Level of the test whether anything is missing in a lot."""
FALSE_ODD = 0.05
"""False discovery rate of odd sensors."""
FEW = 2
"""Sensors that have to lack the same, or it is no matter of the lot."""
EFFECT = "effect"
WEIGHTS = {
    EFFECT: 1.0,
    UNKNOWN: priors.UNKNOWN,
    **dict.fromkeys(NOISES, priors.COLOUR),
    AXES: priors.AXES,
    TAILS: priors.TAILS,
}
"""Prior weights of what a lot may lack, relative to one effect of the catalogue."""
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
class Lot:
    """The evidence of all sensors together.

    Attributes
    ----------
    sensors : tuple of SensorEvidence
    """

    sensors: tuple[SensorEvidence, ...]

    @cached_property
    def classes(self) -> list[tuple[str, ...]]:
        """Names that mean the same in this lot; the first one stands for them."""
        return lot_classes(self.sensors)

    @cached_property
    def mixture(self) -> Mixture:
        """Posterior of all sets of effects."""
        odds = [[each.odds.get(members[0], 0.0) for members in self.classes]
                for each in self.sensors]  # fmt: skip
        place = {name: k for k, members in enumerate(self.classes) for name in members}
        pairs: dict[tuple[int, int], Array] = {}
        for i, each in enumerate(self.sensors):
            for (one, other), log in each.pairs.items():
                first, second = sorted((place[one], place[other]))
                if first != second:
                    logs = pairs.setdefault((first, second), np.full(len(self.sensors), np.nan))
                    logs[i] = np.fmax(logs[i], log)
        kinds = [_kind(members[0]) for members in self.classes]
        prior = np.array([WEIGHTS[kind] / kinds.count(kind) for kind in kinds])
        return Mixture.of(np.array(odds), pairs, prior / prior.sum())

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
        seen = lot_odds([of_all(each, each.observed) for each in self.sensors], prior)
        by_chance = lot_odds([of_all(each, each.by_chance) for each in self.sensors], prior)
        return float((1 + np.sum(by_chance >= seen)) / (DRAWS + 1))

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL

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

        What a single sensor lacks makes that sensor odd.
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
        """Whether fewer than two sensors lack it, if it is one of the lot, (K,)."""
        of = np.maximum(self.mixture.of_effects, 1e-300)
        surely = [np.sum(self.mixture.lacking(k) > HAS * of[k]) for k in range(len(of))]
        return np.array(surely) < FEW

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

    def each(self) -> list[tuple[str, tuple[str, ...], float]]:
        """Campaign, names of what it lacks under the lot, and their posterior, for each sensor."""
        lacks, odd = self.mixture.sensors
        sets = [*lacks]
        table = np.array([*lacks.values(), odd])
        best = table.argmax(axis=0)
        rows = []
        for i, sensor in enumerate(self.sensors):
            names = ("odd",) if best[i] == len(sets) else tuple(
                self.classes[k][0] for k in sets[best[i]]
            )  # fmt: skip
            rows.append((sensor.campaign, names, float(table[best[i], i])))
        return rows


def _kind(name: str) -> str:
    """Which of `WEIGHTS` something has; things of one kind share it evenly."""
    if name.startswith(UNKNOWN):
        return UNKNOWN
    return name if is_noise(name) else EFFECT


def type_model(lot: Lot, model: SensorModel) -> SensorModel:
    """Model with all effects that the lot lacks."""
    effects = (*(effect.spec for effect in model.effects), *_specs(lot).values())
    return compose(composition_name(compose("type", effects).effects), effects)


def with_sizes(
    lot: Lot, campaigns: Sequence[Campaign], model: SensorModel, approach: Approach | None = None
) -> list[Found]:
    """Find the sizes of what the lot lacks, by calibrations with all of it.

    Parameters
    ----------
    lot : Lot
    campaigns : of its sensors, in the same order
    model : SensorModel, of the diagnosis
    approach : Approach, as in `sensor_evidence`
    """
    specs, extended = _specs(lot), type_model(lot, model)
    values, sigmas = np.full((2, len(campaigns), extended.n_parameters), np.nan)
    for i, campaign in enumerate(campaigns if specs else ()):
        with suppress(InputError):  # the campaign cannot show all of it
            fit = fit_campaign(campaign, extended, approach or usual_approach(campaign))
            values[i], sigmas[i] = fit.parameters, np.sqrt(np.diag(fit.covariance))
    first, results = model.n_parameters, dict[int, tuple[Size, ...]]()
    for k, spec in specs.items():
        parameters, rows = compose(spec, (spec,)).parameters, lot.mixture.lacking(k) > HAS
        results[k] = tuple(
            Size(p.name, p.unit, *random_effects(values[rows, j], sigmas[rows, j] ** 2),
                 values[:, j], sigmas[:, j])
            for j, p in enumerate(parameters, start=first)
        )  # fmt: skip
        first += len(parameters)
    return [replace(found, sizes=results.get(k, ())) for k, found in lot.found]


def _specs(lot: Lot) -> dict[int, str]:
    """Effects that were found, each in the setting that most sensors that lack it have as best."""
    specs = {}
    for k, found in lot.found:
        counted: dict[str, float] = {}
        for each, weight in zip(lot.sensors, lot.mixture.lacking(k), strict=True):
            if (spec := each.specs.get(found.names[0])) is not None:
                counted[spec] = counted.get(spec, 0.0) + float(weight)
        if counted:
            specs[k] = max(counted, key=lambda spec: counted[spec])
    return specs
