"""One pass over a lot: the evidence of all sensors together, with one model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from accelstudy.basics.progress import track
from accelstudy.diagnosis.decision.problem import Problem
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import AXES, NOISES, TAILS
from accelstudy.diagnosis.rules import RULES
from accelstudy.lots.evidence import (
    Sensor,
    SensorEvidence,
    best_settings,
    lot_classes,
    pose_mean,
    unknown_odds,
)
from accelstudy.lots.mixture import Mixture
from accelstudy.lots.sizes import Names, TypeSizes

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
MIN_PROBABILITY = float(np.finfo(float).tiny)
"""Least p-value of which the logarithm is taken."""
MIN_RIVAL = 0.02
"""Least posterior probability of a name that is reported with others."""
MIN_CERTAIN = 0.95
"""Posterior probability of a set of names that are reported together, if no name is sure alone."""
MAX_NAMES = 3
"""Largest number of names in such a set."""
EXCLUSIVE = 0.1
"""Share of the posterior of a name up to which another one is missing beside it, and not in its
place."""
EFFECT = "effect"
WEIGHTS = {
    EFFECT: 1.0,
    UNKNOWN: RULES.prior_unknown,
    **dict.fromkeys(NOISES, RULES.prior_coloured),
    AXES: RULES.prior_axes,
    TAILS: RULES.prior_tails,
}
"""Prior weights of what the model of a lot may lack, relative to one effect of the catalogue."""
ODD = "odd"
"""Name of an effect that one sensor has, and neither the model nor the other sensors."""
MIN_HAVING = 0.5
"""Posterior probability from which a sensor counts among those that have an effect."""


class LotEffect(NamedTuple):
    """An effect, or something unnamed, that the model of the lot lacks.

    Attributes
    ----------
    names : tuple of str, the names between which this lot does not decide, the most probable first
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


class Alternative(NamedTuple):
    """Names that mean the same in a lot, and how probable it is that the model lacks one."""

    names: tuple[str, ...]
    posterior: float


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
    sizes : TypeSizes, of effects that most sensors show; None where there are none
    mean : Problem, that the mean residuals of the sensors pose which are not odd; None without one
    """

    sensors: tuple[Sensor, ...]
    evidence: tuple[SensorEvidence, ...]
    sizes: TypeSizes | None = None
    mean: Problem | None = None

    @classmethod
    def of(cls, sensors: Sequence[Sensor], mapped: Mapped) -> Pass:
        """Weigh everything that the models of all sensors may lack.

        Parameters
        ----------
        sensors : with their models
        mapped : maps a function over the sensors
        """
        each = track(mapped(Sensor.evidence, sensors), "evidence of the sensors", len(sensors))
        one = cls(tuple(sensors), tuple(each))
        # What is common to all is that of the sensors which are not odd whatever their sizes.
        some = [i for i in one.usual if one.evidence[i].base]
        said = [one.evidence[i] for i in some]
        if len(some) < 2:
            return one
        one = replace(one, mean=pose_mean([sensors[i] for i in some], said))
        refined = {} if one.mean is None else best_settings(one.mean)
        count = Counter(name for shown in said for name in shown.shapes)
        shapes = dict[str, Sequence[str]]()
        for name in sorted(name for name, times in count.items() if 2 * times > len(said)):
            first = next(shown.shapes[name] for shown in said if name in shown.shapes)
            shapes[name] = [*first, *([refined[name]] if name in refined else [])]
        if not shapes:
            return one
        usual = np.isin(np.arange(len(sensors)), some)
        return replace(one, sizes=TypeSizes.of([e.frame for e in one.evidence], shapes, usual))

    @cached_property
    def classes(self) -> dict[str, tuple[str, ...]]:
        """Classes of names that mean the same in this lot, by the first of each."""
        return lot_classes(self.evidence)

    @cached_property
    def mixture(self) -> Mixture:
        """Posterior of all sets of effects."""
        odds = {
            name: np.array([one.odds.get(name, 0.0) for one in self.evidence])
            for name in self.classes
        }
        first = {name: one for one, members in self.classes.items() for name in members}
        pairs: dict[Names, Array] = {}
        for i, one in enumerate(self.evidence):
            for both, log in one.pairs.items():
                names = tuple(sorted({first[name] for name in both if name in first}))
                if len(names) == 2:
                    told = pairs.setdefault(names, np.full(len(self.evidence), -np.inf))
                    told[i] = max(log, told[i])
        # Names of one kind share its weight evenly.
        usual = {n: UNKNOWN if n.startswith(UNKNOWN) else EFFECT for n in self.classes}
        kinds = {name: name if name in WEIGHTS else kind for name, kind in usual.items()}
        counts = Counter(kinds.values())
        total = sum(WEIGHTS[kind] for kind in counts)
        prior = {name: WEIGHTS[kind] / counts[kind] / total for name, kind in kinds.items()}
        return Mixture(odds, pairs, prior, self._common, self.sizes, self._few)

    @property
    def _common(self) -> dict[str, float]:
        """Log odds of what has no name, that it is the same in all sensors."""
        if self.mean is None:
            return {}
        return unknown_odds(self.mean, float(np.logaddexp.reduce(self.mean.detection.noise)))

    @cached_property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence."""
        return self._p_value(self.evidence)

    @property
    def p_value_of_usual(self) -> float:
        """That of the sensors which are not odd."""
        return self._p_value([self.evidence[i] for i in self.usual])

    def _p_value(self, evidence: Sequence[SensorEvidence]) -> float:
        """By the sum of what sensors show, the most that one shows, and the mean if they have one.

        Fisher's combination of their p-values finds what many have, Tippett's what a single one
        has. The smallest of the tests counts for all.
        """
        # Beyond the smallest number a probability is 0; without a sensor there is nothing.
        each = [max(one.p_value, MIN_PROBABILITY) for one in evidence] or [1.0]
        tests = [stats.combine_pvalues(each, how).pvalue for how in ("fisher", "tippett")]
        tests += [] if self.mean is None else [self.mean.detection.p_value]
        return float(min(len(tests) * min(tests), 1.0))

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL / 2

    @cached_property
    def wrong(self) -> float:
        """Posterior probability that the model lacks anything, or that a sensor is odd."""
        nothing = self.mixture.posterior[()]
        none_odd = np.prod(1 - self.mixture.sets[()].sensors[-1]) if nothing > 0 else 1.0
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
            alike = self._credible_set(name, taken)
            posterior = min(self.mixture.of_any(alike) / self.wrong, 1.0)
            if posterior < MIN_CERTAIN:
                alike, posterior = [name], given
            if posterior >= RULES.sure:
                taken.update(alike)
                members = tuple(member for one in alike for member in self.classes[one])
                share, low, high = self.mixture.share(name)
                found.append(LotEffect(members, posterior, share, (low, high), self.spec(name)))
        return found

    def _credible_set(self, name: str, taken: set[str]) -> list[str]:
        """Name with those that may be missing in its place, until one of them is certain to be."""
        alike, mixture = [name], self.mixture
        for rival, given in self.given.items():
            certain = mixture.of_any(alike) >= MIN_CERTAIN * self.wrong
            if certain or given < MIN_RIVAL or len(alike) == MAX_NAMES:
                break
            beside = max(mixture.of_all({rival, one}) for one in alike)
            if rival not in {*alike, *taken} and beside < EXCLUSIVE * mixture.of_any([rival]):
                alike.append(rival)
        return alike

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
    def alternatives(self) -> list[Alternative]:
        """The most probable classes with their posterior, given that anything is wrong."""
        return [Alternative(self.classes[name], p) for name, p in [*self.given.items()][:3]]

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
