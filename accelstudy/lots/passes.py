"""One pass over a lot: the evidence of all sensors together, with one model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from operator import add
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import AXES, NOISES, TAILS
from accelstudy.diagnosis.evidence.noise_tests import LEVEL as LEVEL_OF_NOISE
from accelstudy.diagnosis.rules import RULES
from accelstudy.lots.evidence import (
    COMMON,
    Sensor,
    SensorEvidence,
    lot_classes,
    mean_sensor,
)
from accelstudy.lots.mixture import LotTest, Mixture
from accelstudy.lots.sizes import (
    Equations,
    Names,
    PooledEffect,
    TypeSizes,
    most_likely,
    weigh_pooled,
)
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]
Mapped: TypeAlias = Callable[..., Iterator[Any]]
"""Maps a function over sensors, in one process or in several."""

LEVEL = 0.05
"""Level of the test whether anything is missing in a lot: half of it by what each campaign says of
its noise, and half by the noise of the lot."""
FALSE_ODD = 0.05
"""False discovery rate of odd sensors."""
MAX_ODD_SHARE = 0.1
"""Share of the sensors up to which an effect makes them odd, and does not belong to the type."""
MIN_RIVAL = 0.02
"""Least posterior probability of a rival."""
MIN_CERTAIN = 0.95
"""Posterior probability from which on a name is stated without its rivals."""
UNTOLD, RESEMBLES = 6.0, 0.05
"""Noncentrality of what an effect leaves beside another one, absolute and as a share of its own, up
to which they are told together: on average the right one is 0.95 probable then."""
MAX_SETS = 12
"""Number of most probable sets of effects whose sizes are estimated."""
EFFECT = "effect"
WEIGHTS = {
    EFFECT: 1.0,
    UNKNOWN: RULES.prior_unknown,
    COMMON: RULES.prior_unknown,
    **dict.fromkeys(NOISES, RULES.prior_coloured),
    AXES: RULES.prior_axes,
    TAILS: RULES.prior_tails,
}
"""Prior weights of what the model of a lot may lack, relative to one effect of the catalogue."""
ODD = "odd"
"""Name of an effect that one sensor has, and neither the model nor the other sensors."""
IMPOSSIBLE = -30.0
"""Log odds of an impossible hypothesis."""
MIN_HAVING = 0.5
"""Posterior probability from which a sensor counts among those that have an effect."""


class LotEffect(NamedTuple):
    """An effect, or something unnamed, that the model of the lot lacks.

    Attributes
    ----------
    names : tuple of str, the names that mean the same in this lot, the most probable first
    posterior : float, given that the model lacks anything
    share : float, of the sensors
    share_ci95 : tuple of two floats
    spec : str, the effect in the setting that explains most; None of what is no effect
    """

    names: tuple[str, ...]
    posterior: float
    share: float
    share_ci95: tuple[float, float]
    spec: str | None = None


class SensorState(NamedTuple):
    """What the model lacks for a sensor, or what makes it odd, and how probable that is."""

    campaign: str
    names: tuple[str, ...]
    posterior: float


@dataclass(frozen=True, eq=False)
class Pass:
    """The evidence of all sensors together, with one model.

    Attributes
    ----------
    sensors : tuple of Sensor
    evidence : tuple of SensorEvidence, theirs
    anything : LotTest, the test of them
    mean : SensorEvidence, of their mean; None if they were in different positions
    pooled : mapping of effects to what all campaigns say of them together
    sizes : TypeSizes, of the most probable effects; None where there are none
    """

    sensors: tuple[Sensor, ...]
    evidence: tuple[SensorEvidence, ...]
    anything: LotTest
    mean: SensorEvidence | None = None
    pooled: Mapping[str, PooledEffect] = field(default_factory=dict)
    sizes: TypeSizes | None = None

    @classmethod
    def of(cls, sensors: Sequence[Sensor], whole: SensorModel, mapped: Mapped) -> Pass:
        """Weigh everything that the models of all sensors may lack.

        Parameters
        ----------
        sensors : with their models
        whole : SensorModel, of their mean
        mapped : maps a function over the sensors
        """
        n, said, anything = len(sensors), list[SensorEvidence](), LotTest({})
        # What noise alone would say is most of what a sensor gives, and is not kept.
        for one in track(mapped(Sensor.evidence, sensors), "evidence of the sensors", n):
            anything.add(one.tested)
            said.append(replace(one, tested={}))
        # Nor are the fits, so that memory hardly follows the number of sensors.
        now = cls(tuple(sensors), tuple(replace(one, solution=None) for one in said), anything)
        usual = [i for i in now.usual if said[i].solution]
        their = [said[i] for i in usual]
        seed = sensors[0].seed - 1 if sensors[0].seed else n
        mean = _evidence_of_mean([sensors[i] for i in usual], their, whole, seed)
        now = replace(now, mean=mean, pooled=_pooled(their))
        asked = now.strongest()
        specs = {name: now.shapes[name] for names in asked for name in names}
        if len(usual) < 2 or not specs:
            return now
        each = [Equations.of(one.solution, specs.values()) for one in said]
        redundancy = sum(one.redundancy for one in their)
        return replace(now, sizes=TypeSizes.of(each, specs, asked, usual, redundancy))

    @cached_property
    def classes(self) -> dict[str, tuple[str, ...]]:
        """Classes of names that mean the same in this lot, by the first of each."""
        of_mean = {} if self.mean is None else {COMMON: (COMMON,)}
        return lot_classes(self.evidence) | of_mean

    @cached_property
    def mixture(self) -> Mixture:
        """Posterior of all sets of effects."""
        odds = {
            # One sensor alone never shows what has neither a name nor a shape.
            name: np.array([
                one.odds.get(name, IMPOSSIBLE if name == COMMON else 0.0) for one in self.evidence
            ])
            for name in self.classes
        }  # fmt: skip
        first = {name: one for one, members in self.classes.items() for name in members}
        pairs: dict[Names, Array] = {}
        for i, one in enumerate(self.evidence):
            for both, log in one.pairs.items():
                names = tuple(sorted({first[name] for name in both if name in first}))
                if len(names) == 2:
                    told = pairs.setdefault(names, np.full(len(self.evidence), -np.inf))
                    told[i] = max(log, told[i])
        for names, told in pairs.items():
            # Of a sensor without odds of both they are as where none has any (`Mixture`).
            weaker = np.min([odds[name] for name in names], axis=0)
            np.copyto(told, weaker, where=np.isneginf(told))
        # Names of one kind share its weight evenly.
        usual = {n: UNKNOWN if n.startswith(UNKNOWN) else EFFECT for n in self.classes}
        kinds = {name: name if name in WEIGHTS else kind for name, kind in usual.items()}
        counts = Counter(kinds.values())
        total = sum(WEIGHTS[kind] for kind in counts)
        prior = {name: WEIGHTS[kind] / counts[kind] / total for name, kind in kinds.items()}
        common: dict[Names, float] = {(name,): one.odds for name, one in self.pooled.items()}
        if (mean := self.mean) is not None:
            common |= {(n,): log for n, log in mean.odds.items() if n.startswith(UNKNOWN)}
            # What is larger than noise in the mean is no noise.
            common[COMMON,] = mean.odds[LEVEL_OF_NOISE]
        sets, n = {} if self.sizes is None else self.sizes.sets, len(self.sensors)
        typical = {
            names: alike
            for names, alike in sets.items()
            if min(most_likely(alike).shares.values()) * n > self._few
        }
        return Mixture(odds, pairs, prior, common, typical)

    @cached_property
    def shapes(self) -> dict[str, str]:
        """Effects in the settings that explain most of what all sensors have in common."""
        of_mean = {} if self.mean is None else self.mean.specs
        return {name: of_mean.get(name, one.spec) for name, one in self.pooled.items()}

    def strongest(self) -> list[Names]:
        """Return the most probable sets of one and two effects, and each of their effects."""
        best = [*self.mixture.sets][:MAX_SETS]
        sets = dict.fromkeys([*((name,) for names in best for name in names), *best])
        return [s for s in sets if 0 < len(s) < 3 and all(name in self.shapes for name in s)]

    @cached_property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence.

        It is that of the sensors or of their mean, whichever is the smaller one, for both.
        """
        each = self.anything.p_value({UNKNOWN: RULES.prior_unknown})
        return each if self.mean is None else min(2 * min(each, self.mean.p_value), 1.0)

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL / 2

    @cached_property
    def wrong(self) -> float:
        """Posterior probability that the model lacks anything, or that a sensor is odd."""
        nothing = self.mixture.posterior[()]
        none_odd = np.prod(1 - self.mixture.sensors_under(())[1]) if nothing > 0 else 1.0
        return float(max(1 - nothing * none_odd, 1e-300))

    @cached_property
    def given(self) -> dict[str, float]:
        """Posterior of each class to be one of the lot, if anything is wrong, highest first."""
        given = {name: self.mixture.of_any([name]) / self.wrong for name in self.classes}
        return dict(sorted(given.items(), key=lambda item: -item[1]))

    @cached_property
    def found(self) -> list[LotEffect]:
        """Missing effects whose names are sure enough.

        What few sensors have makes these odd.
        """
        if not self.missing:
            return []
        found, taken = [], set[str]()
        for name, given in self.given.items():
            if name in taken or name in self._rare or given < MIN_RIVAL:
                continue
            rivals = [] if given >= MIN_CERTAIN else self._rivals(name)
            alike = [name, *(rival for rival in rivals if rival not in taken)]
            posterior = min(self.mixture.of_any(alike) / self.wrong, 1.0)
            if posterior >= RULES.sure:
                taken.update(alike)
                members = tuple(member for one in alike for member in self.classes[one])
                share, low, high = self.mixture.share(name)
                found.append(LotEffect(members, posterior, share, (low, high), self.spec(name)))
        return found

    def _rivals(self, name: str) -> list[str]:
        """Effects that all campaigns together hardly tell from one that is not certain."""
        if self.sizes is None:
            return []
        asked = self.sizes.asked
        names = next((s for s in self.mixture.sets if name in s and s in asked), None)
        if names is None or names not in self.mixture.typical:
            return []
        rivals = []
        for rival in self.classes:
            if self.given[rival] < MIN_RIVAL or rival in names or rival not in self.sizes.specs:
                continue
            left, whole = self.sizes.apart(names, name, rival)
            if left < min(UNTOLD, RESEMBLES * whole):
                rivals.append(rival)
        return rivals

    @cached_property
    def _rare(self) -> set[str]:
        """Classes that few sensors have, if the lot has them."""
        mixture = self.mixture
        least = {name: MIN_HAVING * max(mixture.of_any([name]), 1e-300) for name in self.classes}
        return {n for n, p in least.items() if np.sum(mixture.having(n) > p) <= self._few}

    @property
    def _few(self) -> float:
        """Number of sensors up to which an effect makes them odd."""
        return max(1, MAX_ODD_SHARE * len(self.sensors))

    @property
    def alternatives(self) -> list[tuple[tuple[str, ...], float]]:
        """The most probable classes with their posterior, given that anything is wrong."""
        return [(self.classes[name], given) for name, given in [*self.given.items()][:3]]

    @cached_property
    def odd(self) -> list[SensorState]:
        """Odd sensors, the surest first; 5 of 100 are expected to be wrong.

        A sensor is odd by whatever nothing accounts for that is found in the lot. If that makes
        more than few sensors odd, the lot has something that has no sure name, and what is rare
        makes them so.
        """
        nameless = {*self.classes} - {one.names[0] for one in self.found}
        odd = self._odd_by(nameless)
        return odd if len(odd) <= self._few else self._odd_by(self._rare)

    def _odd_by(self, strange: set[str]) -> list[SensorState]:
        """Sensors that are odd if they have one of some classes."""
        of_sets, odd = self.mixture.sensors
        alone = sum((p for names, p in of_sets.items() if strange & {*names}), odd)
        # Sensors of which nobody doubts it stay in their order.
        order = np.argsort(-np.round(alone, 3), kind="stable")
        wrong = np.cumsum(1 - alone[order]) / np.arange(1, len(alone) + 1)
        known = {one.names[0] for one in self.found}
        prior = {name: p for name, p in self.mixture.prior.items() if name not in known}
        own = np.array([self.mixture.odds[name] + np.log(p) for name, p in prior.items()])
        classes = [self.classes[name] for name in prior]
        return [
            SensorState(self.evidence[i].campaign, classes[own[:, i].argmax()], float(alone[i]))
            for i in order[: int(np.sum(wrong <= FALSE_ODD))]
        ]

    @property
    def usual(self) -> list[int]:
        """Numbers of the sensors that are not odd."""
        odd = {one.campaign for one in self.odd}
        return [i for i, each in enumerate(self.evidence) if each.campaign not in odd]

    def without_odd(self) -> Pass:
        """Return the pass without the odd sensors."""
        if not self.odd:
            return self
        usual, anything = self.usual, LotTest(self.anything.logs)
        for i in {*range(len(self.sensors))} - {*usual}:
            anything.add(self.sensors[i].evidence().tested, -1.0)
        return replace(
            self,
            sensors=tuple(self.sensors[i] for i in usual),
            evidence=tuple(self.evidence[i] for i in usual),
            anything=anything,
            sizes=None if self.sizes is None else self.sizes.only(usual),
        )

    @cached_property
    def each(self) -> list[SensorState]:
        """Names of what the model lacks for each sensor, and their posterior."""
        of_sets, odd = self.mixture.sensors
        sets = [tuple(n for n in self.classes if n in names) for names in of_sets] + [(ODD,)]
        each = zip(self.evidence, np.array([*of_sets.values(), odd]).T, strict=True)
        return [SensorState(one.campaign, sets[int(p.argmax())], float(p.max())) for one, p in each]

    def spec(self, name: str) -> str | None:
        """Return an effect in the setting that explains most; None of what is no effect."""
        if self.sizes is not None and name in self.sizes.specs:
            return self.sizes.specs[name]
        counted = Counter[str]()
        for one, weight in zip(self.evidence, self.mixture.having(name).tolist(), strict=True):
            if name in one.specs:
                counted[one.specs[name]] += weight
        return max(counted, key=counted.__getitem__, default=None)


def _pooled(used: Sequence[SensorEvidence]) -> dict[str, PooledEffect]:
    """Weigh each effect that most sensors show by all campaigns as one.

    Its shapes are those of the first campaign that shows it.
    """
    first: dict[str, Sequence[str]] = {}
    for each in used:
        first = {**each.shapes, **first}
    counts = {name: sum(name in each.shapes for each in used) for name in sorted(first)}
    shapes = {name: first[name] for name, count in counts.items() if 2 * count > len(used)}
    if not shapes:
        return {}
    specs = [spec for one in shapes.values() for spec in one]
    pooled = reduce(add, (Equations.of(each.solution, specs, each.unit) for each in used))
    return weigh_pooled(pooled, sum(each.redundancy for each in used), shapes)


def _evidence_of_mean(
    sensors: Sequence[Sensor], said: Sequence[SensorEvidence], whole: SensorModel, seed: int
) -> SensorEvidence | None:
    """Weigh the mean of sensors; None if their model allows no mean."""
    # What happens to each sensor at a time of its own has no mean.
    if any(effect.sudden for effect in whole.effects) or not (mean := mean_sensor(sensors, said)):
        return None
    with suppress(InputError):  # the positions do not determine the model
        return replace(mean, model=whole, seed=seed).evidence()
    return None
