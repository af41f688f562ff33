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
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality import Solution
from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import get_effect

Array = NDArray[np.float64]
Names = tuple[str, ...]
"""Names of some effects, in order."""

SCATTERS = (0.25, 0.0, 1.0)
"""τ, scatter of the parameters of a type in parts of their size; beyond, each sensor has its own
size. The search for the first one starts the others."""
SHARES = (0.9, 0.35)
"""ρ from which the search for a single effect begins: many sensors have it, or few."""
MIN_FREEDOM = 20
"""Least degrees of freedom of an estimate of the noise."""
MAX_STEPS = 60
"""Most steps of the search for μ and ρ."""
LIKELIHOOD_TOLERANCE = 1e-3
"""Change of the log likelihood below which the search ends."""


class Derivatives(NamedTuple):
    """What the parameters of effects do to the residuals z of a campaign.

    Attributes
    ----------
    columns : dict of effect, with its settings, to (m, k) array, derivatives of z by its parameters
    squares : dict of the same to (k,) array, of them if no parameter of the model were estimated
    z : (m,) array, of unit weight
    """

    columns: Mapping[str, Array]
    squares: Mapping[str, Array]
    z: Array

    @classmethod
    def of(cls, solution: Solution | None, specs: Iterable[str]) -> Derivatives:
        """Evaluate effects in a campaign; what it cannot show is zero.

        Parameters
        ----------
        solution : Solution, of the campaign; None for one that shows nothing
        specs : the effects
        """
        frame = None if solution is None else SessionFit.of(solution)
        z = np.zeros(0) if frame is None else frame.residuals.z
        columns, squares = dict[str, Array](), dict[str, Array]()
        for spec in specs:
            effect = get_effect(spec)
            rows = np.zeros((len(z), len(effect.parameters)))
            with suppress(InputError):  # a column is absent
                rows = rows if frame is None else frame.rows(effect)
            squares[spec] = np.sum(rows**2, axis=0)
            columns[spec] = rows if frame is None else frame.residuals.project(rows)
        return cls(columns, squares, z)


class TypicalSet(NamedTuple):
    """Sizes of a set of effects that explain a lot best, with one scatter.

    Attributes
    ----------
    odds : dict of the subsets that a sensor may have to (n,) array, log odds of the sensors
    log_likelihood : float, of sizes and shares
    cost : float, log of evidence over likelihood: what fitting the sizes costs
    mean : (k,) array, μ of the parameters, side by side
    shares : dict of effect to ρ
    """

    odds: dict[Names, Array]
    log_likelihood: float
    cost: float
    mean: Array
    shares: dict[str, float]


@dataclass(frozen=True, eq=False)
class TypeSizes:
    """What sensors tell of the sizes that effects have in their type.

    Attributes
    ----------
    specs : dict of effect to its setting that explains most of what the sensors have in common
    columns : dict of effect to places of its parameters
    normal : (n, k, k) array, N of the sensors, turned to what shows, in units of the noise
    right : (n, k) array, b
    usual : (n,) bool array, sensors by which sizes are estimated
    """

    specs: dict[str, str]
    columns: dict[str, NDArray[np.int_]]
    normal: Array
    right: Array
    usual: NDArray[np.bool_]
    _known: dict[Names, list[TypicalSet]] = field(default_factory=dict, init=False)

    @classmethod
    def of(
        cls,
        each: Sequence[Derivatives],
        shapes: Mapping[str, Sequence[str]],
        usual: NDArray[np.bool_],
        redundancy: int,
    ) -> TypeSizes:
        """Add up what sensors tell, in units of the noise that one or two effects leave.

        Parameters
        ----------
        each : what the parameters of all shapes do to the sensors
        shapes : mapping of effects to their shapes
        usual : as above
        redundancy : int, of the usual sensors
        """
        some = [one for one, is_usual in zip(each, usual, strict=True) if is_usual]
        specs, turns = dict[str, str](), list[Array]()
        for name, tried in shapes.items():
            parts, turned = zip(*(_shown(some, spec) for spec in tried), strict=True)
            best = int(np.argmax(parts))
            if turned[best].size:
                specs[name] = tried[best]
                turns.append(turned[best])
        ends = np.cumsum([0, *(turn.shape[1] for turn in turns)])
        columns = {name: np.arange(*ends[k : k + 2]) for k, name in enumerate(specs)}
        normal, right = np.zeros((len(each), ends[-1], ends[-1])), np.zeros((len(each), ends[-1]))
        for i, one in enumerate(each if turns else ()):
            turned_columns = zip(specs.values(), turns, strict=True)
            a = np.concatenate([one.columns[s] @ turn for s, turn in turned_columns], axis=1)
            normal[i], right[i] = a.T @ a, one.z @ a
        raw = cls(specs, columns, normal, right, usual)
        variance = raw._variance(sum(float(one.z @ one.z) for one in some), redundancy)
        return cls(specs, columns, normal / variance, right / variance, usual)

    def only(self, places: Sequence[int]) -> TypeSizes:
        """Return what some of the sensors tell."""
        at = [*places]
        some = self.normal[at], self.right[at], self.usual[at]
        return TypeSizes(self.specs, self.columns, *some)

    def _variance(self, squares: float, redundancy: int) -> float:
        """Noise variance that the best one or two effects leave."""
        left = [squares / redundancy]
        for names in (s for r in (1, 2) for s in combinations(self.columns, r)):
            at = self._places(names)
            b = self.right[self.usual][:, at]
            n = self.normal[self.usual][:, at[:, None], at]
            inverse = np.linalg.pinv(n, rcond=1e-8, hermitian=True)
            rank = float(np.einsum("nkl,nlk->", inverse, n))
            if redundancy - rank >= MIN_FREEDOM:
                part = float(np.einsum("nk,nkl,nl->", b, inverse, b))
                left.append((squares - part) / (redundancy - rank))
        return max(min(left), 1e-12)

    def _places(self, names: Iterable[str]) -> NDArray[np.int_]:
        """Places of the parameters of some effects."""
        return np.concatenate([self.columns[name] for name in names])

    def of_set(self, names: Names) -> list[TypicalSet]:
        """Sizes and shares of a set that are most probable, for each scatter; none if none show."""
        if not names or not {*names} <= {*self.columns}:
            return []
        if names not in self._known:
            starts = [dict.fromkeys(names, share) for share in SHARES]
            if len(names) > 1:
                alone = (most_likely(self.of_set((name,))).shares for name in names)
                starts = [{key: share for one in alone for key, share in one.items()}]
            first, *others = SCATTERS
            best = most_likely([self._search(names, shares, first) for shares in starts])
            rest = [self._search(names, best.shares, scatter, best.mean) for scatter in others]
            self._known[names] = [best, *rest]
        return self._known[names]

    def _search(
        self, names: Names, shares: Mapping[str, float], scatter: float, mean: Array | None = None
    ) -> TypicalSet:
        """Search for sizes and shares with a scatter, by expectation and maximization.

        Parameters
        ----------
        names : some effects
        shares : to begin with
        scatter : float, τ
        mean : (k,) array, sizes to begin with; by default as if these shares of all have them
        """
        at, usual = self._places(names), self.usual
        normal, right = self.normal[:, at[:, None], at], self.right[:, at]
        of = np.repeat(names, [len(self.columns[name]) for name in names])
        subsets = [s for r in (1, 2) for s in combinations(names, r)]
        places = [np.flatnonzero(np.isin(of, subset)) for subset in subsets]
        has = np.array([[name in subset for name in names] for subset in ((), *subsets)])
        rho = np.array([shares[name] for name in names])
        if mean is None:
            whole, pulled = (a[usual].sum(axis=0) for a in (normal, right))
            mean = _solved(whole, pulled) / np.array([shares[name] for name in of])
        before, odds = -np.inf, np.zeros((len(has), len(right)))
        for _ in range(MAX_STEPS):
            squares = {name: float(np.mean(mean[of == name] ** 2)) for name in names}
            variances = np.array([scatter**2 * squares[name] for name in of])
            taken, seen = [], []
            for row, some in enumerate(places, start=1):
                n, b = normal[:, some[:, None], some], right[:, some]
                m, s = mean[some], variances[some]
                beside = np.eye(len(some)) + n * s  # I + N S
                spread = s[:, None] * np.linalg.inv(beside)  # (S⁻¹ + N)⁻¹
                lost, rest = n @ spread, b - n @ m
                odds[row] = (
                    (b + rest) @ m
                    + np.einsum("nk,nkl,nl->n", rest, spread, rest)
                    - np.linalg.slogdet(beside)[1]
                ) / 2
                # Weighted least squares: (N⁻¹ + S)⁻¹ = N − N (S⁻¹ + N)⁻¹ N.
                taken.append((n - lost @ n)[usual])
                seen.append((b - np.einsum("nkl,nl->nk", lost, b))[usual])
            prior = np.where(has, np.log(rho), np.log1p(-rho)).sum(axis=1)
            logs = odds + prior[:, None]
            total = np.logaddexp.reduce(logs)
            if (now := float(total[usual].sum())) < before + LIKELIHOOD_TOLERANCE:
                break
            before = now
            weights = np.exp(logs[1:] - total)[:, usual]
            whole, pulled = np.zeros((len(mean),) * 2), np.zeros(len(mean))
            for some, w, a, b in zip(places, weights, taken, seen, strict=True):
                whole[np.ix_(some, some)] += np.einsum("n,nkl->kl", w, a)
                pulled[some] += w @ b
            rho = np.clip(weights.sum(axis=1) @ has[1:] / weights.shape[1], 0.01, 0.999)
            mean = _solved(whole, pulled)
        # Sets of one are the first ones.
        cost = 0.0
        for share, some, a in zip(rho, places, taken, strict=False):
            shown = share * mean[some] @ a.sum(axis=0) @ mean[some]
            cost += _cost_of_fitting(len(some), float(shown))
        known = dict(zip(((), *subsets), odds, strict=True))
        return TypicalSet(known, before, cost, mean, dict(zip(names, rho.tolist(), strict=True)))


def most_likely(sets: Sequence[TypicalSet]) -> TypicalSet:
    """Return the one with the most probable sizes and shares."""
    return max(sets, key=lambda one: one.log_likelihood)


def _shown(each: Sequence[Derivatives], spec: str) -> tuple[float, Array]:
    """How much sensors show of an effect if it is equally large in all, and what of it shows.

    Returns
    -------
    part : float, ‖Qᵀz‖² of all residuals as one
    turn : (k, l) array, combinations of its parameters of which sensors tell equally much
    """
    normal = sum(one.columns[spec].T @ one.columns[spec] for one in each)
    right = sum(one.z @ one.columns[spec] for one in each)
    squares = sum(one.squares[spec] for one in each)
    scale = np.sqrt(np.where(squares > 0, squares, 1.0))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    seen = values > RULES.visible**2
    turn = vectors[:, seen] / scale[:, None] / np.sqrt(values[seen])
    return float(np.sum((right @ turn) ** 2)), turn * np.sqrt(len(each))


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
