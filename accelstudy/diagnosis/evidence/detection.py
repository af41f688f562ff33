"""Whether anything is missing: the total evidence for it, beside what noise alone would show.

The statistic is the log odds that a candidate is missing rather than nothing,

    S = log Σ_k π_k m_k(z) − log m_0(z),

over all candidates, shapes, sizes and levels of the noise. Simulations of the same fit show how
large it becomes by chance. Half of the simulated residuals carry a random effect and are weighted
back to noise (importance sampling), so that few simulations give small probabilities. Beyond the
simulated values the bound P(S ≥ s) ≤ exp(−s) is used: in noise alone exp(S) has the mean 1.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.progress import track
from accelstudy.diagnosis.evidence.candidates import Field
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Shapes, log_sum
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]


AT_ONCE = 500_000
"""Numbers that are drawn at once; all sets of very many positions would not fit in memory."""


PRIORS = 1
"""Stream of the rows of priors, apart from all others of the same seed."""
PROPOSED = np.array([12.0, 25.0, 50.0])
"""Noncentralities of the simulated effects: where tests at the usual levels decide."""


@dataclass(frozen=True)
class Chance:
    """Simulated residuals without any effect: white noise of unit weight less what a fit absorbs.

    The same numbers are drawn again whenever they are needed.

    Parameters
    ----------
    seed : SeedSequence
    conditions : int, of the positions in the fit with the most; a prior of parameters adds some
    simulations : int
    """

    seed: np.random.SeedSequence
    conditions: int
    simulations: int = RULES.simulations

    def noise(self) -> Iterator[Array]:
        """Draw white noise of unit weight, (b, conditions) each."""
        rng = np.random.default_rng(self.seed)
        for count in self.counts:
            yield rng.standard_normal((count, self.conditions))

    @property
    def counts(self) -> list[int]:
        """How many sets are drawn at once."""
        size = max(1, AT_ONCE // self.conditions)
        return [min(size, self.simulations - k) for k in range(0, self.simulations, size)]

    def errors(self, residuals: Residuals) -> Iterator[Array]:
        """Yield residuals of a fit, (b, m) each, all simulations one after the other."""
        m = len(residuals.design)
        key = (*self.seed.spawn_key, PRIORS)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))
        for drawn in track(self.noise(), "null simulation", len(self.counts)):
            noise = drawn[:, :m]
            more = m - noise.shape[1]
            if more:
                # From a stream of their own: the draws of the positions stay what they are.
                noise = np.concatenate([noise, rng.standard_normal((len(noise), more))], axis=1)
            yield noise - (noise @ residuals.absorbed) @ residuals.absorbed.T

    def errors_with_effects(self, residuals: Residuals, field: Field) -> Iterator[Array]:
        """Yield residuals without an effect and as many with a random one."""
        key = (*self.seed.spawn_key, 0)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))
        for errors in self.errors(residuals):
            half = len(errors) // 2 or 1
            yield errors[:half]
            changed = errors[-half:] + draw_effects(field.named_shapes, errors.shape[1], half, rng)
            yield changed - (changed @ residuals.absorbed) @ residuals.absorbed.T

    def statistic(self, residuals: Residuals, function: Callable[[Array], Array]) -> Array:
        """Return a statistic of all simulated residuals (b, m); its first axis is the set."""
        return np.concatenate([function(errors) for errors in self.errors(residuals)])


@dataclass(frozen=True)
class Detection:
    """Outcome of the test for anything that is missing.

    Attributes
    ----------
    statistic : float, S
    p_value : float, probability of a larger one by noise alone
    densities : dict of candidate to log density of the residuals
    noise : (c,) array, log density of the residuals in noise alone, by the components of the level
    p_family : dict of candidate to its p-value as the strongest of all
    by_chance, weights : (s,) arrays, S of simulated residuals, and their weights as noise alone
    """

    statistic: float
    p_value: float
    densities: Mapping[str, float]
    noise: Array
    p_family: Mapping[str, float]
    by_chance: Array
    weights: Array

    def threshold(self, level: float) -> float:
        """Value of S that noise alone exceeds with the probability `level`."""
        order = np.argsort(-self.by_chance)
        rate = np.cumsum(self.weights[order]) / len(self.by_chance)
        place = min(int(np.searchsorted(rate, level)), len(order) - 1)
        return float(self.by_chance[order[place]])


def detect(field: Field, evidence: Evidence, residuals: Residuals, chance: Chance) -> Detection:
    """Test whether anything is missing.

    Parameters
    ----------
    field : Field, candidates
    evidence : Evidence
    residuals : Residuals
    chance : Chance
    """
    if not field.names:
        noise = evidence.noise_density(residuals.z @ residuals.z)
        return Detection(0.0, 1.0, {}, noise, {}, np.zeros(0), np.zeros(0))
    seen, k = field.project(residuals.z), len(field.names)
    densities, noise = field.densities(evidence, seen), evidence.noise_density(seen.squares)
    nothing = np.logaddexp.reduce(noise)
    odds: list[Array] = []
    weights: list[Array] = []
    for errors in chance.errors_with_effects(residuals, field):
        drawn = field.project(errors)
        odds.append(field.odds(evidence, drawn))
        ratio = np.exp(np.minimum(log_ratio(field.named_shapes, drawn.parts), 700.0))
        weights.append(1 / (0.5 + 0.5 * ratio))
    each, w = np.concatenate(odds), np.concatenate(weights)
    total = total_odds(each)
    statistic = float(np.logaddexp.reduce(densities) - np.log(k) - nothing)
    strongest = each.max(axis=1)
    observed = densities - nothing
    return Detection(
        statistic=statistic,
        p_value=tail_probability(total, w, statistic),
        densities=dict(zip(field.names, densities.tolist(), strict=True)),
        noise=noise,
        p_family={
            n: tail_probability(strongest, w, observed[i], k) for i, n in enumerate(field.names)
        },
        by_chance=total,
        weights=w,
    )


def total_odds(each: Array) -> Array:
    """S, (b,), of the log odds of each candidate, (b, K): that any one of them is missing."""
    return log_mean(each)


def tail_probability(values: Array, weights: Array, value: float, count: int = 1) -> float:
    """Probability that log odds, or the largest of `count` of them, reach a value by chance."""
    beyond = values >= value
    bound = float(count * np.exp(min(-value, 0.0)))
    if np.count_nonzero(beyond) >= RULES.enough:
        return float(min(np.sum(weights[beyond]) / len(weights), 1.0))
    least = np.sum(weights[values >= np.sort(values)[-RULES.enough]]) / len(weights)
    return float(min(least, bound, 1.0))


# --- simulated effects --------------------------------------------------------------------------


def draw_effects(
    candidates: Sequence[Shapes], conditions: int, count: int, rng: np.random.Generator
) -> Array:
    """Draw what a random candidate adds to so many conditions, (count, conditions).

    Its shape is any of its shapes, and its size one of `PROPOSED`.
    """
    ends = np.cumsum([0, *(len(one.dims) for one in candidates)])
    probable = np.concatenate([one.prior for one in candidates]) / len(candidates)
    drawn = rng.choice(ends[-1], size=count, p=probable)
    sizes = rng.choice(PROPOSED, size=count)
    candidate = np.searchsorted(ends, drawn, side="right") - 1
    dims = np.concatenate([one.dims for one in candidates])[drawn]
    normal = np.split(rng.standard_normal(dims.sum()), np.cumsum(dims)[:-1])
    added = np.zeros((count, conditions))
    for k in np.unique(candidate):
        rows, shapes = np.flatnonzero(candidate == k), candidates[k]
        places = drawn[rows] - ends[k]
        shares = np.concatenate([shapes.shares[place] for place in places])
        variances = np.repeat(sizes[rows], dims[rows]) * shares
        amounts = np.concatenate([normal[row] for row in rows]) * np.sqrt(variances)
        added[rows] = shapes.combine(places, amounts)
    return added


def log_ratio(candidates: Sequence[Shapes], parts: Sequence[Array]) -> Array:
    """Log ratio of the densities of residuals with such an effect and of noise alone, (b,).

    Parameters
    ----------
    candidates : Shapes
    parts : arrays (b, p), of residuals, by candidate
    """
    logs = []
    for size in PROPOSED.tolist():
        of_size = []
        for shapes, seen in zip(candidates, parts, strict=False):
            taken, growth = shapes.gain_and_growth(seen, size)
            of_size.append((taken - growth) / 2 + np.log(shapes.prior / len(candidates)))
        logs.append(log_sum(np.concatenate(of_size, axis=-1)))
    return log_mean(np.stack(logs, axis=-1))
