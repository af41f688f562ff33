"""Criteria by which one choice of positions is better than another.

A criterion is the logarithm of a variance, or of a determinant of variances, as a function of the
scaled normal matrix N. It is to be minimised, and its differences are relative. Its derivative by
that matrix serves to rank and to move positions, and to bound what others can reach.

A calibration estimates some of the parameters, with the cofactors C = N₁₁⁻¹ (and zeros elsewhere).
Neglected parameters p of variances P shift these estimates by C N p and are missing themselves, so
with E = (C N − I) in their columns all errors have the covariance C + E P Eᵀ. For a form W, whose
mean square is s = tr(W C) + tr(W E P Eᵀ), follow from dC = −C dN C and dE = −C dN E

    ∂s/∂N = −C W C − C W E P Eᵀ − E P Eᵀ W C.

Where nothing is neglected, the inverse of a mean square, and the root of degree d of a determinant,
are concave functions of N. So derivatives G = ∂φ/∂N at any N bound the criterion at all sets of n
positions (general equivalence theorem, Kiefer & Wolfowitz 1960, Whittle 1973):

    φ ≥ φ(N) − d log(1 + (tr G (N − N₀) − n min gⱼ) / d),  gⱼ = tr(G Iⱼ),

with N₀ what is known before the first position.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.design.task import Task

Array = NDArray[np.float64]

RIDGE = 1e-12
"""Added to scaled normal matrices, so that a singular one gives a huge variance, not an error."""
POWER = 16
"""Exponent of the power mean that stands for the larger of two mean squares. It is below the larger
by ln 2 / 16, 4 %, at most, never above it, and has a derivative also where they are equal."""
MINIMAX = "minimax"
TEXTS = {
    "I": "mean variance of roll and pitch over the tilt range",
    "D": "determinant of the covariance matrix of the parameters",
    "A": "mean variance of the scaled parameters",
    MINIMAX: "variance of roll or of pitch over the tilt range, whichever is larger",
}
ROBUST = "mean square of roll and pitch, the neglected effects included"


@dataclass(frozen=True)
class Criterion:
    """The mean square of errors of a calibration, or the power mean of several.

    Attributes
    ----------
    name : str
    text : str, what it minimises, for people
    estimated : (k,) array of int, places of the estimated parameters in a normal matrix
    forms : (a, u, u) array, W of each mean square
    neglected : (q,) array of int, places of the neglected parameters
    variance : (q,) array, diagonal of P
    power : int, of the power mean
    """

    name: str
    text: str
    estimated: NDArray[np.int_]
    forms: Array
    neglected: NDArray[np.int_]
    variance: Array
    power: int = 1

    @property
    def degree(self) -> int:
        """Degree of e^criterion as a function of the variances."""
        return 1

    @cached_property
    def _ridge(self) -> Array:
        return RIDGE * np.eye(len(self.estimated))

    def part(self, normal: Array) -> Array:
        """Normal matrix of the estimated parameters, (..., k, k)."""
        if len(self.estimated) < normal.shape[-1]:
            normal = normal[..., self.estimated[:, None], self.estimated]
        return normal + self._ridge

    def cofactors(self, normal: Array) -> Array:
        """C, (..., u, u)."""
        inverse = np.asarray(np.linalg.inv(self.part(normal)), dtype=float)
        if inverse.shape == normal.shape:
            return inverse
        whole = np.zeros(normal.shape)
        whole[..., self.estimated[:, None], self.estimated] = inverse
        return whole

    def _errors(self, normal: Array) -> tuple[Array, Array | float]:
        """C and E P Eᵀ, (..., u, u); 0 if nothing is neglected."""
        cofactors = self.cofactors(normal)
        if not len(self.neglected):
            return cofactors, 0.0
        errors = (cofactors @ normal - np.eye(normal.shape[-1]))[..., self.neglected]
        return cofactors, (errors * self.variance) @ errors.swapaxes(-1, -2)

    def squares(self, normal: Array) -> Array:
        """Mean squares, (a, ...), of normal matrices (..., u, u)."""
        return self._squares(*self._errors(normal))

    def _squares(self, cofactors: Array, shifts: Array | float) -> Array:
        flat = (cofactors + shifts).reshape(*cofactors.shape[:-2], -1)
        return np.asarray(self.forms.reshape(len(self.forms), -1) @ flat.T)

    def value(self, normal: Array) -> Array:
        """Values, (...), of normal matrices (..., u, u)."""
        logs = np.log(self.squares(normal))
        if len(logs) == 1:
            return np.asarray(logs[0])
        mean = np.logaddexp.reduce(self.power * logs) - np.log(len(logs))
        return np.asarray(mean / self.power)

    def gradient(self, normal: Array) -> Array:
        """Derivative by symmetric normal matrices (..., u, u), symmetric."""
        cofactors, shifts = self._errors(normal)
        squares = self._squares(cofactors, shifts)
        relative = squares / squares.max(axis=0)
        weights = relative**self.power / np.sum(relative**self.power, axis=0) / squares
        left = cofactors @ np.tensordot(weights, self.forms, (0, 0))
        slope = -left @ cofactors
        if len(self.neglected):
            by_shifts = left @ shifts
            slope -= by_shifts + by_shifts.swapaxes(-1, -2)
        return np.asarray(slope)

    def efficiency(self, value: float, best: float) -> float:
        """Share of the positions that would suffice if the bound were reached."""
        return min(1.0, float(np.exp((best - value) / self.degree)))

    def bound(self, before: Array, normal: Array, n: int, least: float) -> float:
        """Lower bound for all sets of n positions, by the derivatives at one normal matrix.

        Parameters
        ----------
        before, normal : (u, u) arrays, N₀ and N
        n : int
        least : float, smallest gⱼ of the attitudes that are allowed
        """
        sum_of = float(np.sum(self.gradient(normal) * (normal - before)))
        further = max(sum_of - n * least, 0.0) / self.degree
        return float(self.value(normal)) - self.degree * float(np.log1p(further))

    @property
    def convex(self) -> Criterion:
        """The criterion without neglected effects: never above this one, and bounded."""
        return replace(self, neglected=np.zeros(0, dtype=int), variance=np.zeros(0))

    def with_neglected(self, bound: float) -> float:
        """Lower bound of this criterion, given that of `convex`.

        What no shift of the estimates can compensate is added: W₂₂ − W₂₁ W₁₁⁻¹ W₁₂.
        """
        if not len(self.neglected) or len(self.forms) > 1:
            return bound
        form, estimated = self.forms[0], self.estimated
        block = form[estimated[:, None], estimated]
        across = form[estimated[:, None], self.neglected]
        taken = across * (np.linalg.pinv(block, rcond=1e-9, hermitian=True) @ across)
        remains = np.diag(form)[self.neglected] - np.sum(taken, axis=0)
        return float(np.log(np.exp(bound) + np.sum(np.maximum(remains, 0.0) * self.variance)))


class Determinant(Criterion):
    """D: the volume of the confidence ellipsoid of the estimated parameters."""

    @property
    def degree(self) -> int:
        """The determinant has one of each parameter."""
        return len(self.estimated)

    def value(self, normal: Array) -> Array:
        """Log-determinant of the covariance matrix."""
        return np.asarray(-np.linalg.slogdet(self.part(normal))[1])

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹."""
        return -self.cofactors(normal)


def get_criterion(name: str, task: Task) -> Criterion:
    """Return a criterion by its name; those of the tilt take neglected effects into account."""
    if name not in TEXTS:
        raise UnknownNameError("criterion", name, TEXTS)
    angles, tilt = task.tilt_weights, name in ("I", MINIMAX)
    if task.neglected and not tilt:
        raise InputError(
            f"criterion {name}: effects that are neglected have a criterion of their own; leave it "
            "out"
        )
    forms = angles if name == MINIMAX else angles.mean(axis=0)[None]
    return (Determinant if name == "D" else Criterion)(
        {"I": "robust", MINIMAX: "robust minimax"}[name] if task.neglected else name,
        ROBUST if task.neglected and name == "I" else TEXTS[name],
        np.flatnonzero(task.estimated),
        forms if tilt else np.diag(task.estimated * 1.0)[None],
        np.flatnonzero(~task.estimated),
        task.neglected_sigmas**2,
        POWER if name == MINIMAX else 1,
    )


def rms_tilt(task: Task, directions: ArrayLike) -> Array:
    """Expected rms of roll and of pitch, rad, (2,), without the noise of the leveled reading.

    Neglected effects contribute as a scatter of their given size. Infinite where the positions do
    not determine the model.
    """
    estimated = np.flatnonzero(task.estimated)
    if task.information(directions).undetermined(estimated).any():
        return np.full(2, np.inf)
    return np.sqrt(get_criterion(MINIMAX, task).squares(task.normal(directions)))
