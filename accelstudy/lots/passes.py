"""One pass over a lot: the evidence of all sensors together, with one model."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise_tests import AXES, NOISES, TAILS
from accelstudy.diagnosis.evidence.noise_tests import LEVEL as LEVEL_OF_NOISE
from accelstudy.diagnosis.rules import RULES
from accelstudy.effects import effect_names, get_effect
from accelstudy.lots.evidence import (
    COMMON,
    AnythingOdds,
    Joint,
    SensorEvidence,
    is_noise,
    lot_classes,
)
from accelstudy.lots.mixture import Anything, Mixture, Names
from accelstudy.lots.noise import SensorNoise
from accelstudy.lots.sizes import OfType, TypeSizes

Array = NDArray[np.float64]

LEVEL = 0.05
"""Level of the test whether anything is missing in a lot: half of it by what each campaign says of
its noise, and half by the noise of the lot."""
FALSE_ODD = 0.05
"""False discovery rate of odd sensors."""
MAX_ODD_SHARE = 0.1
"""Share of the sensors up to which what they have makes them odd, and is no matter of the type."""
MIN_RIVAL = 0.02
"""Least posterior of what may be there in place of something else."""
MIN_CERTAIN = 0.95
"""Posterior from which on one name is told without those that it may be confused with."""
UNTOLD, RESEMBLES = 6.0, 0.05
"""Noncentrality of what an effect leaves beside another one, absolute and as a share of its own, up
to which they are told together: on average the right one is 0.95 probable then."""
MAX_SETS = 12
"""Most probable sets of effects whose sizes are looked at."""
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
"""Name of what a sensor has that the model and the other sensors have not."""
IMPOSSIBLE = -30.0
"""Log odds of what cannot be."""
MIN_HAVING = 0.5
"""Posterior probability from which a sensor counts among those that have an effect."""


@dataclass(frozen=True)
class Found:
    """Something that the model of the lot lacks.

    Attributes
    ----------
    names : tuple of str, the names that mean the same in this lot
    posterior : float, given that the model lacks anything
    share : float, of the sensors
    share_ci95 : tuple of two floats
    """

    names: tuple[str, ...]
    posterior: float
    share: float
    share_ci95: tuple[float, float]


@dataclass(frozen=True)
class Odd:
    """A sensor with an effect that neither the model nor the other sensors have."""

    campaign: str
    posterior: float
    names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Pass:
    """The evidence of all sensors together, with one model.

    Attributes
    ----------
    sensors : tuple of SensorEvidence
    anything : Anything, the test of them
    retested : function of a sensor's place that gives what it added to the test
    mean : SensorEvidence, of their mean; None if they were in different positions
    noises : tuple of SensorNoise, by all sensors; None where a campaign says its own
    together : mapping of effects to what all campaigns say of them together
    sizes : TypeSizes, of the effects of `shapes`; None where there are none
    shapes : mapping of the names of one or two effects to the shape of each
    """

    sensors: tuple[SensorEvidence, ...]
    anything: Anything
    retested: Callable[[int], AnythingOdds]
    mean: SensorEvidence | None = None
    noises: tuple[SensorNoise | None, ...] = ()
    together: Mapping[str, Joint] = field(default_factory=dict)
    sizes: TypeSizes | None = None
    shapes: Mapping[frozenset[str], Mapping[str, str]] = field(default_factory=dict)

    @cached_property
    def classes(self) -> list[tuple[str, ...]]:
        """Names that mean the same in this lot; the first one stands for them."""
        return lot_classes(self.sensors) + ([] if self.mean is None else [(COMMON,)])

    @cached_property
    def mixture(self) -> Mixture:
        """Posterior of all sets of effects."""
        # One sensor alone never shows what has neither a name nor a shape.
        unseen = [IMPOSSIBLE if members[0] == COMMON else 0.0 for members in self.classes]
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
        of_all = {name: joint.odds for name, joint in self.together.items()}
        if (mean := self.mean) is not None:
            # What is larger than noise in the mean is no noise; what is sudden has no mean.
            of_all |= {
                name: log
                for name, log in mean.odds.items()
                if not is_noise(name) and not _is_sudden(name)
            }
            of_all[COMMON] = mean.odds[LEVEL_OF_NOISE]
        firsts = [members[0] for members in self.classes]
        common: dict[Names, float] = {
            (k,): of_all[name] for k, name in enumerate(firsts) if name in of_all
        }
        if mean is not None:
            common |= {
                both: log
                for both, log in self._pairs(mean).items()
                if not any(_is_sudden(firsts[k]) for k in both)
            }
        return Mixture.of(np.array(odds), pairs, prior / prior.sum(), common, cache(self._of_type))

    def _of_type(self, names: Names) -> OfType | None:
        """Odds of effects with sizes of the type; None where sensors do not tell of a type."""
        specs = self._shapes(names)
        if self.sizes is None or not specs:
            return None
        if not all(len(self.sizes.columns[spec]) for spec in specs):
            return None
        of_type = self.sizes.of_set(specs)
        return None if min(of_type.shares) * len(self.sensors) <= self._few else of_type

    def _shapes(self, names: Names) -> tuple[str, ...]:
        """Shapes of some effects that were looked at, in order; none if they were not."""
        effects = [self.classes[k][0] for k in names]
        shapes = self.shapes.get(frozenset(effects), {})
        return tuple(shapes[name] for name in effects) if shapes else ()

    def _looked_at(self, k: int) -> Names | None:
        """Most probable set with an effect, of those whose sizes were looked at."""
        sets = (one.names for one in self.mixture.sets if k in one.names)
        return next((names for names in sets if self._shapes(names)), None)

    def strongest(self) -> dict[frozenset[str], dict[str, str]]:
        """Return the most probable sets of effects and each of their effects, with best shapes."""
        best = [one.names for one in self.mixture.sets[:MAX_SETS]]
        sets = dict.fromkeys([*((k,) for names in best for k in names), *best])
        shapes = {}
        for names in sets:
            effects = sorted(self.classes[k][0] for k in names)
            if 0 < len(effects) < 3 and all(name in self.together for name in effects):
                shapes[frozenset(effects)] = self._best_shapes(effects)
        return shapes

    def _best_shapes(self, effects: Sequence[str]) -> dict[str, str]:
        of_all = {name: self.together[name].spec for name in effects}
        if self.mean is None:
            return of_all
        specs = self.mean.pair_specs.get((effects[0], effects[-1]))
        if specs is not None:
            return dict(zip(effects, specs, strict=True))
        return {name: self.mean.specs.get(name, spec) for name, spec in of_all.items()}

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
        mixture = self.mixture
        nothing = 1 - mixture.missing
        none_odd = np.prod(1 - mixture.sensors_under(())[1]) if nothing > 0 else 1.0
        return float(max(1 - nothing * none_odd, 1e-300))

    @cached_property
    def found(self) -> list[tuple[int, Found]]:
        """What is missing and has a name that is sure enough, with its place in `classes`.

        What few sensors have makes these odd.
        """
        if not self.missing:
            return []
        found, taken = [], set[int]()
        for k in np.argsort(-self.given, kind="stable").tolist():
            if k in taken or self._rare[k] or self.given[k] < MIN_RIVAL:
                continue
            alike = [k] if self.given[k] >= MIN_CERTAIN else [k, *self._rivals(k)]
            posterior = min(self.mixture.of_any(alike) / self.wrong, 1.0)
            if posterior >= RULES.sure:
                taken.update(alike)
                names = tuple(name for one in alike for name in self.classes[one])
                share, low, high = self.mixture.share(k)
                found.append((k, Found(names, posterior, share, (low, high))))
        return found

    def _rivals(self, k: int) -> list[int]:
        """Effects that all campaigns together hardly tell from one that is not certain."""
        names = self._looked_at(k)
        of_type = None if names is None else self.mixture.typical(names)
        if names is None or of_type is None or self.sizes is None:
            return []
        rivals = []
        for j in np.flatnonzero(self.given >= MIN_RIVAL).tolist():
            if j in names or not (spec := self._shapes((j,))):
                continue
            left, whole = self.sizes.apart(self._shapes(names), of_type, names.index(k), *spec)
            if left < min(UNTOLD, RESEMBLES * whole):
                rivals.append(j)
        return rivals

    @cached_property
    def given(self) -> Array:
        """Posterior of each class to be one of the lot, given that anything is wrong, (K,)."""
        return np.asarray(self.mixture.of_effects / self.wrong)

    @cached_property
    def _rare(self) -> NDArray[np.bool_]:
        """Whether few sensors have it, if it is one of the lot, (K,)."""
        of = np.maximum(self.mixture.of_effects, 1e-300)
        surely = [np.sum(self.mixture.having(k) > MIN_HAVING * of[k]) for k in range(len(of))]
        return np.array(surely) <= self._few

    @property
    def _few(self) -> float:
        """Sensors up to which what they have makes them odd."""
        return max(1, MAX_ODD_SHARE * len(self.sensors))

    @property
    def alternatives(self) -> list[tuple[tuple[str, ...], float]]:
        """The most probable classes with their posterior, given that anything is wrong."""
        order = np.argsort(-self.given, kind="stable")[:3]
        return [(self.classes[k], float(self.given[k])) for k in order]

    @cached_property
    def odd(self) -> list[Odd]:
        """Odd sensors, the surest first; of those that are told, 5 of 100 are told wrongly.

        A sensor is odd by whatever nothing accounts for that is found in the lot. If that makes
        more than few sensors odd, the lot has something that has no sure name, and what is rare
        makes them so.
        """
        found = {k for k, _ in self.found}
        nameless = np.array([k not in found for k in range(len(self.classes))], dtype=bool)
        odd = self._odd_by(nameless)
        return odd if len(odd) <= self._few else self._odd_by(self._rare)

    def _odd_by(self, strange: NDArray[np.bool_]) -> list[Odd]:
        """Sensors that are odd if they have one of some classes, (K,)."""
        of_sets, odd = self.mixture.sensors
        alone = sum((p for names, p in of_sets.items() if any(strange[k] for k in names)), odd)
        # Sensors of which nobody doubts it stay in their order.
        order = np.argsort(-np.round(alone, 3), kind="stable")
        wrong = np.cumsum(1 - alone[order]) / np.arange(1, len(alone) + 1)
        known = {k for k, _ in self.found}
        told = []
        for i in order[: int(np.sum(wrong <= FALSE_ODD))]:
            own = self.mixture.odds[i] + np.log(self.mixture.prior)
            k = max((k for k in range(len(own)) if k not in known), key=lambda k: own[k])
            told.append(Odd(self.sensors[i].campaign, float(alone[i]), self.classes[k]))
        return told

    @property
    def usual(self) -> list[int]:
        """Numbers of the sensors that are not odd."""
        odd = {one.campaign for one in self.odd}
        return [i for i, each in enumerate(self.sensors) if each.campaign not in odd]

    def without_odd(self) -> Pass:
        """The same without the sensors that are odd."""
        if not self.odd:
            return self
        usual = self.usual
        others = [self.retested(i) for i in range(len(self.sensors)) if i not in {*usual}]
        return replace(
            self,
            sensors=tuple(self.sensors[i] for i in usual),
            anything=self.anything.without((one.names, one.odds) for one in others),
            retested=lambda i: self.retested(usual[i]),
            sizes=None if self.sizes is None else self.sizes.only(usual),
        )

    @cached_property
    def each(self) -> list[tuple[tuple[str, ...], float]]:
        """Names of what the model lacks for a sensor, and their posterior, for each sensor."""
        of_sets, odd = self.mixture.sensors
        sets = [*of_sets]
        table = np.array([*of_sets.values(), odd])
        rows = []
        for i, k in enumerate(table.argmax(axis=0)):
            names = (ODD,) if k == len(sets) else tuple(self.classes[c][0] for c in sets[k])
            rows.append((names, float(table[k, i])))
        return rows

    def specs(self, places: Iterable[int]) -> dict[int, str]:
        """Effects of some classes, each in the setting that explains most."""
        specs = {}
        for k in places:
            if (names := self._looked_at(k)) is not None:
                specs[k] = self._shapes(names)[names.index(k)]
                continue
            counted: dict[str, float] = {}
            for each, weight in zip(self.sensors, self.mixture.having(k), strict=True):
                if (spec := each.specs.get(self.classes[k][0])) is not None:
                    counted[spec] = counted.get(spec, 0.0) + float(weight)
            if counted:
                specs[k] = max(counted, key=lambda spec: counted[spec])
        return specs


def _is_sudden(name: str) -> bool:
    """Whether something is an effect that comes to each sensor at a time of its own."""
    return name in effect_names() and get_effect(name).sudden


def _kind(name: str) -> str:
    """Which of `WEIGHTS` something has; things of one kind share it evenly."""
    if name in WEIGHTS:
        return name
    return UNKNOWN if name.startswith(UNKNOWN) else EFFECT
