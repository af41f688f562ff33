"""The mixture of a lot: which effects its model lacks, how many sensors have them, and which.

Each sensor has an effect k of the lot, which the model lacks, with the probability ρ_k, its share:
1 in every second lot a priori, and uniform in the others. It has effects independently of each
other. A set Z of effects of the lot has the evidence

    B_Z = ∫ Π_i [(1 − ε) Σ_{s ⊆ Z} Π_{k ∈ s} ρ_k Π_{k ∈ Z∖s} (1 − ρ_k) r_i(s) + ε r̄_i] dρ,

with r_i(s) the odds of the campaign of sensor i for the set s against nothing, and r̄_i their mean
over all that could be missing: a sensor may be odd, and then have something of its own. Sets have
up to two effects.

As probable as that each sensor has sizes of its own, of which its campaign has the odds, is a
priori that a type has sizes, about which those of its sensors scatter more or less: then the r_i
are the odds for sizes of the type (`sizes`). What has no name has none; if it is the same in all
sensors, it has the odds of their mean.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, reduce
from itertools import combinations
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.lots.sizes import Names, TypeSizes, most_likely

Array = NDArray[np.float64]
T = TypeVar("T")

PRIOR_ODD = 0.01
"""Prior probability that a sensor is odd."""
PRIOR_MISSING = 0.5
"""Prior probability that the model of the lot lacks anything."""
PRIOR_ALL = 0.5
"""Prior probability that all sensors have an effect of the lot."""
PRIOR_ALIKE = 0.5
"""Prior probability that sizes are those of a type, with any scatter; else each has its own."""
PRIOR_FURTHER = 0.3
"""Prior probability of two effects rather than one."""
MAX_SINGLES, MAX_EXTENDED = 12, 3
"""Most probable effects of which pairs are tried, and of these the ones that are in every pair."""
MIN_POSTERIOR = 1e-6
"""Posterior below which a set does not count."""
NODES = {1: 64, 2: 24}
"""Nodes of the integral over each share below 1, by the number of effects."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """The posterior of a lot.

    Attributes
    ----------
    odds : mapping of each effect to (n,) array, log odds of the sensors against nothing
    pairs : mapping of two effects to (n,) array, log odds of both together; −inf of a sensor for
        which they were not weighed together
    prior : mapping of each effect to its prior probability; these sum to 1
    common : mapping of what has no name to log odds that it is the same in all sensors
    sizes : TypeSizes of effects; None if nothing is known of them
    few : float, sensors up to which an effect makes these odd, and is none of the type
    """

    odds: Mapping[str, Array]
    pairs: Mapping[Names, Array]
    prior: Mapping[str, float]
    common: Mapping[str, float] = field(default_factory=dict)
    sizes: TypeSizes | None = None
    few: float = 0.0
    _known: dict[Names, list[tuple[Array, Array]]] = field(default_factory=dict, init=False)

    @cached_property
    def sets(self) -> dict[Names, float]:
        """Sets of effects of the lot with log of evidence times prior weight, strongest first."""
        found: dict[Names, float] = {(): np.log(1 - PRIOR_MISSING) + self._evidence(())}
        for name, prior in self.prior.items():
            weight = np.log(PRIOR_MISSING * (1 - PRIOR_FURTHER) * prior)
            found[name,] = weight + self._evidence((name,))
        singles = sorted(self.prior, key=lambda name: -found[name,])[:MAX_SINGLES]
        weight, pairs = PRIOR_MISSING * PRIOR_FURTHER, special.comb(len(self.prior), 2)
        for one, other in combinations(singles, 2):
            if one in singles[:MAX_EXTENDED]:
                both = min(one, other), max(one, other)
                found[both] = np.log(weight / pairs) + self._evidence(both)
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    @cached_property
    def posterior(self) -> dict[Names, float]:
        """Posterior of each of `sets`."""
        return dict(zip(self.sets, special.softmax([*self.sets.values()]).tolist(), strict=True))

    def of_any(self, effects: Collection[str]) -> float:
        """Posterior probability that any of some effects is one of the lot."""
        return sum(p for names, p in self.posterior.items() if {*names} & {*effects})

    def of_all(self, effects: Collection[str]) -> float:
        """Posterior probability that all of some effects are of the lot."""
        return sum(p for names, p in self.posterior.items() if {*names} >= {*effects})

    def share(self, name: str) -> tuple[float, float, float]:
        """Share of the sensors that have an effect: mean, and the interval that holds 95 %."""
        grid, density = np.linspace(0, 1, 401), np.zeros(401)
        for names, p in self.posterior.items():
            if name in names and p > MIN_POSTERIOR:
                # A mixture of narrow steps between the nodes of the integral.
                nodes, weights = _nodes(len(names))
                place = 1 + names.index(name)
                others = tuple(axis for axis in range(1 + len(names)) if axis != place)
                mass = self._shares(names).sum(axis=others)
                log = np.log(np.maximum(mass / weights, 1e-300))
                fine = np.exp(np.interp(grid, nodes[:-1], log[:-1]))
                density += p * mass[:-1].sum() * fine / fine.sum()
                density[-1] += p * mass[-1]
        density /= density.sum()
        low, high = grid[np.minimum(np.searchsorted(np.cumsum(density), [0.025, 0.975]), 400)]
        return float(grid @ density), float(low), float(high)

    @cached_property
    def sensors(self) -> tuple[dict[Names, Array], Array]:
        """Posterior of each sensor to have a set of effects, {set: (n,)}, and to be odd, (n,)."""
        of_sets: dict[Names, Array] = {}
        odd = np.zeros(len(self._anything))
        for names, p in self.posterior.items():
            if p < MIN_POSTERIOR:
                continue
            of_set, odd_in_set = self.sensors_under(names)
            for subset, mass in of_set.items():
                of_sets[subset] = of_sets.get(subset, 0.0) + p * mass
            odd += p * odd_in_set
        return of_sets, odd

    def sensors_under(self, names: Names) -> tuple[dict[Names, Array], Array]:
        """Return what `sensors` has, if the model of the lot lacks some effects."""
        table = np.zeros((len(_subsets(names)) + 1, len(self._anything)))
        for shares, (_, odds) in zip(self._shares(names), self._ways(names), strict=True):
            logs = self._contributions(names, odds)
            of_each = np.exp(logs - np.logaddexp.reduce(logs))
            table += of_each.reshape(*table.shape, -1) @ np.ravel(shares)
        return dict(zip(_subsets(names), table[:-1], strict=True)), table[-1]

    def having(self, name: str) -> Array:
        """Posterior of each sensor to have an effect, (n,)."""
        parts = [p for names, p in self.sensors[0].items() if name in names]
        return np.sum([np.zeros(len(self._anything)), *parts], axis=0)

    @cached_property
    def _anything(self) -> Array:
        """Log odds of each sensor for anything, (n,)."""
        weighed = [self.odds[name] + np.log(prior) for name, prior in self.prior.items()]
        return np.asarray(special.logsumexp(weighed, axis=0))

    def _of_own_sizes(self, subset: Names) -> Array:
        """Log odds of the sensors for some effects together, with sizes of each sensor, (n,)."""
        if not subset:
            return np.zeros(len(self._anything))
        # Two that were not weighed together say no more than the weaker one.
        weaker = np.min([self.odds[name] for name in subset], axis=0)
        known = self.pairs.get(subset, np.float64(-np.inf))
        return np.where(np.isneginf(known), weaker, known)

    def _contributions(self, names: Names, odds: Array) -> Array:
        """Log of what each of `_subsets`, and oddness, contributes, (s + 1, n, nodes ...).

        Parameters
        ----------
        names : some effects
        odds : (s, n) array, log odds of the sensors for each of their subsets
        """
        each = np.array([*odds, self._anything])
        return each.reshape(*each.shape, *[1] * len(names)) + _priors(len(names))

    def _evidence(self, names: Names) -> float:
        """Log evidence of effects, whatever their sizes."""
        return float(special.logsumexp([logs for logs, _ in self._ways(names)]))

    def _ways(self, names: Names) -> list[tuple[Array, Array]]:
        """Log evidence by the ways in which sizes differ, (nodes ...) of shares, and odds then.

        The odds are those of `_contributions`. Of a sensor that is not usual, whose noise may be
        another one as well, sizes of the type say no more than it says by itself.
        """
        if names in self._known:
            return self._known[names]
        types = [] if self.sizes is None else self.sizes.of_set(names)
        own = np.array([self._of_own_sizes(subset) for subset in _subsets(names)])
        if types and min(most_likely(types).shares.values()) * own.shape[1] <= self.few:
            types = []
        odds, priors = [own], [np.log(1 - PRIOR_ALIKE) if types else 0.0]
        for one in types:
            assert self.sizes is not None
            alike = np.array([one.odds[subset] for subset in _subsets(names)])
            odds.append(np.where(self.sizes.usual, alike, np.minimum(alike, own)))
            priors.append(np.log(PRIOR_ALIKE / len(types)) + one.cost)
        weights, ways = _log_weights(len(names)), list[tuple[Array, Array]]()
        for each, prior in zip(odds, priors, strict=True):
            logs = np.logaddexp.reduce(self._contributions(names, each)).sum(axis=0)
            ways.append((logs + weights + prior, each))
        if len(names) == 1 and names[0] in self.common:
            # Which of the sensors have it, is not asked then.
            ((logs, _),) = ways
            alone, same = special.logsumexp(logs), self.common[names[0]]
            both = np.logaddexp(np.log(1 - PRIOR_ALIKE) + alone, np.log(PRIOR_ALIKE) + same)
            ways = [(logs + both - alone, own)]
        self._known[names] = ways
        return ways

    def _shares(self, names: Names) -> Array:
        """Posterior of each way in which sizes differ and of the shares, (w, nodes ...)."""
        return np.asarray(special.softmax([logs for logs, _ in self._ways(names)]))


def _subsets(names: Iterable[T]) -> list[tuple[T, ...]]:
    """Subsets of some effects, all of which a sensor may have."""
    given = [*names]
    return [s for r in range(len(given) + 1) for s in combinations(given, r)]


@cache
def _nodes(size: int) -> tuple[Array, Array]:
    """Nodes and weights of the integral over a share, if there are `size` of them."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES[size]) if size else np.zeros((2, 0))
    return np.append((nodes + 1) / 2, 1.0), np.append((1 - PRIOR_ALL) * weights / 2, PRIOR_ALL)


@cache
def _priors(size: int) -> Array:
    """Log of the prior of each of the subsets of `size` effects, and of oddness, by the shares.

    Returns
    -------
    (s + 1, 1, nodes ...) array
    """
    nodes = _nodes(size)[0]
    shares, usual = np.meshgrid(*[nodes] * size, indexing="ij"), np.zeros((len(nodes),) * size)
    usual += np.log(1 - PRIOR_ODD)
    priors = [
        sum((np.log(r) if k in has else _log_of_rest(r) for k, r in enumerate(shares)), usual)
        for has in _subsets(range(size))
    ]
    return np.array([*priors, np.full_like(usual, np.log(PRIOR_ODD))])[:, None]


def _log_of_rest(share: Array) -> Array:
    """Logarithm of 1 − share; −inf where the share is 1."""
    with np.errstate(divide="ignore"):
        return np.log1p(-share)


@cache
def _log_weights(size: int) -> Array:
    """Log of prior weights of the nodes of all shares, (nodes ...)."""
    return np.asarray(np.log(reduce(np.multiply.outer, [_nodes(size)[1]] * size, np.ones(()))))


def p_value(
    tested: Sequence[Mapping[str, NDArray[np.float32]]], weights: Mapping[str, float]
) -> float:
    """Probability that sensors without anything missing would show as much evidence.

    The statistic is the evidence that a share of the sensors has one effect. Lots of simulated
    noise say how large it is if nothing is missing.

    Parameters
    ----------
    tested : of each sensor, what is tested with its log odds and those in noise alone, (1 + s,)
    weights : prior weights of what shares none with the others, relative to all of these
    """
    names = sorted({name for sensor in tested for name in sensor})
    if not names:
        return 1.0
    (nodes, prior_of_share), by_effect = _nodes(2), list[Array]()
    for name in names:
        each = (sensor[name][:, None] for sensor in tested if name in sensor)
        logs = sum(np.logaddexp(_log_of_rest(nodes), odds + np.log(nodes)) for odds in each)
        weight = weights.get(name, 1 / len(names))
        by_effect.append(special.logsumexp(logs + np.log(prior_of_share * weight), axis=-1))
    total = special.logsumexp(by_effect, axis=0)
    return float((1 + np.sum(total[1:] >= total[0])) / len(total))
