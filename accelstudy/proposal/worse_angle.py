"""The criterion of the worse of roll and pitch, for an accuracy that both angles must reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.optimal.criteria import RIDGE, Criterion
from accelstudy.design.optimal.task import Task

Array = NDArray[np.float64]

POWER = 16
"""Of the mean that stands for the larger of the two: it has a derivative also where both are equal,
and where one is larger, it is below that one by ln 2 / 16, 4 %, at most."""


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
        cofactors = np.linalg.inv(self._block(normal))
        roll, pitch = (POWER * np.log(np.sum(w * cofactors, axis=(-2, -1))) for w in self.weights)
        return np.asarray((np.logaddexp(roll, pitch) - np.log(2)) / POWER)

    def gradient(self, normal: Array) -> Array:
        """− N⁻¹ W N⁻¹, where the form W is nearly that of the worse angle."""
        cofactors = np.linalg.inv(self._block(normal))
        squares = np.sum(self.weights * cofactors, axis=(-2, -1))
        shares = squares ** (POWER - 1) / np.sum(squares**POWER)
        weight = np.einsum("a,auw->uw", shares, self.weights)
        result = np.zeros_like(normal)
        result[np.ix_(self.estimated, self.estimated)] = -cofactors @ weight @ cofactors
        return result

    def _block(self, normal: Array) -> Array:
        kept = np.flatnonzero(self.estimated)
        return np.asarray(normal[..., kept[:, None], kept] + RIDGE * np.eye(len(kept)))


def worse_angle(task: Task) -> WorseAngle:
    """Return the criterion for a task."""
    kept = np.flatnonzero(task.estimated)
    return WorseAngle(task.estimated, task.tilt_weights[:, kept[:, None], kept])
