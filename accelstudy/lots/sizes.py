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
from functools import cached_property
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.diagnosis.evidence.size import SIZE_WEIGHTS, SIZES, Evidence, Level, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.effects import Effect, get_effect

if TYPE_CHECKING:
    from accelstudy.lots.evidence import Sensor, SensorEvidence

Array = NDArray[np.float64]
Names = tuple[str, ...]
"""Names of some effects, in order."""

MAX_LOG_DIFFERENCE = 0.3
"""Largest difference of the logarithms of settings that are nearly the same."""
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


# --- what one campaign says of parameters -------------------------------------------------------


class Equations(NamedTuple):
    """Normal equations of the parameters of effects, by the residuals z of a campaign.

    Attributes
    ----------
    normal : (..., k, k) array, DᵀD of the derivatives D of z by the parameters
    right : (..., k) array, Dᵀz
    squares : (..., k) array, of what D would be if no parameter of the model were estimated
    """

    normal: Array
    right: Array
    squares: Array

    @classmethod
    def of(cls, frame: SessionFit, columns: Array) -> Equations:
        """Equations of derivatives (m, s, k), whitened, before the model is estimated."""
        residuals = frame.residuals
        d = residuals.project(columns.reshape(len(columns), -1)).reshape(columns.shape)
        return cls(
            np.einsum("msk,msl->skl", d, d),
            np.einsum("msk,m->sk", d, residuals.z),
            np.sum(columns**2, axis=0),
        )

    @classmethod
    def pooled(cls, each: Iterable[Equations]) -> Equations:
        """Equations of all campaigns as one."""
        normal, right, squares = (np.sum(parts, axis=0) for parts in zip(*each, strict=True))
        return cls(normal, right, squares)

    def visible(self) -> tuple[Array, Array]:
        """Combinations of the parameters that show, and how much each of them does.

        Returns
        -------
        directions : (k, l) array
        values : (l,) array, of the normal matrix in these directions
        """
        scale = np.sqrt(np.where(self.squares > 0, self.squares, 1.0))
        values, vectors = np.linalg.eigh(self.normal / np.outer(scale, scale))
        seen = values > RULES.visible**2
        return vectors[:, seen] / scale[:, None], values[seen]


class ShapeEquations(NamedTuple):
    """The shapes of an effect in the residuals of a campaign.

    Attributes
    ----------
    specs : tuple of str, the effect in each of its shapes
    settings : (s, q) array, those of the shapes
    each : Equations, (s, ...) arrays, in units of the noise
    """

    specs: tuple[str, ...]
    settings: Array
    each: Equations

    @classmethod
    def of(cls, frame: SessionFit, effects: Sequence[Effect], variance: float) -> ShapeEquations:
        """Equations of shapes of an effect, by a campaign with this variance of unit weight."""
        columns = frame.residuals.whiten(frame.signatures(effects))
        each = Equations.of(frame, columns.reshape(len(columns), len(effects), -1))
        return cls(
            tuple(effect.spec for effect in effects),
            np.array([[*effect.settings.values()] for effect in effects], dtype=float),
            Equations(*(part / variance for part in each)),
        )

    def nearest(self, settings: Array) -> Equations | None:
        """Return the equations of the shape with these settings, or nearly so."""
        best = 0
        if settings.size:
            with np.errstate(divide="ignore", invalid="ignore"):
                apart = np.max(abs(np.nan_to_num(np.log(self.settings / settings))), axis=1)
            best = int(np.argmin(apart))
            if apart[best] >= MAX_LOG_DIFFERENCE:
                return None
        return Equations(*(part[best] for part in self.each))


class SensorEquations(NamedTuple):
    """Normal equations of a sensor for the parameters of some effects, side by side.

    Attributes
    ----------
    equations : Equations
    square : float, ‖z‖²
    redundancy : int
    """

    equations: Equations
    square: float = 0.0
    redundancy: int = 0


def sensor_equations(sensor: Sensor, specs: Sequence[str]) -> SensorEquations:
    """Set up the equations of a sensor for some effects; zeros where it cannot show one."""
    effects = [get_effect(spec) for spec in specs]
    if sensor.model is None:
        k = sum(len(effect.parameters) for effect in effects)
        return SensorEquations(Equations(np.zeros((k, k)), np.zeros(k), np.zeros(k)))
    frame = SessionFit.of(sensor.fit().solution)
    residuals, columns = frame.residuals, []
    for effect in effects:
        try:
            columns.append(frame.rows(effect))
        except InputError:  # a column is absent
            columns.append(np.zeros((len(residuals.z), len(effect.parameters))))
    side_by_side = Equations.of(frame, np.concatenate(columns, axis=1)[:, None])
    equations = Equations(*(part[0] for part in side_by_side))
    return SensorEquations(equations, float(residuals.z @ residuals.z), residuals.redundancy)


# --- one size of all sensors --------------------------------------------------------------------


class PooledEffect(NamedTuple):
    """An effect in all campaigns together.

    Attributes
    ----------
    odds : float, log odds that it is equally large in all sensors, against nothing
    spec : str, its most probable shape
    """

    odds: float
    spec: str


def weigh_pooled(used: Sequence[SensorEvidence]) -> dict[str, PooledEffect]:
    """Weigh each effect by all campaigns as one: the normal equations of residuals are added.

    Settings of an effect are those of the first campaign that shows it, or nearly so.

    Parameters
    ----------
    used : of the sensors that count
    """
    redundancy = sum(each.redundancy for each in used)
    evidence = Evidence(Level((1.0,), (RULES.freedom_given,), known=True), redundancy)
    square = sum(each.square for each in used)
    nothing = float(evidence.noise_density(square)[0])
    joint = {}
    for name in sorted({name for each in used for name in each.shown}):
        shown, logs = [each.shown[name] for each in used if name in each.shown], {}
        for spec, settings in zip(shown[0].specs, shown[0].settings, strict=True):
            near = [one for shapes in shown if (one := shapes.nearest(settings)) is not None]
            if 2 * len(near) <= len(used):
                continue
            pooled = Equations.pooled(near)
            directions, values = pooled.visible()
            if dim := len(values):
                part = float(np.sum((pooled.right @ directions) ** 2 / values))
                logs[spec] = float(evidence.spaces_density(np.array([part]), [dim], square)[0])
        if logs:
            odds = float(log_mean(np.array([*logs.values()]))) - nothing
            joint[name] = PooledEffect(odds, max(logs, key=lambda spec: logs[spec]))
    return joint


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
        each: Sequence[SensorEquations],
        specs: Mapping[str, str],
        asked: Sequence[Names],
        usual: Sequence[int],
    ) -> TypeSizes:
        """Gather the equations of sensors.

        The noise is that which the one or two effects leave that explain most.

        Parameters
        ----------
        each : what the sensors tell of `specs`, side by side
        specs, asked, usual : as above
        """
        normal, right, _ = map(np.array, zip(*(one.equations for one in each), strict=True))
        pooled = Equations.pooled(one.equations for one in each)
        ends = np.cumsum([0, *(len(get_effect(spec).parameters) for spec in specs.values())])
        turned, columns, place = [], dict[str, NDArray[np.int_]](), 0
        for name, first, end in zip(specs, ends[:-1], ends[1:], strict=True):
            block = slice(first, end)
            shown = Equations(
                pooled.normal[block, block], pooled.right[block], pooled.squares[block]
            )
            directions, values = shown.visible()
            # In these directions and units the sensors together tell as much of each.
            turned.append(np.zeros((ends[-1], len(values))))
            turned[-1][block] = directions / np.sqrt(values / len(each))
            columns[name] = place + np.arange(len(values))
            place += len(values)
        turn = np.concatenate(turned, axis=1)
        raw = cls(specs, asked, turn.T @ normal @ turn, right @ turn, columns, np.array([*usual]))
        counted = [each[i] for i in usual]
        variance = raw.only(usual)._variance(
            sum(one.square for one in counted), sum(one.redundancy for one in counted)
        )
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
