"""Sizes of effects as those of a type: who has them, as large as they are in the others.

Sensor i tells of the parameters β of some effects by ℓ_i(β) = βᵀ b_i − βᵀ N_i β / 2, in units of
its noise. In a type each effect has sizes β ~ N(μ, S), S = τ² ‖μ‖²/k · I, in a part ρ of the
sensors, and 0 in the others, independently of other effects. So the odds of sensor i for a set are

    log r_i = (b_i + S⁻¹μ)ᵀ (S⁻¹ + N_i)⁻¹ (b_i + S⁻¹μ)/2 − μᵀ S⁻¹ μ/2 − log|I + S N_i|/2,

with the μ, ρ and τ that make the likelihood of all sensors largest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import usual_approach
from accelstudy.campaign.session import Campaign
from accelstudy.diagnosis.decision.problem import fit_base
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import Frame
from accelstudy.effects import get_effect
from accelstudy.lots.noise import SensorNoise, with_noise
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]
Names = tuple[int, ...]

SCATTERS = (0.25, 1.0)
"""τ, scatter of the parameters of a type in parts of their size."""
SHARES = (0.9, 0.35)
"""ρ from which the search begins, for each effect."""
MIN_FREEDOM = 20
"""Degrees of freedom that tell the noise."""
MAX_STEPS = 60
"""Most steps of the search for μ and ρ."""
LIKELIHOOD_TOLERANCE = 1e-3
"""Change of the log likelihood below which they are found."""


@dataclass(frozen=True)
class Told:
    """What a sensor tells of the parameters of some effects, side by side.

    Attributes
    ----------
    normal : (k, k) array, DᵀD of the derivatives D of the residuals z by the parameters
    right : (k,) array, Dᵀz
    squares : (k,) array, of what D would be if no parameter of the model were estimated
    square : float, ‖z‖²
    redundancy : int
    """

    normal: Array
    right: Array
    squares: Array
    square: float
    redundancy: int


def told(
    campaign: Campaign,
    model: SensorModel | None,
    approach: Approach | None,
    noise: SensorNoise | None,
    specs: Sequence[str],
) -> Told:
    """Say what a campaign tells of effects; nothing of those that it cannot show.

    Parameters
    ----------
    campaign, model, approach, noise : as in `evidence.sensor_evidence`
    specs : effects with their settings
    """
    if model is None:
        k = sum(len(get_effect(spec).parameters) for spec in specs)
        return Told(np.zeros((k, k)), np.zeros(k), np.zeros(k), 0.0, 0)
    campaign = with_noise(campaign, noise)
    frame = Frame.of(fit_base(campaign, model, approach or usual_approach(campaign)).solution)
    residuals, columns = frame.residuals, []
    for spec in specs:
        effect = get_effect(spec)
        try:
            columns.append(residuals.whitened(frame.signature(effect)))
        except InputError:  # a column is absent
            columns.append(np.zeros((len(residuals.z), len(effect.parameters))))
    whole = np.concatenate(columns, axis=1)
    d, z = residuals.project(whole), residuals.z
    return Told(d.T @ d, d.T @ z, np.sum(whole**2, axis=0), float(z @ z), residuals.redundancy)


def visible(normal: Array, squares: Array) -> tuple[Array, Array]:
    """Combinations of the parameters of an effect that show, and how much each of them does.

    Parameters
    ----------
    normal : (k, k) array, DᵀD of the derivatives D of residuals by the parameters
    squares : (k,) array, of what D would be if no parameter of the model were estimated

    Returns
    -------
    directions : (k, l) array
    values : (l,) array, of the normal matrix in these directions
    """
    scale = np.sqrt(np.where(squares > 0, squares, 1.0))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    seen = values > RULES.visible**2
    return vectors[:, seen] / scale[:, None], values[seen]


@dataclass(frozen=True)
class OfType:
    """A set of effects in the sensors of a type.

    Attributes
    ----------
    odds : mapping of each subset but the empty one, as places in the set, to (n,) array, log odds
        of the sensors
    alike : float, log likelihood ratio of one size in all sensors, the most probable one
    mean, shares : (k,) and (e,) arrays, μ of all parameters and ρ of each effect
    """

    odds: Mapping[Names, Array]
    alike: float
    mean: Array
    shares: Array


@dataclass(frozen=True, eq=False)
class TypeSizes:
    """What all sensors of a lot tell of effects.

    Attributes
    ----------
    normal, right : (n, K, K) and (n, K) arrays, of all parameters that show, in units in which they
        show equally well
    columns : mapping of each effect to its parameters among the K
    usual : int array, places of the sensors that tell what is typical
    """

    normal: Array
    right: Array
    columns: Mapping[str, NDArray[np.int_]]
    usual: NDArray[np.int_]

    @classmethod
    def of(cls, each: Sequence[Told], specs: Sequence[str], usual: Sequence[int]) -> TypeSizes:
        """Gather what sensors tell of effects.

        The noise is that which the one or two effects leave that explain most.

        Parameters
        ----------
        each : what the sensors tell of the effects
        specs : effects with their settings
        usual : places of the sensors that tell what is typical
        """
        normal = np.array([one.normal for one in each])
        right = np.array([one.right for one in each])
        whole = np.sum([one.squares for one in each], axis=0)
        ends = np.cumsum([0, *(len(get_effect(spec).parameters) for spec in specs)])
        turned, columns, place = [], dict[str, NDArray[np.int_]](), 0
        for spec, first, end in zip(specs, ends[:-1], ends[1:], strict=True):
            shown = normal[:, first:end, first:end].sum(axis=0)
            directions, values = visible(shown, whole[first:end])
            # In these directions and units the sensors together tell as much of each.
            block = np.zeros((ends[-1], len(values)))
            block[first:end] = directions / np.sqrt(values / len(each))
            turned.append(block)
            columns[spec] = place + np.arange(block.shape[1])
            place += block.shape[1]
        turn = np.concatenate(turned, axis=1)
        raw = cls(turn.T @ normal @ turn, right @ turn, columns, np.array([*usual]))
        counted = [each[i] for i in usual]
        variance = raw.only(usual)._variance(
            sum(one.square for one in counted), sum(one.redundancy for one in counted)
        )
        return replace(raw, normal=raw.normal / variance, right=raw.right / variance)

    def only(self, places: Sequence[int]) -> TypeSizes:
        """Return what some of the sensors tell, all of which are usual."""
        at = [*places]
        return replace(self, normal=self.normal[at], right=self.right[at], usual=np.arange(len(at)))

    def _variance(self, squares: float, redundancy: int) -> float:
        """Noise that the one or two effects leave that explain most."""
        left = [squares / redundancy]
        for specs in (s for r in (1, 2) for s in combinations(self.columns, r)):
            at = np.concatenate([self.columns[spec] for spec in specs])
            inverse = np.linalg.pinv(self.normal[:, at[:, None], at], rcond=1e-8, hermitian=True)
            b = self.right[:, at]
            part = float(np.einsum("nk,nkl,nl->", b, inverse, b))
            rank = float(np.einsum("nkl,nlk->", inverse, self.normal[:, at[:, None], at]))
            if redundancy - rank >= MIN_FREEDOM:
                left.append((squares - part) / (redundancy - rank))
        return max(min(left), 1e-12)

    def of_set(self, specs: Sequence[str]) -> OfType:
        """Odds of each sensor for the subsets of some effects, with sizes of the type."""
        parts = [self.columns[spec] for spec in specs]
        at = np.concatenate(parts)
        counts = [len(part) for part in parts]
        search = _Search(self.normal[:, at[:, None], at], self.right[:, at], counts, self.usual)
        mean, alike = search.pooled
        best = -np.inf, list[Array](), mean, np.ones(len(specs))
        # From many that have each effect, and from few that have one of them.
        most, few = SHARES
        starts = [np.full(len(specs), most)]
        starts += [np.where(np.arange(len(specs)) == k, few, most) for k in range(len(specs))]
        for scatter in SCATTERS:
            for shares in starts:
                whole = mean / np.repeat(shares, search.counts)
                found = search.found(whole, shares, scatter)
                best = max(best, found, key=lambda one: one[0])
        _, odds, mean, shares = best
        return OfType(dict(zip(search.subsets, odds, strict=True)), alike, mean, shares)

    def apart(
        self, specs: Sequence[str], of_type: OfType, place: int, rival: str
    ) -> tuple[float, float]:
        """Noncentrality that an effect leaves beside a rival of it, and without the rival.

        Parameters
        ----------
        specs : set of effects
        of_type : OfType of the set
        place : int, of the effect in the set
        rival : str, another effect that may be there in its place
        """
        normal = self.normal[self.usual].sum(axis=0)
        ends = np.cumsum([0, *(len(self.columns[spec]) for spec in specs)])
        mean = of_type.mean[ends[place] : ends[place + 1]]
        own = self.columns[specs[place]]
        others = [spec for k, spec in enumerate(specs) if k != place]

        def left(beside: Sequence[str]) -> float:
            rest = np.concatenate([np.zeros(0, dtype=int), *(self.columns[s] for s in beside)])
            cross = normal[np.ix_(own, rest)]
            inverse = np.linalg.pinv(normal[np.ix_(rest, rest)], rcond=1e-8, hermitian=True)
            shown = normal[np.ix_(own, own)] - cross @ inverse @ cross.T
            return float(of_type.shares[place] * mean @ shown @ mean)

        return left([*others, rival]), left(others)


@dataclass(frozen=True, eq=False)
class _Search:
    """The search for sizes and shares of effects, side by side, with `counts` of parameters."""

    normal: Array
    right: Array
    counts: list[int]
    usual: NDArray[np.int_]

    @cached_property
    def subsets(self) -> list[Names]:
        """All sets of the effects but the empty one."""
        effects = range(len(self.counts))
        return [s for r in effects for s in combinations(effects, r + 1)]

    @cached_property
    def of(self) -> NDArray[np.int_]:
        """Effect of each parameter."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @cached_property
    def places(self) -> list[NDArray[np.int_]]:
        """Parameters of each of the `subsets`."""
        return [np.flatnonzero(np.isin(self.of, subset)) for subset in self.subsets]

    @cached_property
    def has(self) -> NDArray[np.bool_]:
        """Which effects the empty set and the `subsets` have."""
        return np.array([[k in s for k in range(len(self.counts))] for s in ((), *self.subsets)])

    @cached_property
    def pooled(self) -> tuple[Array, float]:
        """Sizes that are the same in all sensors, and their log likelihood ratio."""
        normal, right = (a[self.usual].sum(axis=0) for a in (self.normal, self.right))
        mean = np.linalg.pinv(normal, rcond=1e-6, hermitian=True) @ right
        return mean, float(right @ mean) / 2

    def found(
        self, mean: Array, shares: Array, scatter: float
    ) -> tuple[float, list[Array], Array, Array]:
        """Log likelihood, odds of each subset (n,), sizes and shares, from given ones on."""
        before, odds = -np.inf, list[Array]()
        for _ in range(MAX_STEPS):
            variances = np.array([
                max(scatter**2 * float(np.mean(mean[self.of == k] ** 2)), 1e-12)
                for k in range(len(self.counts))
            ])[self.of]  # fmt: skip
            odds, taken, seen = [], [], []
            for at in self.places:
                n, b = self.normal[:, at[:, None], at], self.right[:, at]
                m, s = mean[at], variances[at]
                inverse = np.linalg.inv(n + np.diag(1 / s))
                pull = b + m / s
                odds.append(
                    np.einsum("nk,nkl,nl->n", pull, inverse, pull) / 2
                    - m @ (m / s) / 2
                    - np.linalg.slogdet(np.eye(len(at)) + s[:, None] * n)[1] / 2
                )
                # Weighted least squares: (N⁻¹ + S)⁻¹ = N − N (S⁻¹ + N)⁻¹ N.
                lost = n @ inverse
                taken.append(n - lost @ n)
                seen.append(b - np.einsum("nkl,nl->nk", lost, b))
            prior = np.where(self.has, np.log(shares), np.log1p(-shares)).sum(axis=1)
            logs = np.array([0 * odds[0], *odds]) + prior[:, None]
            total = np.logaddexp.reduce(logs)
            if (now := float(total[self.usual].sum())) < before + LIKELIHOOD_TOLERANCE:
                break
            before = now
            weights = np.zeros((len(self.subsets), len(total)))
            weights[:, self.usual] = np.exp(logs[1:] - total)[:, self.usual]
            whole, pulled = np.zeros((len(mean),) * 2), np.zeros(len(mean))
            for at, w, a, b in zip(self.places, weights, taken, seen, strict=True):
                whole[np.ix_(at, at)] += np.einsum("n,nkl->kl", w, a)
                pulled[at] += w @ b
            shares = np.clip(weights.sum(axis=1) @ self.has[1:] / len(self.usual), 0.01, 0.999)
            mean = np.linalg.pinv(whole, rcond=1e-6, hermitian=True) @ pulled
        return before, odds, mean, shares
