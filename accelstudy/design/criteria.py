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
POWER = 16
"""Exponent of the power mean that stands for the larger of several mean squares."""
MINIMAX, ROBUST, DISCRIMINATE = "minimax", "robust", "discriminate"
CRITERIA = ("I", "D", "A", MINIMAX)


class Criterion(ABC):
    """A criterion.

    Attributes
    ----------
    name : str
    text : str, what it minimises, for people
    wanted : tuple of (k,) int arrays, sets of parameters that positions must determine
    degree : int, of e^criterion as a function of the variances
    """

    name: str
    text: str
    wanted: tuple[NDArray[np.int_], ...]
    degree: int

    @abstractmethod
    def value(self, normal: Array) -> Array:
        """Values, (...), of normal matrices (..., u, u)."""

    @abstractmethod
    def gradient(self, normal: Array) -> Array:
        """Derivative by a symmetric normal matrix (u, u), symmetric."""

    def efficiency(self, value: float, best: float) -> float:
        """Share of the positions that would suffice if the bound were reached."""
        return float(np.exp((best - value) / self.degree))

    @property
    def convex(self) -> Criterion:
        """A convex criterion that is never above this one."""
        return self

    def bound(self, convex: float) -> float:
        """Lower bound of this criterion, given that of `convex`."""
        return convex


@dataclass(frozen=True)
class Determinant(Criterion):
    """D: the volume of the confidence ellipsoid of the estimated parameters.

    Attributes
    ----------
    places : (k,) array of int, of the estimated parameters in a normal matrix
    """

    places: NDArray[np.int_]

    name: str = "D"
    text: str = "determinant of the covariance matrix of the parameters"

    @property
    def wanted(self) -> tuple[NDArray[np.int_], ...]:  # type: ignore[override]
        """The estimated parameters."""
        return (self.places,)

    @property
    def degree(self) -> int:  # type: ignore[override]
        """The determinant has one of each parameter."""
        return len(self.places)

    def value(self, normal: Array) -> Array:
        """Log-determinant of the covariance matrix."""
        return np.asarray(-np.linalg.slogdet(_part(normal, self.places))[1])

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹."""
        slope = np.zeros_like(normal)
        slope[np.ix_(self.places, self.places)] = -np.linalg.inv(_part(normal, self.places))
        return slope


@dataclass(frozen=True)
class Adjusted:
    """A calibration whose mean squares count: what it estimates, and what it neglects.

    Attributes
    ----------
    places : (k,) array of int, of the estimated parameters in a normal matrix
    forms : (a, u, u) array, W of each mean square
    left : (q,) array of int, places of the neglected parameters
    variance : (q,) array, diagonal of P, of their mean squares
    """

    places: NDArray[np.int_]
    forms: Array
    left: NDArray[np.int_] = field(default_factory=lambda: np.zeros(0, dtype=int))
    variance: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def w11(self) -> Array:
        """W₁₁ of each mean square, (a, k, k)."""
        return self.forms[:, self.places[:, None], self.places]

    @cached_property
    def w12(self) -> Array:
        """W₁₂ of each mean square, (a, k, q)."""
        return self.forms[:, self.places[:, None], self.left]

    def solved(self, normal: Array) -> tuple[Array, Array]:
        """N₁₁⁻¹, and the shifts N₁₁⁻¹ N₁₂ that neglected parameters cause."""
        cofactors: Array = np.asarray(np.linalg.inv(_part(normal, self.places)), dtype=float)
        if not len(self.left):
            return cofactors, cofactors[..., :0]
        return cofactors, cofactors @ normal[..., self.places[:, None], self.left]

    def squares(self, cofactors: Array, shift: Array) -> Array:
        """Mean squares, (a, ...)."""
        flat = cofactors.reshape(*cofactors.shape[:-2], -1)
        squares = np.asarray(self.w11.reshape(len(self.w11), -1) @ flat.T)
        if len(self.left):
            for i, form in enumerate(self.forms):
                by_shift = np.einsum("...ik,...ik->...k", shift, self.w11[i] @ shift)
                cross = np.einsum("...ik,ik->...k", shift, self.w12[i])
                missing = by_shift - 2 * cross + np.diag(form)[self.left]
                squares[i] += np.sum(missing * self.variance, axis=-1)
        return squares

    def gradient(self, cofactors: Array, shift: Array, weights: Array) -> Array:
        """Derivative of Σ weightₐ squareₐ by the normal matrix; N₂₂ has no influence."""
        slope = np.zeros(self.forms.shape[1:])
        w = (weights @ self.w11.reshape(len(weights), -1)).reshape(cofactors.shape)
        inside = -cofactors @ w @ cofactors
        if len(self.left):
            w12 = np.tensordot(weights, self.w12, 1)
            by_shift = cofactors @ ((w @ shift - w12) * self.variance)
            inside -= by_shift @ shift.T + shift @ by_shift.T
            slope[np.ix_(self.places, self.left)] = by_shift
            slope[np.ix_(self.left, self.places)] = by_shift.T
        slope[np.ix_(self.places, self.places)] = inside
        return slope


@dataclass(frozen=True)
class MeanSquare(Criterion):
    """A mean square of errors, or the power mean of several.

    The positions determine the estimated parameters, of normal matrix N₁₁. Neglected parameters p
    of variances P shift these by N₁₁⁻¹ N₁₂ p, and are missing themselves. With Z = (N₁₁⁻¹ N₁₂; −I)
    and a form W the mean square is tr(W₁₁ N₁₁⁻¹) + tr(W Z P Zᵀ).

    A high power stands for the larger one. It has a derivative also where two mean squares are
    equal; where one is larger, it is below that one by ln 2 / 16, 4 %, at most. A power mean of
    log-convex functions is log-convex, and never above the larger one, so its lower bound holds for
    that one, too.

    Attributes
    ----------
    name, text : see `Criterion`
    parts : the calibrations of which the mean squares are
    power : int, of the power mean
    """

    name: str
    text: str
    parts: tuple[Adjusted, ...]
    power: int = 1

    degree = 1

    @property
    def wanted(self) -> tuple[NDArray[np.int_], ...]:  # type: ignore[override]
        """The parameters of each calibration."""
        return tuple(part.places for part in self.parts)

    def squares(self, normal: Array) -> Array:
        """All mean squares, (a, ...)."""
        return np.concatenate([part.squares(*part.solved(normal)) for part in self.parts])

    def value(self, normal: Array) -> Array:
        """Logarithm of the mean square, or of the power mean."""
        logs = self.power * np.log(self.squares(normal))
        return np.asarray((np.logaddexp.reduce(logs) - np.log(len(logs))) / self.power)

    def gradient(self, normal: Array) -> Array:
        """Derivative of the logarithm."""
        solved = [part.solved(normal) for part in self.parts]
        squares = [part.squares(*at) for part, at in zip(self.parts, solved, strict=True)]
        relative = np.concatenate(squares)
        largest = relative.max()
        relative = relative / largest
        weights = relative ** (self.power - 1) / np.sum(relative**self.power) / largest
        slope = np.zeros_like(normal)
        for part, at in zip(self.parts, solved, strict=True):
            own, weights = np.split(weights, [len(part.forms)])
            slope += part.gradient(*at, own)
        return slope

    @property
    def convex(self) -> Criterion:
        """The mean square of the estimated parameters."""
        return replace(self, parts=tuple(Adjusted(p.places, p.forms) for p in self.parts))

    def bound(self, convex: float) -> float:
        """Add the part that no shift of the estimates can compensate: W₂₂ − W₂₁ W₁₁⁻¹ W₁₂."""
        part = self.parts[0]
        if not len(part.left):
            return convex
        (w11,), (w12,), (form,) = part.w11, part.w12, part.forms
        inverse = np.linalg.pinv(w11, rcond=1e-9, hermitian=True)
        remains = np.diag(form)[part.left] - np.sum(w12 * (inverse @ w12), axis=0)
        return float(np.log(np.exp(convex) + np.sum(np.maximum(remains, 0.0) * part.variance)))


def get_criterion(name: str, task: Task) -> Criterion:
    """Return a criterion by its name, of `CRITERIA` or for effects that the task neglects.

    Robust takes these into account. Discriminate is for two of them, which are to be told apart: it
    is the mean square of their MIBs, the sizes from which they are seen. Only the part of a
    signature counts that neither the model nor the rival can imitate, so each parameter is one of a
    calibration with both, without the other parameters of its effect.
    """
    places, left = np.flatnonzero(task.estimated), np.flatnonzero(~task.estimated)
    forms, u = task.tilt_weights, len(task.names)
    mean = forms.mean(axis=0)[None]
    use = "roll and pitch over the tilt range"
    if name == "D":
        return Determinant(places)
    if name == DISCRIMINATE:
        first, second = (task.places(effect) for effect in task.neglected)
        return MeanSquare(
            name,
            "mean square of the sizes at which the two effects can be told from each other",
            tuple(
                Adjusted(np.array([*places, *rival, one]), np.diag(np.eye(u)[one])[None])
                for own, rival in ((first, second), (second, first))
                for one in own
            ),
        )
    criteria: dict[str, tuple[str, Adjusted]] = {
        "I": (f"mean variance of {use}", Adjusted(places, mean)),
        "A": (
            "mean variance of the scaled parameters",
            Adjusted(places, np.diag(task.estimated * 1.0)[None]),
        ),
        MINIMAX: (
            "variance of roll or of pitch over the tilt range, whichever is larger",
            Adjusted(places, forms),
        ),
        ROBUST: (
            "mean square of roll and pitch, the neglected effects included",
            Adjusted(places, mean, left, task.neglected_sigmas**2),
        ),
    }
    if name not in criteria:
        raise UnknownNameError("criterion", name, (*CRITERIA, ROBUST))
    text, part = criteria[name]
    return MeanSquare(name, text, (part,), POWER if name == MINIMAX else 1)


@cache
def _ridge(u: int) -> Array:
    return RIDGE * np.eye(u)


def _part(normal: Array, places: NDArray[np.int_]) -> Array:
    """Normal matrix of some of the parameters."""
    if len(places) < normal.shape[-1]:
        normal = normal[..., places[:, None], places]
    return normal + _ridge(len(places))
