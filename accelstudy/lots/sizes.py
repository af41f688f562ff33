"""Sizes of effects in a type: the same in all of its sensors, or with a scatter about their mean.

Sensor i tells of the parameters β of some effects by ℓ_i(β) = βᵀ b_i − βᵀ N_i β / 2, in units of
its noise. In a type each effect has sizes β ~ N(μ, S), S = τ² ‖μ‖²/k · I, in a part ρ of the
sensors, and 0 in the others, independently of other effects. So the odds of sensor i for a set are

    log r_i = ℓ_i(μ) + (b_i − N_i μ)ᵀ (S⁻¹ + N_i)⁻¹ (b_i − N_i μ)/2 − log|I + N_i S|/2

for some τ, from 0 on, with the μ and ρ that make the likelihood of all sensors largest. A μ that is
fitted pays for that as any effect of unknown size does: with λ = ρ μᵀ Σ_i (N_i⁻¹ + S)⁻¹ μ, the
noncentrality of what all sensors show, and g of its prior (`evidence.size`), evidence is likelihood
times the mean of (1 + g)^(−k/2) exp(−λ/(2 + 2 g)).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import combinations, pairwise
from operator import add
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, Evidence, Level, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import get_effect

Array = NDArray[np.float64]
Names = tuple[str, ...]
"""Names of some effects, in order."""

SCATTERS = (0.0, 0.25, 1.0)
"""τ, scatter of the parameters of a type in parts of their size; beyond, each sensor has its own
size."""
SHARES = (0.9, 0.35)
"""ρ from which the search begins, for each effect."""
MIN_FREEDOM = 20
"""Least degrees of freedom of an estimate of the noise."""
MAX_STEPS = 60
"""Most steps of the search for μ and ρ."""
LIKELIHOOD_TOLERANCE = 1e-3
"""Change of the log likelihood below which the search ends."""


# --- what campaigns say of parameters -----------------------------------------------------------


class Equations(NamedTuple):
    """Normal equations of the parameters of effects side by side, by the residuals z of a campaign.

    Attributes
    ----------
    normal : (k, k) array, DᵀD of the derivatives D of z by the parameters
    right : (k,) array, Dᵀz
    squares : (k,) array, of what D would be if no parameter of the model were estimated
    square : float, ‖z‖²
    """

    normal: Array
    right: Array
    squares: Array
    square: float

    @classmethod
    def of(cls, solution: Solution | None, specs: Iterable[str], unit: float = 1.0) -> Equations:
        """Equations of effects by a campaign; zeros where it cannot show one.

        Parameters
        ----------
        solution : Solution, of the campaign; None for one that shows nothing
        specs : the effects
        unit : float, variance of unit weight
        """
        effects = [get_effect(spec) for spec in specs]
        k = [len(effect.parameters) for effect in effects]
        if solution is None:
            return cls(np.zeros((sum(k), sum(k))), np.zeros(sum(k)), np.zeros(sum(k)), 0.0)
        frame, columns = SessionFit.of(solution), list[Array]()
        for effect, count in zip(effects, k, strict=True):
            try:
                columns.append(frame.rows(effect))
            except InputError:  # a column is absent
                columns.append(np.zeros((len(frame.residuals.z), count)))
        rows, z = np.concatenate(columns, axis=1), frame.residuals.z
        d = frame.residuals.project(rows)
        normal, right, squares = d.T @ d, d.T @ z, np.sum(rows**2, axis=0)
        return cls(normal / unit, right / unit, squares / unit, float(z @ z) / unit)

    def __add__(self, other: tuple[Any, ...]) -> Equations:
        """Equations of both campaigns as one."""
        return Equations(*(a + b for a, b in zip(self, other, strict=True)))

    def visible(self, block: slice) -> tuple[Array, Array]:
        """Combinations of some of the parameters that show, and how much each of them does.

        Returns
        -------
        directions : (k, l) array
        values : (l,) array, of the normal matrix in these directions
        """
        scale = np.sqrt(np.where(self.squares > 0, self.squares, 1.0))[block]
        values, vectors = np.linalg.eigh(self.normal[block, block] / np.outer(scale, scale))
        seen = values > RULES.visible**2
        return vectors[:, seen] / scale[:, None], values[seen]


def blocks(specs: Iterable[str]) -> list[slice]:
    """Places of the parameters of effects side by side."""
    ends = np.cumsum([0, *(len(get_effect(spec).parameters) for spec in specs)]).tolist()
    return [slice(first, end) for first, end in pairwise(ends)]


class PooledEffect(NamedTuple):
    """Log odds that an effect is equally large in all sensors, and its most probable shape."""

    odds: float
    spec: str


def weigh_pooled(
    pooled: Equations, redundancy: int, shapes: Mapping[str, Sequence[str]]
) -> dict[str, PooledEffect]:
    """Weigh effects by all campaigns as one, whose normal equations are added.

    Parameters
    ----------
    pooled : Equations, of all shapes side by side
    redundancy : int, of all campaigns
    shapes : mapping of effects to their shapes
    """
    evidence = Evidence(Level((1.0,), (RULES.freedom_given,), known=True), redundancy)
    nothing = float(evidence.noise_density(pooled.square)[0])
    places = iter(blocks(spec for specs in shapes.values() for spec in specs))
    weighed = {}
    for name, specs in shapes.items():
        logs = {}
        for spec, block in zip(specs, places, strict=False):
            directions, values = pooled.visible(block)
            if dim := len(values):
                part = np.sum((pooled.right[block] @ directions) ** 2 / values)
                density = evidence.spaces_density(np.array([part]), [dim], pooled.square)
                logs[spec] = float(density[0])
        if logs:
            odds = float(log_mean(np.array([*logs.values()]))) - nothing
            weighed[name] = PooledEffect(odds, max(logs, key=lambda spec: logs[spec]))
    return weighed


# --- sizes of a type ----------------------------------------------------------------------------


@dataclass(frozen=True)
class TypicalSet:
    """A set of effects in the sensors of a type, with a scatter.

    Attributes
    ----------
    odds : mapping of each of its subsets to (n,) array, log odds of the sensors
    log_likelihood : float, of the sizes and shares
    cost : float, log of the evidence over the likelihood, as sizes are fitted
    sizes : mapping of each effect to (k,) array, μ of its parameters
    shares : mapping of each effect to ρ
    usual : (n,) bool array, the sensors by which sizes and shares were found
    """

    odds: Mapping[Names, Array]
    log_likelihood: float
    cost: float
    sizes: Mapping[str, Array]
    shares: Mapping[str, float]
    usual: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class TypeSizes:
    """The equations of all sensors of a lot for the sizes of effects.

    Attributes
    ----------
    specs : mapping of effects to their settings
    asked : sequence of sets of one or two of these effects
    normal, right : (n, K, K) and (n, K) arrays, of all parameters that show, in units in which they
        show equally well
    columns : mapping of each effect to its parameters among the K
    usual : int array, places of the sensors that tell what is typical
    """

    specs: Mapping[str, str]
    asked: Sequence[Names]
    normal: Array
    right: Array
    columns: Mapping[str, NDArray[np.int_]]
    usual: NDArray[np.int_]

    @classmethod
    def of(
        cls,
        each: Sequence[Equations],
        specs: Mapping[str, str],
        asked: Sequence[Names],
        usual: Sequence[int],
        redundancy: int,
    ) -> TypeSizes:
        """Gather the equations of sensors.

        The noise is that which the one or two effects leave that explain most.

        Parameters
        ----------
        each : what the sensors tell of `specs`, side by side
        specs, asked, usual : as above
        redundancy : int, of the usual sensors
        """
        pooled, turned, columns, place = reduce(add, each), [], dict[str, NDArray[np.int_]](), 0
        for name, block in zip(specs, blocks(specs.values()), strict=True):
            directions, values = pooled.visible(block)
            # In these directions and units the sensors together tell as much of each.
            turned.append(np.zeros((len(pooled.right), len(values))))
            turned[-1][block] = directions / np.sqrt(values / len(each))
            columns[name] = place + np.arange(len(values))
            place += len(values)
        turn = np.concatenate(turned, axis=1)
        normal, right = (np.array([getattr(one, k) for one in each]) for k in ("normal", "right"))
        raw = cls(specs, asked, turn.T @ normal @ turn, right @ turn, columns, np.array([*usual]))
        variance = raw.only(usual)._variance(sum(each[i].square for i in usual), redundancy)
        return replace(raw, normal=raw.normal / variance, right=raw.right / variance)

    def only(self, places: Sequence[int]) -> TypeSizes:
        """Return the equations of some of the sensors, all of which are usual."""
        at = [*places]
        return replace(self, normal=self.normal[at], right=self.right[at], usual=np.arange(len(at)))

    def _variance(self, squares: float, redundancy: int) -> float:
        """Noise variance that the best one or two effects leave."""
        left = [squares / redundancy]
        for names in (s for r in (1, 2) for s in combinations(self.columns, r)):
            at = np.concatenate([self.columns[name] for name in names])
            inverse = np.linalg.pinv(self.normal[:, at[:, None], at], rcond=1e-8, hermitian=True)
            b = self.right[:, at]
            part = float(np.einsum("nk,nkl,nl->", b, inverse, b))
            rank = float(np.einsum("nkl,nlk->", inverse, self.normal[:, at[:, None], at]))
            if redundancy - rank >= MIN_FREEDOM:
                left.append((squares - part) / (redundancy - rank))
        return max(min(left), 1e-12)

    @cached_property
    def sets(self) -> dict[Names, list[TypicalSet]]:
        """Sets of effects that show, with each of `SCATTERS`."""
        return {
            names: self._of_set(names)
            for names in self.asked
            if all(len(self.columns[name]) for name in names)
        }

    def _of_set(self, names: Names) -> list[TypicalSet]:
        """Odds of a set with the sizes and shares that are most probable, for each scatter."""
        parts = [self.columns[name] for name in names]
        at, of = np.concatenate(parts), np.repeat(names, [len(part) for part in parts])
        # From many that have each effect, and from few that have one of them.
        most, few = SHARES
        starts = [dict.fromkeys(names, most)]
        starts += [{**starts[0], name: few} for name in names]
        return [
            most_likely([self._search(at, of, shares, scatter) for shares in starts])
            for scatter in SCATTERS
        ]

    def _search(
        self, at: NDArray[np.int_], of: NDArray[np.str_], start: Mapping[str, float], scatter: float
    ) -> TypicalSet:
        """Search for sizes and shares with a scatter, by expectation and maximization.

        Parameters
        ----------
        at, of : (k,) arrays, parameters of some effects, and the effect of each
        start : shares to begin with
        scatter : float, τ
        """
        names, normal, right = tuple(start), self.normal[:, at[:, None], at], self.right[:, at]
        subsets = [s for r in range(len(names)) for s in combinations(names, r + 1)]
        places = [np.flatnonzero(np.isin(of, subset)) for subset in subsets]
        has = np.array([[name in subset for name in names] for subset in ((), *subsets)])
        whole, pulled = (a[self.usual].sum(axis=0) for a in (normal, right))
        same = np.linalg.pinv(whole, rcond=1e-6, hermitian=True) @ pulled
        shares = np.array([*start.values()])
        mean, before = same / np.array([start[name] for name in of]), -np.inf
        odds = np.zeros((1 + len(subsets), len(right)))
        for _ in range(MAX_STEPS):
            squares = {name: float(np.mean(mean[of == name] ** 2)) for name in names}
            variances = np.array([scatter**2 * squares[name] for name in of])
            taken, seen = [], []
            for row, at in enumerate(places, start=1):
                n, b = normal[:, at[:, None], at], right[:, at]
                m, s = mean[at], variances[at]
                beside = np.eye(len(at)) + n * s  # I + N S
                spread = s[:, None] * np.linalg.inv(beside)  # (S⁻¹ + N)⁻¹
                lost, rest = n @ spread, b - n @ m
                odds[row] = (
                    (b + rest) @ m
                    + np.einsum("nk,nkl,nl->n", rest, spread, rest)
                    - np.linalg.slogdet(beside)[1]
                ) / 2
                # Weighted least squares: (N⁻¹ + S)⁻¹ = N − N (S⁻¹ + N)⁻¹ N.
                taken.append(n - lost @ n)
                seen.append(b - np.einsum("nkl,nl->nk", lost, b))
            prior = np.where(has, np.log(shares), np.log1p(-shares)).sum(axis=1)
            logs = odds + prior[:, None]
            total = np.logaddexp.reduce(logs)
            if (now := float(total[self.usual].sum())) < before + LIKELIHOOD_TOLERANCE:
                break
            before = now
            weights = np.zeros((len(subsets), len(total)))
            weights[:, self.usual] = np.exp(logs[1:] - total)[:, self.usual]
            whole, pulled = np.zeros((len(mean),) * 2), np.zeros(len(mean))
            for at, w, a, b in zip(places, weights, taken, seen, strict=True):
                whole[np.ix_(at, at)] += np.einsum("n,nkl->kl", w, a)
                pulled[at] += w @ b
            shares = np.clip(weights.sum(axis=1) @ has[1:] / len(self.usual), 0.01, 0.999)
            mean = np.linalg.pinv(whole, rcond=1e-6, hermitian=True) @ pulled
        sizes = [mean[of == name] for name in names]
        # Sets of one are the first ones.
        shown = [
            float(share * size @ alone[self.usual].sum(axis=0) @ size)
            for share, size, alone in zip(shares, sizes, taken, strict=False)
        ]
        return TypicalSet(
            odds=dict(zip(((), *subsets), odds, strict=True)),
            log_likelihood=before,
            cost=sum(map(_cost_of_fitting, map(len, sizes), shown)),
            sizes=dict(zip(names, sizes, strict=True)),
            shares=dict(zip(names, shares.tolist(), strict=True)),
            usual=np.isin(np.arange(len(right)), self.usual),
        )

    def apart(self, names: Names, name: str, rival: str) -> tuple[float, float]:
        """Noncentrality that an effect leaves beside a rival of it, and without the rival.

        Parameters
        ----------
        names : set of effects
        name : str, one of them
        rival : str, another effect that may be there in its place
        """
        of_type, own = most_likely(self.sets[names]), self.columns[name]
        normal, mean = self.normal[self.usual].sum(axis=0), of_type.sizes[name]
        others = [other for other in names if other != name]

        def left(beside: Sequence[str]) -> float:
            parts = [self.columns[other] for other in beside]
            rest = np.concatenate([np.zeros(0, dtype=int), *parts])
            cross = normal[np.ix_(own, rest)]
            inverse = np.linalg.pinv(normal[np.ix_(rest, rest)], rcond=1e-8, hermitian=True)
            shown = normal[np.ix_(own, own)] - cross @ inverse @ cross.T
            return float(of_type.shares[name] * mean @ shown @ mean)

        return left([*others, rival]), left(others)


def most_likely(sets: Sequence[TypicalSet]) -> TypicalSet:
    """Return the one with the most probable sizes and shares."""
    return max(sets, key=lambda one: one.log_likelihood)


def _cost_of_fitting(dim: int, shown: float) -> float:
    """Log of the evidence over the likelihood of a size that is fitted, over the prior of sizes.

    Parameters
    ----------
    dim : int, parameters of an effect
    shown : float, λ of these sizes in all sensors
    """
    g = SIZES / dim
    return float(log_mean(-dim / 2 * np.log1p(g) - shown / (2 * (1 + g)), SIZE_WEIGHTS))
