"""Whether anything is missing: the total evidence for it, beside what noise alone would show.

The statistic is the log odds that a candidate is missing rather than nothing,

    S = log Σ_k π_k m_k(z) − log m_0(z),

over all candidates, shapes, sizes and levels of the noise. Simulations of the same fit show how
large it becomes by chance. Half of the simulated residuals carry a random effect and are weighted
back to noise (importance sampling), so that few simulations give small probabilities. Beyond the
simulated values the bound P(S ≥ s) ≤ exp(−s) is used: in noise alone exp(S) has the mean 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.evidence.candidates import Field
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import Spaces
from accelstudy.diagnosis.space.residuals import Residuals

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

    def errors_with_effects(self, residuals: Residuals, spaces: Spaces) -> Array:
        """Draw residuals, (b, m), the second half of them with a random effect."""
        errors = self.errors(residuals)
        half = len(errors) // 2
        changed = errors[half:] + draw_effects(spaces, len(errors) - half, self.stream(EFFECTS))
        changed -= (changed @ residuals.absorbed) @ residuals.absorbed.T
        return np.concatenate([errors[:half], changed])


def detect(field: Field, evidence: Evidence, residuals: Residuals, chance: Chance) -> float:
    """Probability that noise alone shows as much total evidence that anything is missing."""
    if not field.candidates:
        return 1.0
    nothing = np.logaddexp.reduce(evidence.noise_density(residuals.z @ residuals.z))
    observed = field.densities(evidence, residuals.z) - nothing
    null = null_distribution(field, evidence, residuals, chance)
    return tail_probability(*null, float(log_mean(observed)))


def null_distribution(
    field: Field, evidence: Evidence, residuals: Residuals, chance: Chance
) -> tuple[Array, Array]:
    """S of simulated residuals, (b,), and their weights as noise alone."""
    drawn = chance.errors_with_effects(residuals, field.spaces)
    ratio = np.exp(np.minimum(log_ratio(field.spaces, drawn), 700.0))
    return log_mean(field.odds(evidence, drawn)), 1 / (0.5 + 0.5 * ratio)


def tail_probability(values: Array, weights: Array, value: float) -> float:
    """Probability that log odds reach a value by chance."""
    beyond, bound = values >= value, float(np.exp(min(-value, 0.0)))
    if np.count_nonzero(beyond) >= RULES.enough:
        return float(min(np.sum(weights[beyond]) / len(weights), 1.0))
    least = np.sum(weights[values >= np.sort(values)[-RULES.enough]]) / len(weights)
    return float(min(least, bound, 1.0))


# --- simulated effects --------------------------------------------------------------------------


def draw_effects(spaces: Spaces, count: int, rng: np.random.Generator) -> Array:
    """Draw what a random space, of one of the sizes `PROPOSED`, adds to residuals, (count, m)."""
    chosen = rng.choice(len(spaces.prior), size=count, p=spaces.prior)
    sizes = rng.choice(PROPOSED, size=count)
    dims = spaces.dims[chosen]
    sigmas = np.sqrt(np.repeat(sizes / dims, dims))
    rows = np.repeat(np.arange(count), dims)
    first = np.repeat(spaces.ends[chosen] - (np.cumsum(dims) - dims), dims)
    columns = np.zeros((count, spaces.vectors.shape[1]))
    columns[rows, first + np.arange(len(rows))] = rng.standard_normal(dims.sum()) * sigmas
    return np.asarray(columns @ spaces.vectors.T)


def log_ratio(spaces: Spaces, errors: Array) -> Array:
    """Log ratio of the densities of residuals (b, m) with such an effect and without, (b,)."""
    parts, logs = spaces.parts(errors), []
    for size in PROPOSED.tolist():
        g = size / spaces.dims
        taken, growth = parts * (g / (1 + g)), spaces.dims * np.log1p(g)
        logs.append(log_mean((taken - growth) / 2, spaces.prior))
    return log_mean(np.stack(logs, axis=-1))
