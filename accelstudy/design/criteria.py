"""Criteria by which one choice of positions is better than another.

A criterion is the logarithm of a variance, or of a determinant of variances, as a function of the
scaled normal matrix. It is to be minimised, and its differences are relative. Its derivative by
that matrix serves to rank and to move positions. All criteria but the one with neglected effects
are convex, so they have a lower bound (`continuous`); that one takes its bound from another.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import UnknownNameError
from accelstudy.design.task import Task

Array = NDArray[np.float64]

RIDGE = 1e-12
"""Added to scaled normal matrices, so that a singular one gives a huge variance, not an error."""
INVISIBLE = 1e-8
"""Scaled information below which an effect does not show."""


class Criterion(ABC):
    """A criterion.

    Attributes
    ----------
    name : str
    text : str, what it minimises, for people
    estimated : (u,) array of bool, which parameters the model has
    """

    name: ClassVar[str]
    text: ClassVar[str]
    estimated: NDArray[np.bool_]

    @abstractmethod
    def value(self, normal: Array) -> Array:
        """Values, (...), of normal matrices (..., u, u)."""

    @abstractmethod
    def gradient(self, normal: Array) -> Array:
        """Derivative by a symmetric normal matrix (u, u), symmetric."""

    def efficiency(self, value: float, best: float) -> float:
        """Share of the positions that would suffice if the bound were reached."""
        return float(np.exp(best - value))

    @property
    def unknowns(self) -> int:
        """Number of parameters that the positions must determine."""
        return int(np.count_nonzero(self.estimated))

    @property
    def convex(self) -> Criterion:
        """A convex criterion that is never above this one."""
        return self

    def bound(self, convex: float) -> float:
        """Lower bound of this criterion, given that of `convex`."""
        return convex

    def blind(self, normal: Array) -> str:
        """What a normal matrix leaves undetermined beyond its rank; empty if nothing."""
        return ""


@dataclass(frozen=True)
class Determinant(Criterion):
    """D: the volume of the confidence ellipsoid of the estimated parameters.

    Attributes
    ----------
    estimated : (u,) array of bool
    """

    estimated: NDArray[np.bool_]

    name = "D"
    text = "determinant of the covariance matrix of the parameters"

    def value(self, normal: Array) -> Array:
        """Log-determinant of the covariance matrix."""
        return np.asarray(-np.linalg.slogdet(_kept(normal, self.estimated))[1])

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹."""
        return _placed(-np.asarray(np.linalg.inv(_kept(normal, self.estimated))), self.estimated)

    def efficiency(self, value: float, best: float) -> float:
        """Per parameter, as is usual."""
        return float(np.exp((best - value) / np.count_nonzero(self.estimated)))


@dataclass(frozen=True)
class WeightedVariance(Criterion):
    """A quadratic form of the errors of the estimated parameters: tr(W N⁻¹).

    Attributes
    ----------
    estimated : (u,) array of bool
    weight : (u, u) array W
    """

    estimated: NDArray[np.bool_]
    weight: Array

    def value(self, normal: Array) -> Array:
        """Logarithm of the mean square."""
        cofactors = np.linalg.inv(_kept(normal, self.estimated))
        weight = self.weight[np.ix_(self.estimated, self.estimated)]
        return np.asarray(np.log(np.sum(weight * cofactors, axis=(-2, -1))))

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹ W N⁻¹ / tr(W N⁻¹)."""
        cofactors = np.linalg.inv(_kept(normal, self.estimated))
        weight = self.weight[np.ix_(self.estimated, self.estimated)]
        slope = -cofactors @ weight @ cofactors / np.sum(weight * cofactors)
        return _placed(slope, self.estimated)


class MeanVariance(WeightedVariance):
    """A: the mean variance of the scaled parameters."""

    name = "A"
    text = "mean variance of the scaled parameters"


class Leveling(WeightedVariance):
    """I: the mean variance of roll and pitch over the tilt range."""

    name = "I"
    text = "mean variance of roll and pitch over the tilt range"


@dataclass(frozen=True)
class NeglectedEffect(Criterion):
    """The mean square of roll and pitch where effects of a given size are neglected.

    Neglected parameters p of variances P shift the estimates by N₁₁⁻¹ N₁₂ p, and are missing
    themselves. With Z = (N₁₁⁻¹ N₁₂; −I) the mean square is tr(W₁₁ N₁₁⁻¹) + tr(W Z P Zᵀ).

    Attributes
    ----------
    estimated : (u,) array of bool
    weight : (u, u) array W, of all parameters
    variance : (q,) array, diagonal of P
    """

    estimated: NDArray[np.bool_]
    weight: Array
    variance: Array

    name = "robust"
    text = "mean square of roll and pitch, the neglected effects included"

    def value(self, normal: Array) -> Array:
        """Logarithm of the mean square."""
        kept, left = np.flatnonzero(self.estimated), np.flatnonzero(~self.estimated)
        cofactors = np.linalg.inv(_kept(normal, self.estimated))
        shift = cofactors @ normal[..., kept[:, None], left]
        w, w12, w22 = (
            self.weight[np.ix_(i, j)] for i, j in ((kept, kept), (kept, left), (left,) * 2)
        )
        square = np.sum(w * cofactors, axis=(-2, -1)) + np.sum(np.diag(w22) * self.variance)
        square_of_shift = np.einsum("...ik,ij,...jk->...k", shift, w, shift, optimize=True)
        cross = np.einsum("...ik,ik->...k", shift, w12)
        return np.asarray(
            np.log(square + np.sum((square_of_shift - 2 * cross) * self.variance, axis=-1))
        )

    @property
    def convex(self) -> Criterion:
        """The variance alone."""
        return Leveling(self.estimated, self.weight)

    def bound(self, convex: float) -> float:
        """Add the part that no shift of the estimates can compensate: W₂₂ − W₂₁ W₁₁⁻¹ W₁₂."""
        kept, left = np.flatnonzero(self.estimated), np.flatnonzero(~self.estimated)
        w, w12 = self.weight[np.ix_(kept, kept)], self.weight[np.ix_(kept, left)]
        imitated = np.sum(w12 * (np.linalg.pinv(w, rcond=1e-9, hermitian=True) @ w12), axis=0)
        remains = np.maximum(np.diag(self.weight)[left] - imitated, 0.0)
        return float(np.log(np.exp(convex) + np.sum(remains * self.variance)))

    def gradient(self, normal: Array) -> Array:
        """Derivative by the blocks N₁₁ and N₁₂; the criterion does not depend on N₂₂."""
        kept, left = np.flatnonzero(self.estimated), np.flatnonzero(~self.estimated)
        cofactors = np.linalg.inv(_kept(normal, self.estimated))
        shift = cofactors @ normal[np.ix_(kept, left)]
        w, w12 = self.weight[np.ix_(kept, kept)], self.weight[np.ix_(kept, left)]
        by_shift = cofactors @ ((w @ shift - w12) * self.variance)
        part = by_shift @ shift.T
        result = np.zeros_like(normal)
        result[np.ix_(kept, kept)] = -cofactors @ w @ cofactors - part - part.T
        result[np.ix_(kept, left)] = by_shift
        result[np.ix_(left, kept)] = by_shift.T
        return np.asarray(result / np.exp(self.value(normal)))


@dataclass(frozen=True)
class Rivals(Criterion):
    """Size from which two effects can be told apart: their mean squared MIB.

    Only the part of a signature counts that neither the model nor the rival can imitate: the Schur
    complement l of the normal matrix. The MIB is proportional to 1/√l.

    Attributes
    ----------
    estimated : (u,) array of bool
    first, second : (u,) arrays of bool, parameters of the rivals
    """

    estimated: NDArray[np.bool_]
    first: NDArray[np.bool_]
    second: NDArray[np.bool_]

    name = "discriminate"
    text = "mean square of the sizes at which the two effects can be told from each other"

    def left(self, normal: Array) -> Array:
        """Part l of each parameter of the first effect, then of the second, (..., q)."""
        remainders = []
        for part, rest in self._parts():
            cross = normal[..., rest[:, None], part]
            inside = np.linalg.inv(_ridged(normal[..., rest[:, None], rest]))
            imitated = np.einsum("...ik,...ij,...jk->...k", cross, inside, cross, optimize=True)
            remainders.append(np.einsum("...kk->...k", normal[..., part[:, None], part]) - imitated)
        return np.maximum(np.concatenate(remainders, axis=-1), RIDGE)

    def value(self, normal: Array) -> Array:
        """Logarithm of the mean of 1/l."""
        return np.asarray(np.log(np.mean(1 / self.left(normal), axis=-1)))

    def gradient(self, normal: Array) -> Array:
        """− Σ v vᵀ / l² / Σ 1/l, where l = vᵀ N v."""
        weights = self.left(normal) ** -2
        vectors = []
        for part, rest in self._parts():
            v = np.zeros((len(normal), len(part)))
            v[part, np.arange(len(part))] = 1.0
            inside = _ridged(normal[np.ix_(rest, rest)])
            v[rest] -= np.linalg.solve(inside, normal[np.ix_(rest, part)])
            vectors.append(v)
        v = np.concatenate(vectors, axis=1)
        return np.asarray(-(v * weights) @ v.T / np.sum(np.sqrt(weights)))

    @property
    def unknowns(self) -> int:
        """Parameters of the model and of the larger rival, and one of the other rival."""
        rival = max(np.count_nonzero(self.first), np.count_nonzero(self.second))
        return int(np.count_nonzero(self.estimated) + rival + 1)

    def blind(self, normal: Array) -> str:
        """Whether a parameter of one effect looks like the other, or like nothing."""
        left = self.left(normal)
        return "they do not tell the two effects apart" if left.min() < INVISIBLE else ""

    def _parts(self) -> list[tuple[NDArray[np.int_], NDArray[np.int_]]]:
        pairs = ((self.first, self.second), (self.second, self.first))
        return [(np.flatnonzero(a), np.flatnonzero(self.estimated | b)) for a, b in pairs]


def get_criterion(name: str, task: Task) -> Criterion:
    """Return a criterion by its name, D, A, I or robust, for a task."""
    estimated = task.estimated
    weight = task.tilt_weights.mean(axis=0)
    criteria: dict[str, Criterion] = {
        "D": Determinant(estimated),
        "A": MeanVariance(estimated, np.diag(estimated * 1.0)),
        "I": Leveling(estimated, weight),
        "robust": NeglectedEffect(estimated, weight, task.neglected_variance),
    }
    if name not in criteria:
        raise UnknownNameError("criterion", name, criteria)
    return criteria[name]


def rivals(task: Task, first: str, second: str) -> Rivals:
    """Return the criterion that tells two effects apart, both of which the task neglects."""
    owner = [e.spec for e in task.extended.effects for _ in e.parameters]
    owner += [""] * (len(task.names) - len(owner))
    masks = [np.array([o == spec for o in owner]) for spec in (first, second)]
    return Rivals(task.estimated, *masks)


def _ridged(normal: Array) -> Array:
    return normal + RIDGE * np.eye(normal.shape[-1])


def _kept(normal: Array, chosen: NDArray[np.bool_]) -> Array:
    places = np.flatnonzero(chosen)
    return _ridged(normal[..., places[:, None], places])


def _placed(block: Array, chosen: NDArray[np.bool_]) -> Array:
    if chosen.all():
        return block
    whole = np.zeros((len(chosen), len(chosen)))
    whole[np.ix_(chosen, chosen)] = block
    return whole


POWER = 16
"""Exponent of the power mean that stands for the larger of the two. The mean has a derivative also
where both are equal; where one is larger, it is below that one by ln 2 / 16, 4 %, at most."""


@dataclass(frozen=True)
class WorseAngle(Criterion):
    """The larger of the mean variances of roll and of pitch, as a power mean of both.

    A power mean of log-convex functions is log-convex, and never above the larger one. So its lower
    bound holds for the worse angle, too.

    Attributes
    ----------
    estimated : (u,) array of bool
    weights : (2, u', u') array, quadratic forms of roll and of pitch, of the u' estimated ones
    """

    estimated: NDArray[np.bool_]
    weights: Array

    name = "minimax"
    text = "variance of roll or of pitch over the tilt range, whichever is larger"

    def value(self, normal: Array) -> Array:
        """Logarithm of the power mean of the two mean squares."""
        roll, pitch = POWER * np.log(self._squares(self._cofactors(normal)))
        return np.asarray((np.logaddexp(roll, pitch) - np.log(2)) / POWER)

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹ W N⁻¹, where the form W is nearly that of the worse angle."""
        cofactors = self._cofactors(normal)
        squares = self._squares(cofactors)
        shares = squares ** (POWER - 1) / np.sum(squares**POWER)
        weight = (shares @ self._flat).reshape(cofactors.shape)
        return _placed(-cofactors @ weight @ cofactors, self.estimated)

    @cached_property
    def _kept(self) -> Any:
        """Places of the estimated parameters in a normal matrix."""
        kept = np.flatnonzero(self.estimated)
        return ... if self.estimated.all() else (..., kept[:, None], kept)

    @cached_property
    def _flat(self) -> Array:
        return self.weights.reshape(2, -1)

    @cached_property
    def _ridge(self) -> Array:
        return RIDGE * np.eye(self.weights.shape[-1])

    def _cofactors(self, normal: Array) -> Array:
        return np.asarray(np.linalg.inv(normal[self._kept] + self._ridge))

    def _squares(self, cofactors: Array) -> Array:
        """Mean squares of roll and of pitch, (2, ...)."""
        return np.asarray(self._flat @ cofactors.reshape(*cofactors.shape[:-2], -1).T)


def worse_angle(task: Task) -> WorseAngle:
    """Return the criterion for a task."""
    kept = np.flatnonzero(task.estimated)
    return WorseAngle(task.estimated, task.tilt_weights[:, kept[:, None], kept])
