"""One pass over a lot: the evidence of all sensors together, with one model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import special, stats

from accelstudy.basics.arrays import Array
from accelstudy.basics.progress import track
from accelstudy.diagnosis.evidence.candidates import UNKNOWN
from accelstudy.diagnosis.evidence.noise import NOISES
from accelstudy.diagnosis.evidence.size import Level
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import OUTLIER
from accelstudy.effects import get_effect
from accelstudy.lots.evidence import NOISE_PRIORS, Sensor, SensorEvidence, lot_classes
from accelstudy.lots.file_format import Alternative, OddSensor
from accelstudy.lots.mixture import Mixture
from accelstudy.lots.processes import Mapped
from accelstudy.lots.sizes import LotResiduals, ShownEffect

if TYPE_CHECKING:
    from accelstudy.lots.type_parameter import TypeParameter

LEVEL = 0.05
"""Level of the test whether anything is missing in a lot: half of it by what each campaign says of
its noise, and half by the noise of the lot."""
LEVEL_OF_PATTERN = 0.01
"""Level of the test for a pattern in common, from which on it is not noise that is wrong."""
FALSE_ODD = 0.05
"""False discovery rate of odd sensors."""
MAX_ODD_SHARE = 0.1
"""Share of the sensors up to which an effect makes them odd, and does not belong to the type."""
MIN_PROBABILITY = float(np.finfo(float).tiny)
"""Least p-value of which the logarithm is taken."""
MIN_CERTAIN = 0.95
"""Posterior probability of a set of names that are reported together, if no name is sure alone."""
MAX_NAMES = 3
"""Largest number of names in such a set."""
EFFECT = "effect"
WEIGHTS = {EFFECT: 1.0, UNKNOWN: RULES.prior_unknown, **NOISE_PRIORS}
"""Prior weights of what the model of a lot may lack, relative to one effect of the catalogue."""
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
    specs : (n,) tuple of str, that of each sensor: what is sudden has a time of its own; empty of
        what is no effect
    having : (n,) array, posterior of each sensor to have it
    other_size : (n,) array, that of having it in another size than the others
    parameters : its sizes, once the sensors are calibrated with it
    """

    names: tuple[str, ...]
    posterior: float
    share: float
    share_ci95: tuple[float, float]
    spec: str | None
    specs: tuple[str, ...]
    having: Array
    other_size: Array
    parameters: Sequence[TypeParameter] = ()

    @property
    def is_noise(self) -> bool:
        """Whether the most probable name is a kind of wrong noise."""
        return self.names[0] in NOISES

    def is_one_of(self, effects: Sequence[LotEffect]) -> bool:
        """Whether one of some effects has the same most probable name."""
        return self.names[0] in {one.names[0] for one in effects}


@dataclass(frozen=True, eq=False)
class Pass:
    """The evidence of all sensors together, with one model.

    Attributes
    ----------
    sensors : tuple of Sensor
    evidence : tuple of SensorEvidence, theirs
    """

    sensors: tuple[Sensor, ...]
    evidence: tuple[SensorEvidence, ...]

    @classmethod
    def of(cls, sensors: Sequence[Sensor], mapped: Mapped) -> Pass:
        """Weigh everything that the models of all sensors may lack.

        Parameters
        ----------
        sensors : with their models
        mapped : maps a function over the sensors
        """
        each = track(mapped(Sensor.evidence, sensors), "evidence of the sensors", len(sensors))
        return cls(tuple(sensors), tuple(each))

    # --- what the sensors tell --------------------------------------------------------------

    @property
    def determined(self) -> bool:
        """Whether any campaign determines its model; without one there is nothing to weigh."""
        return any(one.base is not None for one in self.evidence)

    @cached_property
    def residuals(self) -> LotResiduals:
        """Residuals of the sensors."""
        silent = Level.of_nothing_stated()
        levels = [silent if one.base is None else one.base.level for one in self.evidence]
        return LotResiduals([one.frame for one in self.evidence], levels)

    @cached_property
    def shown(self) -> dict[str, list[ShownEffect]]:
        """What sensors tell of the sizes of lasting effects that most of them show.

        An effect has the shapes that its first campaign tries, and the best one of the campaign
        that shows it most.
        """
        shown = dict[str, list[ShownEffect]]()
        for name in sorted({name for one in self.evidence for name in one.shapes}):
            showing = [one for one in self.evidence if name in one.shapes]
            if 2 * len(showing) > sum(one.base is not None for one in self.evidence):
                most = max(showing, key=lambda one: one.odds[name])
                specs = sorted({*showing[0].shapes[name], most.specs[name]})
                shapes = [one for one in map(self.residuals.shown, specs) if one.right.size]
                if shapes:
                    shown[name] = shapes
        return shown

    @cached_property
    def classes(self) -> dict[str, tuple[str, ...]]:
        """Classes of names that mean the same in this lot, by the first of each."""
        return lot_classes(self.evidence)

    @cached_property
    def mixture(self) -> Mixture:
        """Posterior of everything that the model of the lot may lack."""
        # What sensors have in common is no noise.
        pattern = min(self.residuals.p_values_of_pattern, default=1.0) < LEVEL_OF_PATTERN
        prior = priors_of([name for name in self.classes if not pattern or name not in NOISES])
        own = {n: np.array([one.odds.get(n, 0.0) for one in self.evidence]) for n in prior}
        mixture, typical = Mixture(prior, own), {}
        for name in {*self.shown} & {*prior}:
            sizes = self.residuals.typical(self.shown[name], mixture.odd)
            # What few sensors have, has no sizes of a type.
            if max(sizes, key=lambda one: one.log_likelihood).share * len(self.sensors) > self._few:
                typical[name] = sizes
        return replace(mixture, typical=typical)

    @property
    def _few(self) -> float:
        """Number of sensors up to which an effect makes them odd."""
        return max(1, MAX_ODD_SHARE * len(self.sensors))

    # --- whether anything is missing --------------------------------------------------------

    @cached_property
    def p_value(self) -> float:
        """Probability that sensors without anything missing would show as much evidence.

        Fisher's combination of their p-values finds what many have, Tippett's what a single one
        has, and what they have in common is too small for one of them. The smallest counts for all.
        """
        return _smallest([*_combined(self.evidence), *self._in_common])

    @property
    def p_value_of_usual(self) -> float:
        """P-value of the sensors that are not odd."""
        usual = [one for i, one in enumerate(self.evidence) if i not in self.odd]
        return _smallest([*_combined(usual), *self._in_common])

    @cached_property
    def _in_common(self) -> list[float]:
        """P-values of what the sensors have in common: sizes of effects, and any pattern."""
        each = [_smallest([one.p_value for one in shapes]) for shapes in self.shown.values()]
        sizes = [_smallest(each)] if each else []
        return [*sizes, *self.residuals.p_values_of_pattern]

    @property
    def missing(self) -> bool:
        """Whether anything is missing, at one level for the whole lot."""
        return self.p_value < LEVEL / 2

    # --- what is missing --------------------------------------------------------------------

    @cached_property
    def posterior(self) -> dict[str, float]:
        """Posterior of each class to be that of the lot, if anything is wrong, highest first."""
        return {name: p / self.mixture.wrong for name, p in self.mixture.posterior.items()}

    @property
    def alternatives(self) -> list[Alternative]:
        """The most probable classes with their posterior, given that anything is wrong."""
        first = [*self.posterior.items()][:3]
        return [Alternative(names=[*self.classes[name]], posterior=p) for name, p in first]

    @cached_property
    def found(self) -> LotEffect | None:
        """The missing effect, if a name is sure enough, or one of a few names is.

        What few sensors have makes these odd.
        """
        names = [name for name in self.posterior if name not in self._rare] if self.missing else []
        count = _count_certain([self.posterior[name] for name in names])
        posterior = sum(self.posterior[name] for name in names[:count])
        return self._effect(names[:count], posterior) if posterior >= RULES.sure else None

    @property
    def best(self) -> LotEffect:
        """The most probable effect, however sure."""
        name, posterior = next(iter(self.posterior.items()))
        return self._effect([name], posterior)

    def _effect(self, names: Sequence[str], posterior: float) -> LotEffect:
        """Say of an effect, which has one of some names, what the sensors tell of it."""
        first = names[0]
        members = tuple(member for name in names for member in self.classes[name])
        share, low, high = self.mixture.share(first)
        other_size, each = self.mixture.own_size(first), [one.specs for one in self.evidence]
        having = self.mixture.effects[first].having + other_size
        most = max(self.evidence, key=lambda one: one.odds.get(first, -np.inf))
        typical = self.mixture.typical.get(first)
        spec = typical[0].spec if typical else most.specs.get(first)
        own: tuple[str, ...] = ()
        if spec is not None:
            sudden = get_effect(spec).sudden
            own = tuple(specs.get(first, spec) if sudden else spec for specs in each)
        return LotEffect(
            members, min(posterior, 1.0), share, (low, high), spec, own, having, other_size
        )

    @cached_property
    def _rare(self) -> set[str]:
        """Classes of no type: what few sensors have, if the lot has it, and outlier positions."""
        having = {name: np.sum(e.having > MIN_HAVING) for name, e in self.mixture.effects.items()}
        return {name for name, n in having.items() if n <= self._few or name == OUTLIER}

    # --- which sensors ----------------------------------------------------------------------

    @cached_property
    def posterior_odd(self) -> Array:
        """Posterior of each sensor to be odd, (n,).

        A sensor is odd by whatever nothing accounts for that is found in the lot. If that makes
        more than few sensors odd, the lot has something that has no sure name, and what is rare
        makes them so.
        """
        *having, odd = self.mixture.sensors
        each = dict(zip(self.mixture.effects, having, strict=True))
        unnamed = np.asarray(sum((each[name] for name in each if name not in self._named), odd))
        if len(find_odd(unnamed)) <= self._few:
            return unnamed
        return np.asarray(sum((each[name] for name in self._rare), odd))

    @property
    def _named(self) -> tuple[str, ...]:
        """Names of what was found."""
        return () if self.found is None else self.found.names

    @cached_property
    def odd(self) -> dict[int, OddSensor]:
        """Odd sensors by their numbers, the surest first; 5 of 100 are expected to be wrong."""
        names = [name for name in self.mixture.own if name not in self._named]
        own = np.array([self.mixture.own[n] + np.log(self.mixture.prior[n]) for n in names])
        odd = dict[int, OddSensor]()
        for i in find_odd(self.posterior_odd):
            shares = special.softmax(own[:, i])
            first = np.argsort(-shares, kind="stable")
            first = first[: _count_certain(shares[first])]
            odd[i] = OddSensor(
                campaign=self.evidence[i].campaign,
                posterior=self.posterior_odd[i],
                names=[member for k in first for member in self.classes[names[k]]],
                by_size=False,
            )
        return odd


def find_odd(posterior: Array) -> list[int]:
    """Return the numbers of odd sensors, the surest first, so many that few are wrong.

    Parameters
    ----------
    posterior : (n,) array, probability of each sensor to be odd
    """
    # Sensors of which nobody doubts it stay in their order.
    order = np.argsort(-np.round(posterior, 3), kind="stable")
    wrong = np.cumsum(np.sort(1 - posterior)) / np.arange(1, len(posterior) + 1)
    return [*map(int, order[: np.sum(wrong <= FALSE_ODD)])]


def priors_of(names: Sequence[str]) -> dict[str, float]:
    """Prior probabilities of what the model of a lot may lack, the same for names of one kind."""
    kinds = {n: kind if (kind := n.partition("(")[0]) in WEIGHTS else EFFECT for n in names}
    counts = Counter(kinds.values())
    total = sum(WEIGHTS[kind] for kind in counts)
    return {name: WEIGHTS[kind] / counts[kind] / total for name, kind in kinds.items()}


def _count_certain(posterior: Sequence[float] | Array) -> int:
    """Count the names, the most probable first, that surely hold the truth; 1 if too many would."""
    sums = np.cumsum(posterior[:MAX_NAMES])
    return 1 + int(np.argmax(sums >= MIN_CERTAIN)) if len(sums) else 0


def _combined(evidence: Sequence[SensorEvidence]) -> list[float]:
    """Combine the p-values of campaigns, by Fisher and by Tippett."""
    # Beyond the smallest number a probability is 0; without a sensor there is nothing.
    each = [max(one.p_value, MIN_PROBABILITY) for one in evidence] or [1.0]
    return [float(stats.combine_pvalues(each, how).pvalue) for how in ("fisher", "tippett")]


def _smallest(p_values: Sequence[float]) -> float:
    """The smallest of some p-values, as one for all."""
    return min(len(p_values) * min(p_values), 1.0)
