"""Sizes of an effect in a type: the same in all of its sensors, or with a scatter about their mean.

Sensor i tells of the parameters β of an effect by N_i = AᵀA and b_i = Aᵀz, with its residuals z of
unit weight and their derivatives A. In a type the effect has sizes β ~ N(μ, S), S = τ² ‖μ‖²/k · I,
in a part ρ of the sensors, and 0 in the others. It explains of the squares ‖z‖² of a sensor

    q_i = 2 μᵀb_i − μᵀN_i μ + (b_i − N_i μ)ᵀ (S⁻¹ + N_i)⁻¹ (b_i − N_i μ),

so the odds of the sensor for the effect are r_i = |I + N_i S|^(−1/2) m(‖z‖² − q_i) / m(‖z‖²), with
the density m of noise of which its campaign knows the level more or less (`evidence.size`). That is
so for some τ, from 0 on, with the μ and ρ that make the likelihood of all sensors largest. A μ that
is fitted pays for that as any effect of unknown size does: with λ = μᵀ Σ (N_i⁻¹ + S)⁻¹ μ over the
sensors that have the effect, and g of its prior, the evidence is the likelihood times the mean of
(1 + g)^(−k/2) exp(−λ/(2 + 2 g)).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import NamedTuple

import numpy as np
from scipy import stats

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.evidence.size import (
    SIZE_WEIGHTS,
    SIZES,
    Evidence,
    Level,
    log_mean,
)
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import get_effect

SCATTERS = (0.0, 0.25, 1.0)
"""τ, scatter of the parameters of a type in parts of their size; beyond, each sensor has its own
size."""
FIRST_SHARES = (0.9, 0.35)
"""ρ from which the search begins: many sensors have the effect, or few."""
MAX_STEPS = 60
"""Most steps of the search for μ and ρ."""
LEAST_HAVING = 1e-12
"""Probability with which each sensor counts at least among those of the type."""
LIKELIHOOD_TOLERANCE = 1e-3
"""Change of the log likelihood below which the search ends."""


class ShownEffect(NamedTuple):
    """What sensors tell of the parameters of an effect, turned to those that they show.

    Attributes
    ----------
    spec : str, the effect in one of its shapes
    normal : (n, k, k) array, N of the sensors; 0 for one that says nothing
    right : (n, k) array, b
    pooled : (k,) array, its size if it is equally large in all
    part : float, how much they show of that, a χ² of k in noise alone
    """

    spec: str
    normal: Array
    right: Array
    pooled: Array
    part: float

    @property
    def p_value(self) -> float:
        """Probability that noise alone would show as much in common."""
        return float(stats.chi2.sf(self.part, len(self.pooled)))


class TypicalSize(NamedTuple):
    """Sizes of an effect that explain a lot best, with one scatter.

    Attributes
    ----------
    spec : str, the effect in its shape
    odds : (n,) array, log odds of the sensors for the effect
    log_likelihood : float, of sizes and share
    cost : float, log of evidence over likelihood: what fitting the sizes costs
    mean : (k,) array, μ
    share : float, ρ
    """

    spec: str
    odds: Array
    log_likelihood: float
    cost: float
    mean: Array
    share: float


@dataclass(frozen=True, eq=False)
class LotResiduals:
    """Residuals of the sensors of a lot, in which an effect may have sizes of their type.

    Attributes
    ----------
    frames : n calibrations of the sensors; None for one that says nothing
    levels : n Level, what is known of the noise of each
    """

    frames: Sequence[SessionFit | None]
    levels: Sequence[Level]

    @cached_property
    def squares(self) -> Array:
        """Sums of squares ‖z‖², (n,)."""
        return np.array([f.residuals.z @ f.residuals.z if f else 0.0 for f in self.frames])

    @cached_property
    def redundancy(self) -> Array:
        """Degrees of freedom r, (n,)."""
        return np.array([f.residuals.redundancy if f else 0 for f in self.frames])

    @cached_property
    def _evidence(self) -> dict[Evidence, list[int]]:
        """Sensors of equal redundancy of whose noise equally much is known, by their numbers."""
        alike: dict[Evidence, list[int]] = {}
        for i, known in enumerate(zip(self.levels, self.redundancy.tolist(), strict=True)):
            alike.setdefault(Evidence(*known), []).append(i)
        return alike

    def noise_density(self, squares: Array) -> tuple[Array, Array]:
        """Log density of noise with some sums of squares, and its mean inverse variance, (n,)."""
        density, precision = np.zeros((2, len(squares)))
        for evidence, some in self._evidence.items():
            each = evidence.noise_density(squares[some])
            density[some] = np.logaddexp.reduce(each, axis=1)
            nu = np.array(evidence.level.freedoms)
            inverse = (nu + evidence.redundancy) / (nu + squares[some, None])
            precision[some] = np.sum(np.exp(each - density[some, None]) * inverse, axis=1)
        return density, precision

    def shown(self, spec: str) -> ShownEffect:
        """Evaluate what an effect does in the campaigns of the sensors.

        What they show in common is a χ² whatever the noise: residuals are taken in units of what
        they are themselves, as noise has their directions at random.
        """
        n, k = len(self.frames), len(get_effect(spec).parameters)
        normal, right, total = np.zeros((n, k, k)), np.zeros((n, k)), np.zeros(k)
        for i, frame in enumerate(self.frames):
            with suppress(InputError):  # a column is absent
                if frame is not None:
                    rows = frame.rows(get_effect(spec))
                    a = frame.residuals.project(rows)
                    normal[i], right[i] = a.T @ a, frame.residuals.z @ a
                    total += np.sum(rows**2, axis=0)
        scale = np.sqrt(np.where(total > 0, total, 1.0))
        values, vectors = np.linalg.eigh(normal.sum(axis=0) / np.outer(scale, scale))
        seen = values > RULES.visible**2
        turn = vectors[:, seen] / scale[:, None] / np.sqrt(values[seen] / n)
        normal, right = turn.T @ normal @ turn, right @ turn
        weights = self.redundancy / np.where(self.squares > 0, self.squares, 1.0)
        size = _solved(np.einsum("n,nkl->kl", weights, normal), weights @ right)
        return ShownEffect(spec, normal, right, size, float(weights @ right @ size))

    @cached_property
    def p_values_of_pattern(self) -> list[float]:
        """P-value of what residuals have in common, one by one; none if the positions differ.

        It shows what no name explains, in sensors that were in the same positions and conditions;
        in other ones, it shows nothing. Residuals are taken as in `shown`.
        """
        each = [frame.residuals for frame in self.frames if frame]
        n, shapes = len(each), {one.z.shape for one in each}
        if n < 2 or len(shapes) > 1:
            return []
        r = each[0].redundancy
        mean = sum(one.z / np.sqrt(max(one.variance, 1e-300)) for one in each) / np.sqrt(n)
        shown = float(mean @ mean) / r
        return [float(stats.f.sf(shown * (n - 1) / max(n - shown, 1e-300), r, (n - 1) * r))]

    def typical(self, shapes: Sequence[ShownEffect], odd: Array) -> list[TypicalSize]:
        """Most probable sizes and share of an effect in its likeliest shape, for each scatter.

        Parameters
        ----------
        shapes : what sensors tell of the effect in each of its shapes
        odd : (n,) array, log odds of each sensor to be odd, whose sizes are not those of the type
        """
        none, likelihood = np.full_like(odd, -np.inf), attrgetter("log_likelihood")
        most = [
            # If sizes differ much, each sensor looks odd beside their mean.
            [self._search(effect, none, max(SCATTERS), x, effect.pooled / x) for x in FIRST_SHARES]
            for effect in shapes
        ]
        best = max(range(len(shapes)), key=lambda i: max(map(likelihood, most[i])))
        effect = shapes[best]
        starts = [(x, effect.pooled / x) for x in FIRST_SHARES]
        starts += [(one.share, one.mean) for one in most[best]]
        return [
            max((self._search(effect, odd, τ, *start) for start in starts), key=likelihood)
            for τ in SCATTERS
        ]

    def _search(
        self, effect: ShownEffect, odd: Array, scatter: float, share: float, mean: Array
    ) -> TypicalSize:
        """Search for sizes and share with a scatter, by expectation and maximization.

        Parameters
        ----------
        effect : what sensors tell of it in one of its shapes
        odd : as in `typical`
        scatter : float, τ
        share, mean : ρ and μ to begin with
        """
        normal, right, k = effect.normal, effect.right, effect.right.shape[1]
        nothing, before = self.noise_density(self.squares)[0], -np.inf
        for _ in range(MAX_STEPS):
            variance = scatter**2 * float(np.mean(mean**2))
            growth = np.eye(k) + variance * normal  # I + N S
            spread = variance * np.linalg.inv(growth)  # (S⁻¹ + N)⁻¹
            rest = right - normal @ mean
            part = (right + rest) @ mean + np.einsum("nk,nkl,nl->n", rest, spread, rest)
            density, precision = self.noise_density(np.maximum(self.squares - part, 0.0))
            odds = density - nothing - np.linalg.slogdet(growth)[1] / 2
            logs = np.array([np.full(len(odds), np.log1p(-share)), np.log(share) + odds, odd])
            total = np.logaddexp.reduce(logs)
            if (now := float(total.sum())) < before + LIKELIHOOD_TOLERANCE:
                break
            before = now
            has = np.exp(logs - total)
            # Weighted least squares, with the noise that the effect leaves in each sensor.
            weights = np.maximum(has[1], LEAST_HAVING) * precision
            information = normal - normal @ spread @ normal  # (N⁻¹ + S)⁻¹
            pooled = np.einsum("n,nkl->kl", weights, information)
            score = right - np.einsum("nkl,nlm,nm->nk", normal, spread, right)
            mean = _solved(pooled, weights @ score)
            share = float(np.clip(has[1].sum() / max(has[:2].sum(), 1e-300), 0.01, 0.999))
        cost = _cost_of_fitting(k, mean @ pooled @ mean)
        return TypicalSize(effect.spec, odds, before, cost, mean, share)


def _solved(normal: Array, right: Array) -> Array:
    """Solution of normal equations, some of which may be alike."""
    return np.asarray(np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ right)


def _cost_of_fitting(dim: int, shown: float) -> float:
    """Log of the evidence over the likelihood of a size that is fitted, over the prior of sizes.

    Parameters
    ----------
    dim : int, parameters of an effect
    shown : float, λ of these sizes in all sensors
    """
    g = SIZES / dim
    return float(log_mean(-dim / 2 * np.log1p(g) - shown / (2 * (1 + g)), SIZE_WEIGHTS))
