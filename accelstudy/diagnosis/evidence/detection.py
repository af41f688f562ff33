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

from accelstudy.diagnosis.evidence.candidates import Field
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Shapes, log_sum
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

EFFECTS, PRIORS = 0, 1
"""Streams of the random effects and of the rows of priors, apart from that of the noise."""
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

    def stream(self, key: int) -> np.random.Generator:
        """Stream of further draws, which changes no others."""
        key_of_all = (*self.seed.spawn_key, key)
        return np.random.default_rng(
            np.random.SeedSequence(self.seed.entropy, spawn_key=key_of_all)
        )

    def errors(self, residuals: Residuals) -> Array:
        """Draw residuals of a fit, (b, m)."""
        m, rng = len(residuals.design), np.random.default_rng(self.seed)
        noise = rng.standard_normal((self.simulations, self.conditions))[:, :m]
        more = self.stream(PRIORS).standard_normal((len(noise), m - noise.shape[1]))
        noise = np.concatenate([noise, more], axis=1)
        return noise - (noise @ residuals.absorbed) @ residuals.absorbed.T

    def errors_with_effects(self, residuals: Residuals, shapes: Shapes) -> Array:
        """Draw residuals, (b, m), the second half of them with a random effect."""
        errors = self.errors(residuals)
        half = len(errors) // 2
        changed = errors[half:] + draw_effects(shapes, len(errors) - half, self.stream(EFFECTS))
        changed -= (changed @ residuals.absorbed) @ residuals.absorbed.T
        return np.concatenate([errors[:half], changed])


@dataclass(frozen=True)
class Detection:
    """Outcome of the test for anything that is missing.

    Attributes
    ----------
    p_value : float, probability of as much total evidence by noise alone
    densities : dict of candidate to log density of the residuals
    noise : (c,) array, log density of the residuals in noise alone, by the components of the level
    by_chance, weights : (s,) arrays, S of simulated residuals, and their weights as noise alone
    """

    p_value: float
    densities: Mapping[str, float]
    noise: Array
    by_chance: Array
    weights: Array

    def threshold(self, level: float) -> float:
        """Value of S that noise alone exceeds with the probability `level`."""
        order = np.argsort(-self.by_chance)
        rate = np.cumsum(self.weights[order]) / len(self.by_chance)
        place = min(int(np.searchsorted(rate, level)), len(order) - 1)
        return float(self.by_chance[order[place]])


def detect(field: Field, evidence: Evidence, residuals: Residuals, chance: Chance) -> Detection:
    """Test whether anything is missing."""
    if not field.candidates:
        noise = evidence.noise_density(residuals.z @ residuals.z)
        return Detection(1.0, {}, noise, np.zeros(0), np.zeros(0))
    seen = field.project(residuals.z)
    densities, noise = field.densities(evidence, seen), evidence.noise_density(seen.squares)
    observed = densities - np.logaddexp.reduce(noise)
    drawn = field.project(chance.errors_with_effects(residuals, field.spaces))
    each = field.odds(evidence, drawn)
    ratio = np.exp(np.minimum(log_ratio(field.spaces, drawn.parts), 700.0))
    weights = 1 / (0.5 + 0.5 * ratio)
    by_chance = log_mean(each)
    return Detection(
        p_value=tail_probability(by_chance, weights, float(log_mean(observed))),
        densities=dict(zip(field.names, densities.tolist(), strict=True)),
        noise=noise,
        by_chance=by_chance,
        weights=weights,
    )


def tail_probability(values: Array, weights: Array, value: float) -> float:
    """Probability that log odds reach a value by chance."""
    beyond, bound = values >= value, float(np.exp(min(-value, 0.0)))
    if np.count_nonzero(beyond) >= RULES.enough:
        return float(min(np.sum(weights[beyond]) / len(weights), 1.0))
    least = np.sum(weights[values >= np.sort(values)[-RULES.enough]]) / len(weights)
    return float(min(least, bound, 1.0))


# --- simulated effects --------------------------------------------------------------------------


def draw_effects(shapes: Shapes, count: int, rng: np.random.Generator) -> Array:
    """Draw what a random shape, of one of the sizes `PROPOSED`, adds to residuals, (count, m)."""
    places = rng.choice(len(shapes.prior), size=count, p=shapes.prior)
    sizes = rng.choice(PROPOSED, size=count)
    dims = shapes.dims[places]
    variances = np.repeat(sizes, dims) * np.concatenate([shapes.shares[i] for i in places])
    return shapes.combine(places, rng.standard_normal(dims.sum()) * np.sqrt(variances))


def log_ratio(shapes: Shapes, parts: Array) -> Array:
    """Log ratio of the densities of residuals with such an effect and of noise alone, (b,).

    Parameters
    ----------
    shapes : Shapes
    parts : (b, p) array, of residuals
    """
    logs = []
    for size in PROPOSED.tolist():
        taken, growth = shapes.gain_and_growth(parts, size)
        logs.append(log_sum((taken - growth) / 2 + np.log(shapes.prior)))
    return log_mean(np.stack(logs, axis=-1))
