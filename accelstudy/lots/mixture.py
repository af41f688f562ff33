"""The mixture of a lot: which effects its model lacks, how many sensors have them, and which.

Each sensor has an effect k of the lot, which the model lacks, with the probability ρ_k, its share:
1 in every second lot a priori, and uniform in the others. It has effects independently of each
other. A set Z of effects of the lot has the evidence

    B_Z = ∫ Π_i [(1 − ε) Σ_{s ⊆ Z} Π_{k ∈ s} ρ_k Π_{k ∈ Z∖s} (1 − ρ_k) r_i(s) + ε r̄_i] dρ,

with r_i(s) the odds of the campaign of sensor i for the set s against nothing, and r̄_i their mean
over all that could be missing: a sensor may be odd, and then have something of its own. Sets have
up to three effects, and a sensor has up to two of them.

The r_i take the sizes of the sensors for independent. An effect may as well be the same in all of
them: then the evidence is that of all campaigns as one, and either is equally probable a priori. If
the sensors were in the same positions and conditions, it is that of their mean, also for two
effects. Where the sizes of the type are known (`sizes`), B_Z is the integral with odds r_i of these
sizes, times what their being fitted takes away: the evidence of one size over the likelihood of the
best one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.lots.sizes import OfType

Array = NDArray[np.float64]
Names = tuple[int, ...]

PRIOR_ODD = 0.01
"""Prior probability that a sensor is odd."""
PRIOR_MISSING = 0.5
"""Prior probability that the model of the lot lacks anything."""
PRIOR_ALL = 0.5
"""Prior probability that all sensors have an effect of the lot."""
PRIOR_EQUAL = 0.5
"""Prior probability that an effect is equally large in all sensors."""
PRIOR_FURTHER = 0.3
"""Prior probability of two effects rather than one, and of three rather than two."""
MAX_SINGLES, MAX_EXTENDED = 12, 3
"""Effects of which pairs are tried, and pairs to which a third one is added."""
MIN_POSTERIOR = 1e-6
"""Posterior below which a set does not count."""
NODES = {1: 64, 2: 24, 3: 12}
"""Nodes of the integral over each share below 1, by the number of effects."""
BLOCK = 64
"""Sensors that are integrated over the shares at once, so that memory does not follow the lot."""


@dataclass(frozen=True)
class Weighted:
    """A set of effects of the lot.

    Attributes
    ----------
    names : tuple of int, places of the effects
    log_weight : float, log of its evidence times its prior weight
    """

    names: Names
    log_weight: float


@dataclass(frozen=True, eq=False)
class Mixture:
    """The posterior of a lot.

    Attributes
    ----------
    odds : (n, K) array, log odds of each sensor for each effect against nothing
    pairs : mapping of two places, in order, to (n,) arrays of log odds of both together
    prior : (K,) array, prior probabilities of the effects, which sum to 1
    common : mapping of one or two places to the log odds of the mean of the sensors
    typical : function of one or two places that gives odds with sizes of the type; None where they
        are not known
    sets : list of Weighted, most probable first
    """

    odds: Array
    pairs: Mapping[Names, Array]
    prior: Array
    common: Mapping[Names, float]
    typical: Callable[[Names], OfType | None]
    sets: list[Weighted]

    @classmethod
    def of(
        cls,
        odds: Array,
        pairs: Mapping[Names, Array],
        prior: Array,
        common: Mapping[Names, float] | None = None,
        typical: Callable[[Names], OfType | None] = lambda names: None,
    ) -> Mixture:
        """Weigh the sets of effects, the strongest first."""
        empty = cls(odds, pairs, prior, common or {}, typical, [])
        k = odds.shape[1]
        found: dict[Names, float] = {(): np.log(1 - PRIOR_MISSING) + empty._evidence(())}
        for i in range(k):
            weight = np.log(PRIOR_MISSING * (1 - PRIOR_FURTHER)) + np.log(prior[i])
            found[(i,)] = weight + empty._evidence((i,))
        singles = sorted(((i,) for i in range(k)), key=lambda s: -found[s])[:MAX_SINGLES]
        strongest: list[Names] = [*singles]
        for size in (2, 3):
            tried = {tuple(sorted({*s, i})) for s in strongest for (i,) in singles if i not in s}
            if size == 2:
                # What is small beside the strongest one may be nothing by itself.
                first = strongest[:MAX_EXTENDED]
                tried |= {tuple(sorted({*s, i})) for s in first for i in range(k) if i not in s}
            if not tried:
                break
            log = np.log(PRIOR_MISSING * PRIOR_FURTHER ** (size - 1)) - np.log(
                special.comb(k, size)
            )
            for names in sorted(tried):
                found[names] = log + empty._evidence(names)
            strongest = sorted(tried, key=lambda s: -found[s])[:MAX_EXTENDED]
        ordered = sorted(found.items(), key=lambda item: -item[1])
        return replace(empty, sets=[Weighted(n, float(w)) for n, w in ordered])

    @cached_property
    def probabilities(self) -> Array:
        """Posterior of each of `sets`."""
        return special.softmax([one.log_weight for one in self.sets])

    @property
    def missing(self) -> float:
        """Posterior probability that the model of the lot lacks anything."""
        return 1 - sum(p for one, p in zip(self.sets, self.probabilities, strict=True)
                       if not one.names)  # fmt: skip

    @cached_property
    def of_effects(self) -> Array:
        """Posterior probability of each effect to be one of the lot, (K,)."""
        each = np.zeros(self.odds.shape[1])
        for one, p in zip(self.sets, self.probabilities, strict=True):
            each[[*one.names]] += p
        return each

    def of_any(self, places: Collection[int]) -> float:
        """Posterior probability that any of some effects is one of the lot."""
        each = zip(self.sets, self.probabilities, strict=True)
        return float(sum(p for one, p in each if {*one.names} & {*places}))

    def share(self, k: int) -> tuple[float, float, float]:
        """Share of the sensors that have an effect: mean, and the interval that holds 95 %."""
        grid, density = np.linspace(0, 1, 401), np.zeros(401)
        for one, p in zip(self.sets, self.probabilities, strict=True):
            if k in one.names and p > MIN_POSTERIOR:
                nodes, weights = self._posterior(one.names)
                # A mixture of narrow steps between the nodes of the integral.
                place = one.names.index(k)
                values, mass = nodes[place], weights.sum(
                    axis=tuple(a for a in range(len(one.names)) if a != place)
                )  # fmt: skip
                log = np.log(np.maximum(mass / _nodes(len(one.names))[1], 1e-300))
                fine = np.exp(np.interp(grid, values[:-1], log[:-1]))
                density += p * mass[:-1].sum() * fine / fine.sum()
                density[-1] += p * mass[-1]
        density /= density.sum()
        below = np.cumsum(density)
        low, high = grid[np.minimum(np.searchsorted(below, [0.025, 0.975]), 400)]
        return float(grid @ density), float(low), float(high)

    @cached_property
    def sensors(self) -> tuple[dict[Names, Array], Array]:
        """Posterior of each sensor to have a set of effects, {set: (n,)}, and to be odd, (n,)."""
        n = len(self.odds)
        of_sets: dict[Names, Array] = {}
        odd = np.zeros(n)
        for one, p in zip(self.sets, self.probabilities, strict=True):
            if p < MIN_POSTERIOR:
                continue
            of_set, odd_in_set = self.sensors_under(one.names)
            for subset, mass in of_set.items():
                of_sets[subset] = of_sets.get(subset, np.zeros(n)) + p * mass
            odd += p * odd_in_set
        return of_sets, odd

    def sensors_under(self, names: Names) -> tuple[dict[Names, Array], Array]:
        """Return what `sensors` has, if the model of the lot lacks some effects."""
        weights = np.ravel(self._posterior(names)[1])
        of_sets: dict[Names, list[Array]] = {}
        odd = []
        for parts, strange in self._parts(names, self._judging(names)):
            total = np.logaddexp.reduce([*parts.values(), strange])
            for subset, log in parts.items():
                mass = np.exp(log - total).reshape(len(log), -1) @ weights
                of_sets.setdefault(subset, []).append(mass)
            odd.append(np.exp(strange - total).reshape(len(strange), -1) @ weights)
        each = {subset: np.concatenate(masses) for subset, masses in of_sets.items()}
        return each, np.concatenate(odd)

    def having(self, k: int) -> Array:
        """Posterior of each sensor to have an effect, (n,)."""
        return np.asarray(sum((p for names, p in self.sensors[0].items() if k in names),
                              np.zeros(len(self.odds))))  # fmt: skip

    @cached_property
    def _anything(self) -> Array:
        """Log odds of each sensor for anything, (n,)."""
        return np.asarray(special.logsumexp(self.odds + np.log(self.prior), axis=1))

    def _judging(self, names: Names) -> Callable[[Names], Array]:
        """Odds of subsets by which sensors and shares are judged: those that explain more."""
        of_type = self.typical(names)
        if of_type is None or self._typical_way(names, of_type) < self._own_way(names):
            return self._together
        return partial(_looked_up, of_type, names)

    def _together(self, subset: Names) -> Array:
        """Log odds of the sensors for some effects together, (n,)."""
        if not subset:
            return np.zeros(len(self.odds))
        if len(subset) == 1:
            return self.odds[:, subset[0]]
        one, other = subset
        # Two that were not weighed together say no more than the weaker one.
        both = np.minimum(self.odds[:, one], self.odds[:, other])
        found = self.pairs.get((one, other))
        return both if found is None else np.where(np.isnan(found), both, found)

    def _parts(
        self, names: Names, odds_of: Callable[[Names], Array]
    ) -> Iterator[tuple[dict[Names, Array], Array]]:
        """Log of what each subset, and oddness, contributes: (b, nodes ...) arrays, b sensors."""
        size = len(names)
        nodes = (len(_nodes(size)[0]),) * size
        rho = np.meshgrid(*[_nodes(size)[0]] * size, indexing="ij") if size else []
        prior = {}
        for subset in (s for r in range(min(size, 2) + 1) for s in combinations(names, r)):
            prior[subset] = np.full(nodes, np.log(1 - PRIOR_ODD))
            for place, i in enumerate(names):
                prior[subset] += np.log(rho[place]) if i in subset else _log_of_rest(rho[place])
        odds = {subset: odds_of(subset) for subset in prior}
        for first in range(0, len(self.odds), BLOCK):
            some = slice(first, first + BLOCK)
            parts = {s: odds[s][some].reshape(-1, *[1] * size) + prior[s] for s in prior}
            strange = (np.log(PRIOR_ODD) + self._anything[some]).reshape(-1, *[1] * size)
            yield parts, np.broadcast_to(strange, (len(strange), *nodes))

    def _log_likelihood(self, names: Names, odds_of: Callable[[Names], Array]) -> Array:
        each = (
            np.logaddexp.reduce([*parts.values(), strange]).sum(axis=0)
            for parts, strange in self._parts(names, odds_of)
        )
        return np.asarray(sum(each))

    def _evidence(self, names: Names) -> float:
        """Log evidence of effects: with sizes of each sensor, or of the type."""
        own, of_type = self._own_way(names), self.typical(names)
        if of_type is not None:
            alike = self._typical_way(names, of_type)
        elif names in self.common:
            alike = self.common[names]
        else:
            return own
        return float(np.logaddexp(own + np.log(1 - PRIOR_EQUAL), alike + np.log(PRIOR_EQUAL)))

    def _own_way(self, names: Names) -> float:
        """Log evidence with sizes of each sensor."""
        logs = self._log_likelihood(names, self._together)
        return float(special.logsumexp(logs + _log_weights(len(names))))

    def _typical_way(self, names: Names, of_type: OfType) -> float:
        """Log evidence with sizes of the type."""
        logs = self._log_likelihood(names, partial(_looked_up, of_type, names))
        if names in self.common:
            fitted = self.common[names] - of_type.alike
        else:
            fitted = 0.0
            for k in names:
                one = self.typical((k,))
                fitted += self.common.get((k,), -np.inf) - (0.0 if one is None else one.alike)
        return float(special.logsumexp(logs + _log_weights(len(names)))) + fitted

    def _posterior(self, names: Names) -> tuple[list[Array], Array]:
        """Nodes of each share, and their posterior probabilities (nodes ...)."""
        logs = self._log_likelihood(names, self._judging(names)) + _log_weights(len(names))
        return [_nodes(len(names))[0]] * len(names), np.exp(logs - special.logsumexp(logs))


def _looked_up(of_type: OfType, names: Names, subset: Names) -> Array:
    """Log odds of the sensors for a subset of a set, with sizes of the type, (n,)."""
    if not subset:
        return np.zeros(len(next(iter(of_type.odds.values()))))
    return of_type.odds[tuple(names.index(k) for k in subset)]


@cache
def _nodes(size: int) -> tuple[Array, Array]:
    """Nodes and weights of the integral over a share."""
    if not size:
        return np.zeros(0), np.zeros(0)
    nodes, weights = np.polynomial.legendre.leggauss(NODES[size])
    return np.append((nodes + 1) / 2, 1.0), np.append((1 - PRIOR_ALL) * weights / 2, PRIOR_ALL)


def _log_of_rest(share: Array) -> Array:
    """Log of the share that does not have an effect, −inf where all do."""
    with np.errstate(divide="ignore"):
        return np.log1p(-share)


@cache
def _log_weights(size: int) -> Array:
    weights = np.ones(())
    for _ in range(size):
        weights = np.multiply.outer(weights, _nodes(size)[1])
    return np.asarray(np.log(weights))


@dataclass(frozen=True)
class Anything:
    """The test whether anything is missing in a lot, to which sensors are added one by one.

    The statistic is the evidence that a share of the sensors has one effect. Lots of
    simulated noise say how large it is if nothing is missing.

    Attributes
    ----------
    logs : dict of what is tested to (1 + s, nodes) array, log likelihood of each share in the lot,
        and in s lots of noise
    """

    logs: dict[str, Array] = field(default_factory=dict)

    def add(self, names: Iterable[str], odds: NDArray[np.floating]) -> None:
        """Add what a sensor says.

        Parameters
        ----------
        names : K, of what is tested
        odds : (1 + s, K) array, their log odds in the campaign, and in noise alone
        """
        for name, log in _of_shares(names, odds):
            self.logs[name] = self.logs.get(name, 0.0) + log

    def without(self, each: Iterable[tuple[Iterable[str], NDArray[np.floating]]]) -> Anything:
        """Return the test without some sensors, of which it is given what was added."""
        logs = dict(self.logs)
        for names, odds in each:
            for name, log in _of_shares(names, odds):
                logs[name] = logs[name] - log
        return Anything(logs)

    def p_value(self, weights: Mapping[str, float]) -> float:
        """Probability that sensors without anything missing would show as much evidence.

        Parameters
        ----------
        weights : prior weights of what shares none with the others, relative to all of these
        """
        names = sorted(self.logs)
        if not names:
            return 1.0
        prior = np.array([weights.get(name, 1 / len(names)) for name in names])
        by_effect = [
            special.logsumexp(self.logs[name] + np.log(_nodes(2)[1]), axis=-1) for name in names
        ]
        total = special.logsumexp(np.array(by_effect) + np.log(prior)[:, None], axis=0)
        return float((1 + np.sum(total[1:] >= total[0])) / len(total))


def _of_shares(names: Iterable[str], odds: NDArray[np.floating]) -> Iterator[tuple[str, Array]]:
    """Log likelihood of each share in a sensor, (1 + s, nodes), of what is tested."""
    nodes, _ = _nodes(2)
    for name, column in zip(names, odds.T, strict=True):
        yield name, np.logaddexp(_log_of_rest(nodes), column[:, None] + np.log(nodes))
