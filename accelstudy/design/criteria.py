"""Criteria by which one choice of positions is better than another.

A criterion is the logarithm of a variance, or of a determinant of variances, as a function of the
scaled normal matrix. It is to be minimised, and its differences are relative. Its derivative by
that matrix serves to rank and to move positions. All criteria but the one with neglected effects
are convex, so they have a lower bound (`continuous`); that one takes its bound from another.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import UnknownNameError
from accelstudy.design.task import Task

Array = NDArray[np.float64]

RIDGE = 1e-12
"""Added to scaled normal matrices, so that a singular one gives a huge variance, not an error."""
INVISIBLE = 1e-8
"""Scaled information below which an effect does not show."""
POWER = 16
"""Exponent of the power mean that stands for the larger of several mean squares."""
MINIMAX, ROBUST = "minimax", "robust"
CRITERIA = ("I", "D", "A", MINIMAX)


class Criterion(ABC):
    """A criterion.

    Attributes
    ----------
    name : str
    text : str, what it minimises, for people
    estimated : (u,) array of bool, which parameters the model has
    """

    name: str
    text: str
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

    name: str = "D"
    text: str = "determinant of the covariance matrix of the parameters"

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
class MeanSquare(Criterion):
    """A mean square of errors, or the larger one of several, as their power mean.

    The positions determine the estimated parameters, of normal matrix N₁₁. Neglected parameters p
    of variances P shift these by N₁₁⁻¹ N₁₂ p, and are missing themselves. With Z = (N₁₁⁻¹ N₁₂; −I)
    and a form W the mean square is tr(W₁₁ N₁₁⁻¹) + tr(W Z P Zᵀ).

    A power mean has a derivative also where two mean squares are equal; where one is larger, it is
    below that one by ln 2 / 16, 4 %, at most. A power mean of log-convex functions is log-convex,
    and never above the larger one, so its lower bound holds for that one, too.

    Attributes
    ----------
    name, text, estimated : see `Criterion`
    forms : (a, u, u) array, W of each mean square
    variance : (q,) array, diagonal of P; empty if nothing is neglected
    """

    name: str
    text: str
    estimated: NDArray[np.bool_]
    forms: Array
    variance: Array = field(default_factory=lambda: np.zeros(0))

    def value(self, normal: Array) -> Array:
        """Logarithm of the mean square, or of the power mean."""
        logs = POWER * np.log(self._squares(*self._solved(normal)))
        return np.asarray((np.logaddexp.reduce(logs) - np.log(len(logs))) / POWER)

    def gradient(self, normal: Array) -> Array:
        """Derivative by the blocks N₁₁ and N₁₂; the criterion does not depend on N₂₂."""
        cofactors, shift = self._solved(normal)
        squares = self._squares(cofactors, shift)
        relative = squares / squares.max()
        shares = relative ** (POWER - 1) / np.sum(relative**POWER) / squares.max()
        w = (shares @ self._w.reshape(len(shares), -1)).reshape(cofactors.shape)
        slope = -cofactors @ w @ cofactors
        if not len(self.variance):
            return _placed(slope, self.estimated)
        kept, left = self._places
        w12 = np.tensordot(shares, self.forms, 1)[np.ix_(kept, left)]
        by_shift = cofactors @ ((w @ shift - w12) * self.variance)
        part = by_shift @ shift.T
        result = _placed(slope - part - part.T, self.estimated)
        result[np.ix_(kept, left)] = by_shift
        result[np.ix_(left, kept)] = by_shift.T
        return result

    @property
    def convex(self) -> Criterion:
        """The part of the estimated parameters."""
        return replace(self, variance=np.zeros(0))

    def bound(self, convex: float) -> float:
        """Add the part that no shift of the estimates can compensate: W₂₂ − W₂₁ W₁₁⁻¹ W₁₂."""
        if not len(self.variance):
            return convex
        kept, left = self._places
        (form,) = self.forms
        w12 = form[np.ix_(kept, left)]
        inverse = np.linalg.pinv(form[np.ix_(kept, kept)], rcond=1e-9, hermitian=True)
        remains = np.maximum(np.diag(form)[left] - np.sum(w12 * (inverse @ w12), axis=0), 0.0)
        return float(np.log(np.exp(convex) + np.sum(remains * self.variance)))

    @cached_property
    def _places(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        """Places of the estimated and of the neglected parameters in a normal matrix."""
        return np.flatnonzero(self.estimated), np.flatnonzero(~self.estimated)

    @cached_property
    def _w(self) -> Array:
        """W₁₁ of each mean square."""
        kept = self._places[0]
        return self.forms[:, kept[:, None], kept]

    def _solved(self, normal: Array) -> tuple[Array, Array]:
        """N₁₁⁻¹, and the shifts N₁₁⁻¹ N₁₂ that neglected parameters cause."""
        kept, left = self._places
        cofactors: Array = np.asarray(np.linalg.inv(_kept(normal, self.estimated)), dtype=float)
        if not len(self.variance):
            return cofactors, np.zeros((len(kept), 0))
        return cofactors, cofactors @ normal[..., kept[:, None], left]

    def _squares(self, cofactors: Array, shift: Array) -> Array:
        """Mean squares, (a, ...)."""
        flat = cofactors.reshape(*cofactors.shape[:-2], -1)
        squares = np.asarray(self._w.reshape(len(self._w), -1) @ flat.T)
        if not len(self.variance):
            return squares
        kept, left = self._places
        for i, form in enumerate(self.forms):
            by_shift = np.einsum("...ik,ij,...jk->...k", shift, self._w[i], shift, optimize=True)
            cross = np.einsum("...ik,ik->...k", shift, form[np.ix_(kept, left)])
            missing = by_shift - 2 * cross + np.diag(form)[left]
            squares[i] += np.sum(missing * self.variance, axis=-1)
        return squares


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

    name: str = "discriminate"
    text: str = "mean square of the sizes at which the two effects can be told from each other"

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
    """Return a criterion by its name, of `CRITERIA` or robust, for a task."""
    estimated, forms = task.estimated, task.tilt_weights
    mean = forms.mean(axis=0)[None]
    use = "roll and pitch over the tilt range"
    criteria: dict[str, Criterion] = {
        "I": MeanSquare("I", f"mean variance of {use}", estimated, mean),
        "D": Determinant(estimated),
        "A": MeanSquare(
            "A", "mean variance of the scaled parameters", estimated, np.diag(estimated * 1.0)[None]
        ),
        MINIMAX: MeanSquare(
            MINIMAX,
            "variance of roll or of pitch over the tilt range, whichever is larger",
            estimated,
            forms,
        ),
        ROBUST: MeanSquare(
            ROBUST,
            "mean square of roll and pitch, the neglected effects included",
            estimated,
            mean,
            task.neglected_variance,
        ),
    }
    if name not in criteria:
        raise UnknownNameError("criterion", name, criteria)
    return criteria[name]


def rivals(task: Task, first: str, second: str) -> Rivals:
    """Return the criterion that tells two effects apart, both of which the task neglects."""
    owner = [e.spec for e in task.extended.effects for _ in e.parameters]
    owner += [""] * (len(task.names) - len(owner))
    masks = [np.array([o == spec for o in owner]) for spec in (first, second)]
    return Rivals(task.estimated, masks[0], masks[1])


@cache
def _ridge(u: int) -> Array:
    return RIDGE * np.eye(u)


def _ridged(normal: Array) -> Array:
    return normal + _ridge(normal.shape[-1])


def _kept(normal: Array, chosen: NDArray[np.bool_]) -> Array:
    if not chosen.all():
        places = np.flatnonzero(chosen)
        normal = normal[..., places[:, None], places]
    return _ridged(normal)


def _placed(block: Array, chosen: NDArray[np.bool_]) -> Array:
    if chosen.all():
        return block
    whole = np.zeros((len(chosen), len(chosen)))
    whole[np.ix_(chosen, chosen)] = block
    return whole
