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

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from itertools import combinations, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.lots.sizes import Names, TypeSizes, most_likely, subsets_of

Array = NDArray[np.float64]

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
NODES = (0, 64, 24)
"""Nodes of the integral over each share below 1, by the number of effects."""
STEPS = 400
"""Steps in which the posterior of a share is told."""


class Shares(NamedTuple):
    """Nodes of the integral over the shares of some effects.

    Attributes
    ----------
    nodes : (k, q) array, shares
    log_weights : (q,) array, log of the prior of each node
    log_priors : (s + 1, 1, q) array, log probabilities that a sensor has each of the subsets of the
        effects, and that it is odd
    """

    nodes: Array
    log_weights: Array
    log_priors: Array


@cache
def shares_of(size: int) -> Shares:
    """Nodes of the integral over the shares of `size` effects."""
    one, weights = _share_nodes(NODES[size])
    nodes = np.array([*product(one, repeat=size)]).T
    has = np.array([[k in some for k in range(size)] for some in subsets_of(range(size))])
    with np.errstate(divide="ignore"):
        each = np.where(has[..., None], np.log(nodes), np.log1p(-nodes))
    priors = np.log(1 - PRIOR_ODD) + each.sum(axis=1)
    log_weights = np.log([np.prod(each) for each in product(weights, repeat=size)])
    odd = np.full((1, len(log_weights)), np.log(PRIOR_ODD))
    return Shares(nodes, log_weights, np.concatenate([priors, odd])[:, None])


def _share_nodes(count: int) -> tuple[Array, Array]:
    """Nodes and weights of the integral over one share, of which 1 is the last."""
    nodes, weights = np.polynomial.legendre.leggauss(count) if count else np.zeros((2, 0))
    return np.append((nodes + 1) / 2, 1.0), np.append((1 - PRIOR_ALL) * weights / 2, PRIOR_ALL)


@dataclass(frozen=True, eq=False)
class EffectSet:
    """What sensors tell of a set of effects, if the model of the lot lacks these.

    Attributes
    ----------
    names : tuple of str
    odds : (w, s + 1, n) array, log odds of the sensors for each subset, and for being odd, by the
        ways in which sizes may differ
    log_weights : (w, q) array, log evidence times prior weight of these ways and of the shares
    """

    names: Names
    odds: Array
    log_weights: Array

    @cached_property
    def log_weight(self) -> float:
        """Log of evidence times prior weight."""
        return float(special.logsumexp(self.log_weights))

    @cached_property
    def sensors(self) -> Array:
        """Posterior of each sensor to have each of the subsets, and to be odd, (s + 1, n)."""
        priors, posterior = shares_of(len(self.names)).log_priors, np.zeros(self.odds.shape[1:])
        for odds, shares in zip(self.odds, special.softmax(self.log_weights), strict=True):
            posterior += special.softmax(odds[..., None] + priors, axis=0) @ shares
        return posterior

    def share(self, name: str) -> Array:
        """Posterior of the share of the sensors that have an effect, at `STEPS` + 1 shares."""
        below, weights = _share_nodes(NODES[len(self.names)])
        grid = special.softmax(self.log_weights).sum(axis=0)
        grid = grid.reshape((len(below),) * len(self.names))
        mass = np.moveaxis(grid, self.names.index(name), 0).reshape(len(below), -1).sum(axis=1)
        # Narrow steps between the nodes of the integral.
        log = np.log(np.maximum(mass / weights, 1e-300))[:-1]
        fine = np.exp(np.interp(np.linspace(0, 1, STEPS + 1), below[:-1], log))
        density = mass[:-1].sum() * fine / fine.sum()
        density[-1] += mass[-1]
        return np.asarray(density)


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

    @cached_property
    def sets(self) -> dict[Names, EffectSet]:
        """Sets of effects of the lot, the most probable first."""
        found: dict[Names, EffectSet] = {(): self._weigh((), 1 - PRIOR_MISSING)}
        for name, prior in self.prior.items():
            found[name,] = self._weigh((name,), PRIOR_MISSING * (1 - PRIOR_FURTHER) * prior)
        singles = sorted(self.prior, key=lambda name: -found[name,].log_weight)[:MAX_SINGLES]
        each = PRIOR_MISSING * PRIOR_FURTHER / max(special.comb(len(self.prior), 2), 1)
        for one, other in combinations(singles, 2):
            if one in singles[:MAX_EXTENDED]:
                both = min(one, other), max(one, other)
                found[both] = self._weigh(both, each)
        return dict(sorted(found.items(), key=lambda item: -item[1].log_weight))

    @cached_property
    def posterior(self) -> dict[Names, float]:
        """Posterior of each of `sets`."""
        p = special.softmax([one.log_weight for one in self.sets.values()])
        return dict(zip(self.sets, p.tolist(), strict=True))

    def of_any(self, effects: Collection[str]) -> float:
        """Posterior probability that any of some effects is one of the lot."""
        return sum(p for names, p in self.posterior.items() if {*names} & {*effects})

    def of_all(self, effects: Collection[str]) -> float:
        """Posterior probability that all of some effects are of the lot."""
        return sum(p for names, p in self.posterior.items() if {*names} >= {*effects})

    @property
    def _probable(self) -> list[tuple[EffectSet, float]]:
        """Sets that count, with their posterior."""
        return [(self.sets[s], p) for s, p in self.posterior.items() if p > MIN_POSTERIOR]

    def share(self, name: str) -> tuple[float, float, float]:
        """Share of the sensors that have an effect: mean, and the interval that holds 95 %."""
        having = [(one, p) for one, p in self._probable if name in one.names]
        density = np.sum([p * one.share(name) for one, p in having], axis=0)
        density /= density.sum()
        grid = np.linspace(0, 1, STEPS + 1)
        low, high = grid[np.minimum(np.searchsorted(np.cumsum(density), [0.025, 0.975]), STEPS)]
        return float(grid @ density), float(low), float(high)

    @cached_property
    def sensors(self) -> tuple[dict[Names, Array], Array]:
        """Posterior of each sensor to have a set of effects, {set: (n,)}, and to be odd, (n,)."""
        of_sets, odd = dict[Names, Array](), np.zeros(len(self._anything))
        for one, p in self._probable:
            *each, odd_in_set = p * one.sensors
            odd += odd_in_set
            for subset, mass in zip(subsets_of(one.names), each, strict=True):
                of_sets[subset] = of_sets.get(subset, 0.0) + mass
        return of_sets, odd

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
        together = self.pairs.get(subset, np.float64(-np.inf))
        return np.where(np.isneginf(together), weaker, together)

    def _weigh(self, names: Names, prior: float) -> EffectSet:
        """Weigh a set of effects by the ways in which sizes may differ.

        Of a sensor that is not usual, whose noise may be another one as well, sizes of the type say
        no more than it says by itself. What few sensors have, has no sizes of a type.
        """
        own = np.array([self._of_own_sizes(subset) for subset in subsets_of(names)])
        types = [] if self.sizes is None else self.sizes.of_set(names)
        if types and min(most_likely(types).shares.values()) * own.shape[1] <= self.few:
            types = []
        ways = [(prior * (1 - PRIOR_ALIKE) if types else prior, 0.0, own)]
        for one in types:
            assert self.sizes is not None
            odds = np.where(self.sizes.usual, one.odds, np.minimum(one.odds, own))
            ways.append((prior * PRIOR_ALIKE / len(types), one.cost, odds))
        shares, of_ways = shares_of(len(names)), list[Array]()
        each = np.array([np.vstack([odds, self._anything]) for *_, odds in ways])
        for (weight, cost, _), odds in zip(ways, each, strict=True):
            of_sensors = np.logaddexp.reduce(odds[..., None] + shares.log_priors)
            of_ways.append(np.log(weight) + cost + of_sensors.sum(axis=0) + shares.log_weights)
        logs = np.array(of_ways)
        same = self.common.get(names[0]) if len(names) == 1 else None
        if same is not None:
            # Which of the sensors have it, is not asked then.
            alone = special.logsumexp(logs) - np.log(prior)
            logs = logs + special.logsumexp([0.0, same - alone], b=[1 - PRIOR_ALIKE, PRIOR_ALIKE])
        return EffectSet(names, each, logs)
