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
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import get_effect

Array = NDArray[np.float64]
T = TypeVar("T")
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


class TypicalSet(NamedTuple):
    """Sizes of a set of effects that explain a lot best, with one scatter.

    Attributes
    ----------
    odds : (s, n) array, log odds of the sensors for the subsets of the effects
    log_likelihood : float, of sizes and shares
    cost : float, log of evidence over likelihood: what fitting the sizes costs
    mean : (k,) array, μ of the parameters, side by side
    shares : dict of effect to ρ
    """

    odds: Array
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
    effects : (k,) array of str, effect of each parameter
    normal : (n, k, k) array, N of the sensors, turned to what shows, in units of the noise
    right : (n, k) array, b
    usual : (n,) bool array, sensors by which sizes are estimated
    """

    specs: dict[str, str]
    effects: NDArray[np.str_]
    normal: Array
    right: Array
    usual: NDArray[np.bool_]

    @classmethod
    def of(
        cls,
        frames: Sequence[SessionFit | None],
        shapes: Mapping[str, Sequence[str]],
        usual: NDArray[np.bool_],
    ) -> TypeSizes:
        """Add up what sensors tell, in units of the noise that one or two effects leave.

        Parameters
        ----------
        frames : calibrations of the sensors; None for one that shows nothing and is not usual
        shapes : mapping of effects to their shapes
        usual : as above
        """
        some = [frame for frame, chosen in zip(frames, usual, strict=True) if frame and chosen]
        specs, turns = dict[str, str](), dict[str, Array]()
        for name, tried in shapes.items():
            parts, turned = zip(*(_shown(some, spec) for spec in tried), strict=True)
            best = int(np.argmax(parts))
            if turned[best].size:
                specs[name], turns[name] = tried[best], turned[best]
        effects = np.repeat([*turns], [turn.shape[1] for turn in turns.values()])
        right = np.zeros((len(frames), len(effects)))
        normal = np.zeros((*right.shape, len(effects)))
        for i, frame in enumerate(frames if turns else ()):
            if frame is not None:
                each = [_derivatives(frame, specs[name])[0] @ turns[name] for name in turns]
                a = np.concatenate(each, axis=1)
                normal[i], right[i] = a.T @ a, frame.residuals.z @ a
        raw = cls(specs, effects, normal, right, usual)
        squares = sum(float(frame.residuals.z @ frame.residuals.z) for frame in some)
        variance = raw._variance(squares, sum(frame.residuals.redundancy for frame in some))
        return cls(specs, effects, normal / variance, right / variance, usual)

    def _variance(self, squares: float, redundancy: int) -> float:
        """Noise variance that the best one or two effects leave."""
        left = [squares / redundancy]
        for names in (s for r in (1, 2) for s in combinations(self.specs, r)):
            at = np.flatnonzero(np.isin(self.effects, names))
            b = self.right[self.usual][:, at]
            n = self.normal[self.usual][:, at[:, None], at]
            inverse = np.linalg.pinv(n, rcond=1e-8, hermitian=True)
            rank = float(np.einsum("nkl,nlk->", inverse, n))
            if redundancy - rank >= MIN_FREEDOM:
                part = float(np.einsum("nk,nkl,nl->", b, inverse, b))
                left.append((squares - part) / (redundancy - rank))
        return max(min(left), 1e-12)

    def of_set(self, names: Names) -> list[TypicalSet]:
        """Sizes and shares of a set that are most probable, for each scatter; none if none show."""
        if not names or not {*names} <= {*self.specs}:
            return []
        if len(names) == 1:
            return self._singles[names[0]]
        alone = (most_likely(self.of_set((name,))).shares for name in names)
        return self._search_all(
            names, [{key: share for one in alone for key, share in one.items()}]
        )

    @cached_property
    def _singles(self) -> dict[str, list[TypicalSet]]:
        """Sizes and shares of each effect by itself."""
        return {n: self._search_all((n,), [{n: share} for share in SHARES]) for n in self.specs}

    def _search_all(self, names: Names, starts: Sequence[Mapping[str, float]]) -> list[TypicalSet]:
        """Search with each scatter, with the first one from some shares."""
        first, *others = SCATTERS
        best = most_likely([self._search(names, shares, first) for shares in starts])
        return [best, *(self._search(names, best.shares, τ, best.mean) for τ in others)]

    def _search(
        self, names: Names, shares: Mapping[str, float], scatter: float, mean: Array | None = None
    ) -> TypicalSet:
        """Search for sizes and shares with a scatter, by expectation and maximization.

        All is told for each subset s of the effects: what these have no part in is zero.

        Parameters
        ----------
        names : some effects
        shares : to begin with
        scatter : float, τ
        mean : (k,) array, sizes to begin with; by default as if these shares of all have them
        """
        at, usual = np.flatnonzero(np.isin(self.effects, names)), self.usual
        of = self.effects[at] == np.array(names)[:, None]  # (e, k)
        has = np.array([[name in some for name in names] for some in subsets_of(names)])
        seen = has @ of  # (s, k)
        normal = self.normal[:, at[:, None], at] * (seen[:, None, :, None] & seen[:, None, None])
        right = self.right[:, at] * seen[:, None]
        rho = np.array([shares[name] for name in names])
        if mean is None:
            whole, pulled = (a[-1, usual].sum(axis=0) for a in (normal, right))
            mean = _solved(whole, pulled) / (rho @ of)
        before = -np.inf
        for _ in range(MAX_STEPS):
            variances = scatter**2 * (of @ mean**2 / of.sum(axis=1)) @ of
            beside = np.eye(len(at)) + normal * variances  # I + N S
            spread = variances[:, None] * np.linalg.inv(beside)  # (S⁻¹ + N)⁻¹
            lost, rest = normal @ spread, right - normal @ mean
            odds = (
                (right + rest) @ mean
                + np.einsum("snk,snkl,snl->sn", rest, spread, rest)
                - np.linalg.slogdet(beside)[1]
            ) / 2
            prior = np.where(has, np.log(rho), np.log1p(-rho)).sum(axis=1)
            logs = odds + prior[:, None]
            total = np.logaddexp.reduce(logs)
            # Weighted least squares: (N⁻¹ + S)⁻¹ = N − N (S⁻¹ + N)⁻¹ N.
            taken = normal - lost @ normal
            if (now := float(total[usual].sum())) < before + LIKELIHOOD_TOLERANCE:
                break
            before = now
            weights = np.exp(logs - total)[:, usual]
            whole = np.einsum("sn,snkl->kl", weights, taken[:, usual])
            b = right - np.einsum("snkl,snl->snk", lost, right)
            rho = np.clip(weights.mean(axis=1) @ has, 0.01, 0.999)
            mean = _solved(whole, np.einsum("sn,snk->k", weights, b[:, usual]))
        cost = 0.0
        for k, share in enumerate(rho.tolist(), start=1):  # sets of one come behind the empty one
            shown = share * mean @ taken[k, usual].sum(axis=0) @ mean
            cost += _cost_of_fitting(int(seen[k].sum()), float(shown))
        return TypicalSet(odds, before, cost, mean, dict(zip(names, rho.tolist(), strict=True)))


def subsets_of(effects: Iterable[T]) -> list[tuple[T, ...]]:
    """Subsets of some effects, all of which a sensor may have: none, and each alone, first."""
    given = [*effects]
    return [s for r in range(len(given) + 1) for s in combinations(given, r)]


def most_likely(sets: Sequence[TypicalSet]) -> TypicalSet:
    """Return the one with the most probable sizes and shares."""
    return max(sets, key=lambda one: one.log_likelihood)


def _derivatives(frame: SessionFit, spec: str) -> tuple[Array, Array]:
    """What the parameters of an effect do to the residuals z of a campaign.

    Returns
    -------
    columns : (m, k) array, derivatives of z; zero for what it cannot show
    squares : (k,) array, of them if no parameter of the model were estimated
    """
    effect, residuals = get_effect(spec), frame.residuals
    rows = np.zeros((len(residuals.z), len(effect.parameters)))
    with suppress(InputError):  # a column is absent
        rows = frame.rows(effect)
    return residuals.project(rows), np.sum(rows**2, axis=0)


def _shown(frames: Sequence[SessionFit], spec: str) -> tuple[float, Array]:
    """How much sensors show of an effect if it is equally large in all, and what of it shows.

    Returns
    -------
    part : float, ‖Qᵀz‖² of all residuals as one
    turn : (k, l) array, combinations of its parameters of which sensors tell equally much
    """
    columns, squares = zip(*(_derivatives(frame, spec) for frame in frames), strict=True)
    normal = sum(each.T @ each for each in columns)
    right = sum(one.residuals.z @ each for one, each in zip(frames, columns, strict=True))
    total = sum(squares)
    scale = np.sqrt(np.where(total > 0, total, 1.0))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    seen = values > RULES.visible**2
    turn = vectors[:, seen] / scale[:, None] / np.sqrt(values[seen])
    return float(np.sum((right @ turn) ** 2)), turn * np.sqrt(len(frames))


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
