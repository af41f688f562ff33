"""Whether anything is missing: the total evidence for it, beside what noise alone would show.

The statistic is the log odds that a candidate is missing rather than nothing,

    S = log Σ_k π_k m_k(z) − log m_0(z),

over all candidates, shapes, sizes and levels of the noise. Simulations of the same fit show how
large it becomes by chance. Half of the simulated residuals carry a random effect and are weighted
back to noise (importance sampling), so that few simulations give small probabilities. Beyond the
simulated values the bound P(S ≥ s) ≤ exp(−s) is used: in noise alone exp(S) has the mean 1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.evidence.field import Field
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

ENOUGH = 10
"""Simulated values beyond the observed one that are enough to take their share as its p-value."""


@dataclass(frozen=True)
class Simulated:
    """A statistic of noise alone: values (s, ...) of simulated residuals, with weights (s,)."""

    values: Array
    weights: Array

    def beyond(self, level: float) -> float:
        """Value that noise alone exceeds with the probability `level`."""
        order = np.argsort(-self.values)
        rate = np.cumsum(self.weights[order]) / len(self.values)
        place = min(int(np.searchsorted(rate, level)), len(order) - 1)
        return float(self.values[order[place]])


@dataclass(frozen=True)
class Detection:
    """Outcome of the test for anything that is missing.

    Attributes
    ----------
    statistic : float, S
    p_value : float, probability of a larger one by noise alone
    densities : dict of candidate to log density of the residuals
    noise : (c,) array, log density of the residuals in noise alone, by the components of the level
    p_candidate : dict of candidate to its p-value alone, over its shapes
    p_family : dict of candidate to its p-value as the strongest of all
    by_chance : Simulated, S of simulated residuals
    """

    statistic: float
    p_value: float
    densities: Mapping[str, float]
    noise: Array
    p_candidate: Mapping[str, float]
    p_family: Mapping[str, float]
    by_chance: Simulated


def detect(field: Field, evidence: Evidence, residuals: Residuals, chance: Chance) -> Detection:
    """Test whether anything is missing.

    Parameters
    ----------
    field : Field, candidates
    evidence : Evidence
    residuals : Residuals
    chance : Chance
    """
    z = residuals.z
    if not field.names:
        nobody: Array = np.zeros(0)
        return Detection(0.0, 1.0, {}, evidence.of_noise(z @ z), {}, {}, Simulated(nobody, nobody))
    densities = field.densities(evidence, z)
    noise = evidence.of_noise(z @ z)
    nothing = np.logaddexp.reduce(noise)
    k = len(field.names)
    odds: list[Array] = []
    weights: list[Array] = []
    for errors in chance.errors_with_effects(residuals, field):
        parts, squares = field.parts(errors), np.sum(errors**2, axis=-1)
        odds.append(field.odds(evidence, parts, squares))
        weights.append(1 / (0.5 + 0.5 * np.exp(np.minimum(field.proposal(parts), 700.0))))
    each, w = np.concatenate(odds), np.concatenate(weights)
    total = total_odds(each)
    statistic = float(np.logaddexp.reduce(densities) - np.log(k) - nothing)
    strongest = each.max(axis=1)
    own = densities - nothing
    return Detection(
        statistic=statistic,
        p_value=tail(total, w, statistic),
        densities=dict(zip(field.names, densities.tolist(), strict=True)),
        noise=noise,
        p_candidate={n: tail(each[:, i], w, own[i]) for i, n in enumerate(field.names)},
        p_family={n: tail(strongest, w, own[i], k) for i, n in enumerate(field.names)},
        by_chance=Simulated(total, w),
    )


def total_odds(each: Array) -> Array:
    """S, (b,), of the log odds of each candidate, (b, K): that any one of them is missing."""
    return log_mean(each)


def tail(values: Array, weights: Array, value: float, count: int = 1) -> float:
    """Probability that log odds, or the largest of `count` of them, reach a value by chance."""
    beyond = values >= value
    bound = float(count * np.exp(min(-value, 0.0)))
    if np.count_nonzero(beyond) >= ENOUGH:
        return float(min(np.sum(weights[beyond]) / len(weights), 1.0))
    least = np.sum(weights[values >= np.sort(values)[-ENOUGH]]) / len(weights)
    return float(min(least, bound, 1.0))
