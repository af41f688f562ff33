"""The mixture of a lot: which effect its model lacks, how many sensors have it, and which.

Each sensor has the effect k that the model of the lot lacks with the probability ρ, its share: 1 in
every second lot a priori, and uniform in the others. So the effect has the evidence

    B_k = Σ_τ w_τ ∫ Π_i [(1 − ε) (1 − ρ + ρ r_i) + ε r̄_i] dρ,

with r_i the odds of the campaign of sensor i for the effect against nothing, and r̄_i their mean
over all that could be missing: a sensor may be odd, and then have something of its own.

As probable as that each sensor has a size of its own, of which its campaign has the odds, is a
priori that a type has sizes, about which those of its sensors scatter by some τ (`sizes`). Of two
effects that the model lacks the stronger one is found first, and the other one beside it, once it
is in the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import special

from accelstudy.basics.arrays import Array
from accelstudy.lots.sizes import TypicalSize

PRIOR_ODD = 0.01
"""Prior probability that a sensor is odd."""
PRIOR_MISSING = 0.5
"""Prior probability that the model of the lot lacks anything."""
PRIOR_ALL = 0.5
"""Prior probability that all sensors have an effect of the lot."""
PRIOR_ALIKE = 0.5
"""Prior probability that sizes are those of a type, with any scatter; else each has its own."""
STEPS = 200
"""Shares below 1 that are tried."""
SHARES = np.append((np.arange(STEPS) + 0.5) / STEPS, 1.0)
"""Shares that are tried, (q,)."""
PRIOR_SHARES = np.append(np.full(STEPS, (1 - PRIOR_ALL) / STEPS), PRIOR_ALL)


class LotEvidence(NamedTuple):
    """What the sensors tell of an effect if the model of the lot lacks it, and nothing else.

    Attributes
    ----------
    log_weight : float, log of evidence times prior
    shares : (q,) array, posterior of its share
    having : (n,) array, posterior of each sensor to have it
    odd : (n,) array, posterior of each sensor to be odd
    """

    log_weight: float
    shares: Array
    having: Array
    odd: Array


@dataclass(frozen=True, eq=False)
class Mixture:
    """The posterior of a lot.

    Attributes
    ----------
    prior : mapping of each effect to its prior probability; these sum to 1
    own : mapping of each effect to (n,) array, log odds of the sensors for sizes of their own
    typical : mapping of effects to their most probable sizes in the type, by scatter
    """

    prior: Mapping[str, float]
    own: Mapping[str, Array]
    typical: Mapping[str, Sequence[TypicalSize]] = field(default_factory=dict)

    @cached_property
    def odd(self) -> Array:
        """Log odds of each sensor to be odd, (n,), by the mean of all that could be missing."""
        weighed = [self.own[name] + np.log(p) for name, p in self.prior.items()]
        return np.asarray(np.log(PRIOR_ODD) + special.logsumexp(weighed, axis=0))

    @cached_property
    def nothing(self) -> LotEvidence:
        """What the sensors tell if the model of the lot lacks nothing."""
        each = np.logaddexp(np.log1p(-PRIOR_ODD), self.odd)
        log_weight = float(np.log(1 - PRIOR_MISSING) + each.sum())
        return LotEvidence(log_weight, PRIOR_SHARES, np.zeros(len(each)), np.exp(self.odd - each))

    @cached_property
    def effects(self) -> dict[str, LotEvidence]:
        """What the sensors tell of each effect, the most probable one first."""
        each = {name: self._weigh(name) for name in self.prior}
        return dict(sorted(each.items(), key=lambda item: -item[1].log_weight))

    def _weigh(self, name: str) -> LotEvidence:
        """Weigh an effect by the ways in which its sizes may differ, and by its shares."""
        typical = self.typical.get(name, ())
        ways = [(1 - PRIOR_ALIKE if typical else 1.0, 0.0, self.own[name])]
        ways += [(PRIOR_ALIKE / len(typical), one.cost, one.odds) for one in typical]
        with np.errstate(divide="ignore"):
            lacking, having = np.log1p(-PRIOR_ODD) + np.log([1 - SHARES, SHARES])[..., None]
        logs, sensors = list[Array](), list[tuple[Array, Array]]()
        for prior, cost, odds in ways:
            total = np.logaddexp(np.logaddexp(lacking, having + odds), self.odd)  # (q, n)
            logs.append(np.log(prior * PRIOR_SHARES) + cost + total.sum(axis=1))
            sensors.append((np.exp(having + odds - total), np.exp(self.odd - total)))
        posterior = special.softmax(logs)  # (w, q)
        log_weight = float(np.log(PRIOR_MISSING * self.prior[name]) + special.logsumexp(logs))
        has, odd = np.einsum("wq,waqn->an", posterior, np.array(sensors))
        return LotEvidence(log_weight, posterior.sum(axis=0), has, odd)

    @cached_property
    def posterior(self) -> dict[str, float]:
        """Posterior of each effect, the most probable one first; with nothing they sum to 1."""
        logs = [self.nothing.log_weight, *(one.log_weight for one in self.effects.values())]
        return dict(zip(self.effects, special.softmax(logs)[1:].tolist(), strict=True))

    @cached_property
    def wrong(self) -> float:
        """Posterior that the model lacks anything, or that a sensor is odd."""
        right = (1 - sum(self.posterior.values())) * np.prod(1 - self.nothing.odd)
        return max(float(1 - right), 1e-300)

    def share(self, name: str) -> tuple[float, float, float]:
        """Share of the sensors that have an effect: mean, and the interval that holds 95 %."""
        density = self.effects[name].shares
        low, high = SHARES[np.minimum(np.searchsorted(np.cumsum(density), [0.025, 0.975]), STEPS)]
        return float(SHARES @ density), float(low), float(high)

    def own_size(self, name: str) -> Array:
        """Posterior of each sensor to be odd by the size of an effect that the lot has, (n,)."""
        by_it = np.log(PRIOR_ODD * self.prior[name]) + self.own[name] - self.odd
        return np.asarray(self.effects[name].odd * np.exp(by_it))

    @cached_property
    def sensors(self) -> Array:
        """Posterior of each sensor to have each effect, the most probable first, and to be odd.

        It has the shape (K + 1, n).
        """
        posterior = np.array([*self.posterior.values()])
        each = [*self.effects.values()]
        has = posterior[:, None] * np.array([one.having for one in each])
        odd = posterior @ np.array([one.odd for one in each])
        return np.vstack([has, odd + (1 - posterior.sum()) * self.nothing.odd])
