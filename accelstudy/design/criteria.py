"""Criteria by which one choice of positions is better than another.

A criterion is the logarithm of a variance, or of a determinant of variances, as a function of the
scaled normal matrix N. It is to be minimised, and its differences are relative. Its derivative by
that matrix serves to rank and to move positions, and to bound what others can reach.

The mean square of a form W of the errors is s = tr(W C), with the cofactors C = N⁻¹, and from
dC = −C dN C follows ∂s/∂N = −C W C. The inverse of a mean square, and the root of degree d of a
determinant, are concave functions of N. So derivatives G = ∂φ/∂N at any N bound the criterion at
all sets of n positions (general equivalence theorem, Kiefer & Wolfowitz 1960, Whittle 1973):

    φ ≥ φ(N) − d log(1 + (tr G (N − N₀) − n min gⱼ) / d),  gⱼ = tr(G Iⱼ),

with N₀ what is known before the first position.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import check_name
from accelstudy.design.task import Task

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


@dataclass(frozen=True)
class Criterion:
    """The mean square of errors of a calibration, or the power mean of several.

    Attributes
    ----------
    name : str
    text : str, what it minimises, for people
    forms : (a, u, u) array, W of each mean square
    power : int, of the power mean
    degree : int, of e^criterion as a function of the variances
    """

    name: str
    text: str
    forms: Array
    power: int = 1
    degree: int = 1

    def squares(self, inverse: Array) -> Array:
        """Mean squares, (a, ...), of cofactor matrices (..., u, u)."""
        flat = inverse.reshape(*inverse.shape[:-2], -1)
        return np.asarray(self.forms.reshape(len(self.forms), -1) @ flat.T)

    def value(self, normal: Array) -> Array:
        """Values, (...), of normal matrices (..., u, u)."""
        logs = np.log(self.squares(cofactors(normal)))
        mean = np.logaddexp.reduce(self.power * logs) - np.log(len(logs))
        return np.asarray(mean / self.power)

    def gradient(self, normal: Array) -> Array:
        """Derivative by symmetric normal matrices (..., u, u), symmetric."""
        inverse = cofactors(normal)
        squares = self.squares(inverse)
        relative = squares / squares.max(axis=0)
        weights = relative**self.power / np.sum(relative**self.power, axis=0) / squares
        return np.asarray(-inverse @ np.tensordot(weights, self.forms, (0, 0)) @ inverse)

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


class Determinant(Criterion):
    """D: the volume of the confidence ellipsoid of the parameters."""

    def value(self, normal: Array) -> Array:
        """Log-determinant of the covariance matrix."""
        return np.asarray(-np.linalg.slogdet(_above_ridge(normal))[1])

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹."""
        return -cofactors(normal)


def cofactors(normal: Array) -> Array:
    """Inverses of normal matrices (..., u, u)."""
    return np.asarray(np.linalg.inv(_above_ridge(normal)), dtype=float)


def _above_ridge(normal: Array) -> Array:
    return normal + RIDGE * np.eye(normal.shape[-1])


def get_criterion(name: str, task: Task) -> Criterion:
    """Return a criterion by its name."""
    check_name("criterion", name, TEXTS)
    angles = task.tilt_weights
    forms = {"I": angles.mean(axis=0)[None], MINIMAX: angles}
    u = len(task.names)
    kinds = {"D": (Determinant, 1, u), MINIMAX: (Criterion, POWER, 1)}
    kind, power, degree = kinds.get(name, (Criterion, 1, 1))
    return kind(name, TEXTS[name], forms.get(name, np.eye(u)[None]), power, degree)


def rms_tilt(task: Task, directions: ArrayLike) -> Array:
    """Expected rms of roll and of pitch, rad, (2,), without the noise of the leveled reading.

    Infinite where the positions do not determine the model.
    """
    if not task.information(directions).determined:
        return np.full(2, np.inf)
    return np.sqrt(get_criterion(MINIMAX, task).squares(cofactors(task.normal(directions))))
