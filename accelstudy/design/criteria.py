"""Criteria by which one choice of positions is better than another.

A criterion is the logarithm of a variance, or of a determinant of variances, as a function of the
scaled normal matrix N. It is to be minimised, and its differences are relative. Its derivative by
that matrix serves to rank and to move positions.

A calibration estimates some of the parameters, with the cofactors C = N₁₁⁻¹ (and zeros elsewhere).
Neglected parameters p of variances P shift these estimates by C N p and are missing themselves, so
with E = (C N − I) in their columns all errors have the covariance C + E P Eᵀ. For a form W, whose
mean square is s = tr(W C) + tr(W E P Eᵀ), follow from dC = −C dN C and dE = −C dN E

    ∂s/∂N = −C W C − C W E P Eᵀ − E P Eᵀ W C.

All criteria but the one with neglected effects are convex, so they have a lower bound
(`continuous`); that one takes its bound from another.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

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


@dataclass(frozen=True)
class Estimator:
    """A calibration whose errors count: what it estimates, and what it neglects.

    Attributes
    ----------
    estimated : (k,) array of int, places of its parameters in a normal matrix
    forms : (a, u, u) array, W of each mean square of errors
    neglected : (q,) array of int, places of the neglected parameters
    variance : (q,) array, diagonal of P
    """

    estimated: NDArray[np.int_]
    forms: Array
    neglected: NDArray[np.int_] = field(default_factory=lambda: np.zeros(0, dtype=int))
    variance: Array = field(default_factory=lambda: np.zeros(0))

    @cached_property
    def _ridge(self) -> Array:
        return RIDGE * np.eye(len(self.estimated))

    @cached_property
    def _flat(self) -> Array:
        return self.forms.reshape(len(self.forms), -1)

    @cached_property
    def _block(self) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
        return self.estimated[:, None], self.estimated

    def part(self, normal: Array) -> Array:
        """Normal matrix of the estimated parameters, (..., k, k)."""
        if len(self.estimated) < normal.shape[-1]:
            normal = normal[..., *self._block]
        return normal + self._ridge

    def cofactors(self, normal: Array) -> Array:
        """C, (..., u, u)."""
        inverse = np.asarray(np.linalg.inv(self.part(normal)), dtype=float)
        if inverse.shape == normal.shape:
            return inverse
        whole = np.zeros(normal.shape)
        whole[..., *self._block] = inverse
        return whole

    def covariances(self, normal: Array) -> tuple[Array, Array | None]:
        """C and E P Eᵀ, (..., u, u); None if nothing is neglected."""
        cofactors = self.cofactors(normal)
        if not len(self.neglected):
            return cofactors, None
        errors = (cofactors @ normal - np.eye(normal.shape[-1]))[..., self.neglected]
        return cofactors, (errors * self.variance) @ errors.swapaxes(-1, -2)

    def squares(self, cofactors: Array, shifts: Array | None) -> Array:
        """Mean squares, (a, ...)."""
        covariance = cofactors if shifts is None else cofactors + shifts
        return np.asarray(self._flat @ covariance.reshape(*cofactors.shape[:-2], -1).T)

    def gradient(self, cofactors: Array, shifts: Array | None, weights: Array) -> Array:
        """Derivative of Σ weightₐ squareₐ by normal matrices (..., u, u), symmetric."""
        left = cofactors @ np.tensordot(weights, self.forms, (0, 0))
        slope = -left @ cofactors
        if shifts is not None:
            by_shifts = left @ shifts
            slope -= by_shifts + by_shifts.swapaxes(-1, -2)
        return np.asarray(slope)


@dataclass(frozen=True)
class Criterion:
    """The mean square of errors, or the power mean of several.

    A high power stands for the larger one. It has a derivative also where two mean squares are
    equal; where one is larger, it is below that one by ln 2 / 16, 4 %, at most. A power mean of
    log-convex functions is log-convex, and never above the larger one, so its lower bound holds for
    that one, too.

    Attributes
    ----------
    name : str
    text : str, what it minimises, for people
    estimators : tuple of Estimator, whose parameters the positions must determine
    power : int, of the power mean
    """

    name: str
    text: str
    estimators: tuple[Estimator, ...]
    power: int = 1

    @property
    def degree(self) -> int:
        """Degree of e^criterion as a function of the variances."""
        return 1

    def squares(self, normal: Array) -> Array:
        """All mean squares, (a, ...)."""
        each = [one.squares(*one.covariances(normal)) for one in self.estimators]
        return each[0] if len(each) == 1 else np.concatenate(each)

    def value(self, normal: Array) -> Array:
        """Values, (...), of normal matrices (..., u, u)."""
        squares = self.squares(normal)
        if len(squares) == 1:
            return np.asarray(np.log(squares[0]))
        logs = self.power * np.log(squares)
        return np.asarray((np.logaddexp.reduce(logs) - np.log(len(logs))) / self.power)

    def gradient(self, normal: Array) -> Array:
        """Derivative by symmetric normal matrices (..., u, u), symmetric."""
        errors = [one.covariances(normal) for one in self.estimators]
        squares = [one.squares(*at) for one, at in zip(self.estimators, errors, strict=True)]
        whole = np.concatenate(squares)
        largest = whole.max(axis=0)
        relative = whole / largest
        weights = relative ** (self.power - 1) / np.sum(relative**self.power, axis=0) / largest
        slope, first = np.zeros_like(normal), 0
        for one, at in zip(self.estimators, errors, strict=True):
            slope += one.gradient(*at, weights[first : first + len(one.forms)])
            first += len(one.forms)
        return slope

    def efficiency(self, value: float, best: float) -> float:
        """Share of the positions that would suffice if the bound were reached."""
        return float(np.exp((best - value) / self.degree))

    @property
    def convex(self) -> Criterion:
        """A convex criterion that is never above this one: that of the estimated parameters."""
        alone = (Estimator(each.estimated, each.forms) for each in self.estimators)
        return replace(self, estimators=tuple(alone))

    def bound(self, convex: float) -> float:
        """Lower bound of this criterion, given that of `convex`.

        What no shift of the estimates can compensate is added: W₂₂ − W₂₁ W₁₁⁻¹ W₁₂.
        """
        one = self.estimators[0]
        if not len(one.neglected):
            return convex
        form, (rows, columns) = one.forms[0], one._block
        inverse = np.linalg.pinv(form[rows, columns], rcond=1e-9, hermitian=True)
        across = form[rows, one.neglected]
        remains = np.diag(form)[one.neglected] - np.sum(across * (inverse @ across), axis=0)
        return float(np.log(np.exp(convex) + np.sum(np.maximum(remains, 0.0) * one.variance)))


class Determinant(Criterion):
    """D: the volume of the confidence ellipsoid of the estimated parameters."""

    @property
    def degree(self) -> int:
        """The determinant has one of each parameter."""
        return len(self.estimators[0].estimated)

    def value(self, normal: Array) -> Array:
        """Log-determinant of the covariance matrix."""
        return np.asarray(-np.linalg.slogdet(self.estimators[0].part(normal))[1])

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹."""
        return -self.estimators[0].cofactors(normal)


def get_criterion(name: str, task: Task) -> Criterion:
    """Return a criterion by its name, of `CRITERIA` or for effects that the task neglects.

    Robust takes these into account. Discriminate is for two of them, which are to be told apart: it
    is the mean square of their MIBs, the sizes from which they are seen. Only the part of a
    signature counts that neither the model nor the rival can imitate, so each parameter is one of a
    calibration with both, without the other parameters of its effect.
    """
    places, left = np.flatnonzero(task.estimated), np.flatnonzero(~task.estimated)
    unit, angles = np.eye(len(task.names)), task.tilt_weights
    mean, own = angles.mean(axis=0)[None], np.diag(task.estimated * 1.0)[None]
    if name == DISCRIMINATE:
        first, second = (task.places(effect) for effect in task.neglected)
        text = "mean square of the sizes at which the two effects can be told from each other"
        pairs = [(rival, one) for mine, rival in ((first, second), (second, first)) for one in mine]
        parts = (Estimator(np.array([*places, *r, i]), np.diag(unit[i])[None]) for r, i in pairs)
        return Criterion(name, text, tuple(parts))
    if name == ROBUST:
        text = "mean square of roll and pitch, the neglected effects included"
        return Criterion(name, text, (Estimator(places, mean, left, task.neglected_sigmas**2),))
    known: dict[str, tuple[str, Array]] = {
        "I": ("mean variance of roll and pitch over the tilt range", mean),
        "D": ("determinant of the covariance matrix of the parameters", own),
        "A": ("mean variance of the scaled parameters", own),
        MINIMAX: ("variance of roll or of pitch over the tilt range, whichever is larger", angles),
    }
    if name not in known:
        raise UnknownNameError("criterion", name, (*CRITERIA, ROBUST))
    text, forms = known[name]
    kind = Determinant if name == "D" else Criterion
    return kind(name, text, (Estimator(places, forms),), POWER if name == MINIMAX else 1)
