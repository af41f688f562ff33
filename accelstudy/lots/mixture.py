"""The mixture of a lot: which effects its model lacks, how many sensors have them, and which.

Each sensor has an effect k of the lot, which the model lacks, with the probability ρ_k, its share:
1 in every second lot a priori, and uniform in the others. It has effects independently of each
other. A set Z of effects of the lot has the evidence

    B_Z = ∫ Π_i [(1 − ε) Σ_{s ⊆ Z} Π_{k ∈ s} ρ_k Π_{k ∈ Z∖s} (1 − ρ_k) r_i(s) + ε r̄_i] dρ,

with r_i(s) the odds of the campaign of sensor i for the set s against nothing, and r̄_i their mean
over all that could be missing: a sensor may be odd, and then have something of its own. Sets have
up to three effects, and a sensor has up to two of them.

These r_i take the sizes of the sensors for independent. As probable a priori is that a type has
sizes, about which those of its sensors scatter more or less: then the r_i are the odds for sizes of
the type (`sizes`). Of effects whose sizes are not looked at, one size in all sensors has the
evidence of all campaigns as one.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, partial
from itertools import combinations
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.lots.sizes import Names, TypicalSet

Array = NDArray[np.float64]
OddsOf: TypeAlias = Callable[[Names], Array]
"""Log odds of the sensors for some effects together."""

PRIOR_ODD = 0.01
"""Prior probability that a sensor is odd."""
PRIOR_MISSING = 0.5
"""Prior probability that the model of the lot lacks anything."""
PRIOR_ALL = 0.5
"""Prior probability that all sensors have an effect of the lot."""
PRIOR_ALIKE = 0.5
"""Prior probability that sizes are those of a type, with any scatter; else each has its own."""
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


@dataclass(frozen=True, eq=False)
class Mixture:
    """The posterior of a lot.

    Attributes
    ----------
    odds : mapping of each effect to (n,) array, log odds of the sensors against nothing
    pairs : mapping of two effects to (n,) array, log odds of both together
    prior : mapping of each effect to its prior probability; these sum to 1
    common : mapping of effects to the log odds that they are the same in all sensors
    typical : mapping of one or two effects to odds with sizes of the type, for each scatter
    """

    odds: Mapping[str, Array]
    pairs: Mapping[Names, Array]
    prior: Mapping[str, float]
    common: Mapping[Names, float] = field(default_factory=dict)
    typical: Mapping[Names, Sequence[TypicalSet]] = field(default_factory=dict)
    _known: dict[Names, list[tuple[Array, OddsOf]]] = field(default_factory=dict, init=False)

    @cached_property
    def sets(self) -> dict[Names, float]:
        """Sets of effects of the lot with log of evidence times prior weight, strongest first."""
        found: dict[Names, float] = {(): np.log(1 - PRIOR_MISSING) + self._evidence(())}
        for name, prior in self.prior.items():
            weight = np.log(PRIOR_MISSING * (1 - PRIOR_FURTHER)) + np.log(prior)
            found[name,] = weight + self._evidence((name,))
        singles = sorted(self.prior, key=lambda name: -found[name,])[:MAX_SINGLES]
        strongest: list[Names] = [(name,) for name in singles]
        for size in (2, 3):
            tried = {_with(s, name) for s in strongest for name in singles if name not in s}
            if size == 2:
                # What is small beside the strongest one may be nothing by itself.
                first = strongest[:MAX_EXTENDED]
                tried |= {_with(s, name) for s in first for name in self.prior if name not in s}
            weight = PRIOR_MISSING * PRIOR_FURTHER ** (size - 1)
            for names in sorted(tried):
                each = np.log(special.comb(len(self.prior), size))
                found[names] = np.log(weight) - each + self._evidence(names)
            strongest = sorted(tried, key=lambda s: -found[s])[:MAX_EXTENDED]
        return dict(sorted(found.items(), key=lambda item: -item[1]))

    @cached_property
    def posterior(self) -> dict[Names, float]:
        """Posterior of each of `sets`."""
        return dict(zip(self.sets, special.softmax([*self.sets.values()]).tolist(), strict=True))

    def of_any(self, effects: Collection[str]) -> float:
        """Posterior probability that any of some effects is one of the lot."""
        return sum(p for names, p in self.posterior.items() if {*names} & {*effects})

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
        for shares, (_, odds_of) in zip(self._shares(names), self._ways(names), strict=True):
            weights, each = np.ravel(shares), []
            for logs in self._contributions(names, odds_of):
                of_each = np.exp(logs - np.logaddexp.reduce(logs))
                each.append(of_each.reshape(*logs.shape[:2], -1) @ weights)
            table += np.concatenate(each, axis=1)
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
        if subset in self.pairs:
            return self.pairs[subset]
        # Two that were not weighed together say no more than the weaker one.
        return np.asarray(np.min([self.odds[name] for name in subset], axis=0))

    def _of_type(self, one: TypicalSet, subset: Names) -> Array:
        """Log odds of the sensors with sizes of a type, (n,).

        A sensor that is not usual, whose noise may be another one as well, says no more than by
        itself.
        """
        odds = one.odds[subset]
        return np.where(one.usual, odds, np.minimum(odds, self._of_own_sizes(subset)))

    def _contributions(self, names: Names, odds_of: OddsOf) -> Iterator[Array]:
        """Log of what each of `_subsets`, and oddness, contributes: (s + 1, b, nodes ...) arrays.

        Each is of b sensors.
        """
        nodes, size = _nodes(len(names))[0], len(names)
        shares = dict(zip(names, np.meshgrid(*[nodes] * size, indexing="ij"), strict=True))
        priors = [
            sum(
                (np.log(rho) if name in subset else _log_of_rest(rho)
                 for name, rho in shares.items()),
                np.full((len(nodes),) * size, np.log(1 - PRIOR_ODD)),
            )
            for subset in _subsets(names)
        ]  # fmt: skip
        prior = np.array([*priors, np.full_like(priors[0], np.log(PRIOR_ODD))])[:, None]
        odds = np.array([*map(odds_of, _subsets(names)), self._anything])
        for first in range(0, odds.shape[1], BLOCK):
            some = odds[:, first : first + BLOCK]
            yield some.reshape(*some.shape, *[1] * size) + prior

    def _log_likelihood(self, names: Names, odds_of: OddsOf) -> Array:
        """Log likelihood of shares times their prior weights, (nodes ...)."""
        each = self._contributions(names, odds_of)
        logs = sum(np.logaddexp.reduce(logs).sum(axis=0) for logs in each)
        return np.asarray(logs + _log_weights(len(names)))

    def _evidence(self, names: Names) -> float:
        """Log evidence of effects, whatever their sizes."""
        return float(special.logsumexp([logs for logs, _ in self._ways(names)]))

    def _ways(self, names: Names) -> list[tuple[Array, OddsOf]]:
        """Log evidence by the ways in which sizes differ, (nodes ...) of shares, and odds then."""
        if names in self._known:
            return self._known[names]
        own, types = self._of_own_sizes, self.typical.get(names, ())
        logs = self._log_likelihood(names, own)
        if types:
            logs = logs + np.log(1 - PRIOR_ALIKE)
        elif names in self.common:
            # Which of the sensors have it, is not asked then.
            alone, alike = special.logsumexp(logs), self.common[names]
            both = np.logaddexp(np.log(1 - PRIOR_ALIKE) + alone, np.log(PRIOR_ALIKE) + alike)
            logs = logs + both - alone
        ways: list[tuple[Array, OddsOf]] = [(logs, own)]
        for one in types:
            odds = partial(self._of_type, one)
            prior = np.log(PRIOR_ALIKE / len(types)) + one.cost
            ways.append((prior + self._log_likelihood(names, odds), odds))
        self._known[names] = ways
        return ways

    def _shares(self, names: Names) -> Array:
        """Posterior of each way in which sizes differ and of the shares, (w, nodes ...)."""
        return np.asarray(special.softmax([logs for logs, _ in self._ways(names)]))


def _with(names: Names, name: str) -> Names:
    """Set with one effect more."""
    return tuple(sorted([*names, name]))


def _subsets(names: Names) -> list[Names]:
    """Subsets of some effects that a sensor may have: up to two effects."""
    return [s for r in range(min(len(names), 2) + 1) for s in combinations(names, r)]


@cache
def _nodes(size: int) -> tuple[Array, Array]:
    """Nodes and weights of the integral over a share, if there are `size` of them."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES[size]) if size else np.zeros((2, 0))
    return np.append((nodes + 1) / 2, 1.0), np.append((1 - PRIOR_ALL) * weights / 2, PRIOR_ALL)


def _log_of_rest(share: Array) -> Array:
    """Logarithm of 1 − share; −inf where the share is 1."""
    with np.errstate(divide="ignore"):
        return np.log1p(-share)


@cache
def _log_weights(size: int) -> Array:
    """Log of prior weights of the nodes of all shares, (nodes ...)."""
    weights = np.ones(())
    for _ in range(size):
        weights = np.multiply.outer(weights, _nodes(size)[1])
    return np.asarray(np.log(weights))


class LotTest:
    """The test whether anything is missing in a lot, to which sensors are added one by one.

    The statistic is the evidence that a share of the sensors has one effect. Lots of
    simulated noise say how large it is if nothing is missing.

    Attributes
    ----------
    logs : dict of what is tested to (1 + s, nodes) array, log likelihood of each share in the lot,
        and in s lots of noise
    """

    def __init__(self, logs: Mapping[str, Array]) -> None:
        self.logs = dict(logs)

    def add(self, sensor: Mapping[str, NDArray[np.float32]], sign: float = 1.0) -> None:
        """Add what a sensor says; or take it away."""
        nodes, _ = _nodes(2)
        for name, odds in sensor.items():
            log = np.logaddexp(_log_of_rest(nodes), odds[:, None] + np.log(nodes))
            self.logs[name] = self.logs.get(name, 0.0) + sign * log

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
