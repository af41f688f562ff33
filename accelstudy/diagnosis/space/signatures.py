"""What an effect would leave in the observations: its signature, from its one definition."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects import Effect, Hold

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Signature:
    """Derivatives of the observations by the k parameters of an effect, at zero.

    Attributes
    ----------
    force : (n, 3, k) array, of the sensor's output
    angles : (n, 2, k) array, of the robot's reading
    """

    force: Array
    angles: Array

    def reduced(self, directions: Array) -> Signature:
        """Signature of combinations of the parameters, `directions` (k, l)."""
        return Signature(self.force @ directions, self.angles @ directions)


class _Columns:
    """The columns of a `Hold`; one that is absent raises `InputError` when a formula uses it."""

    def __init__(self, hold: Hold) -> None:
        self._hold = hold

    def __getattr__(self, name: str) -> Array:
        return self._hold.column(name)

    def lagged(self, tau: float) -> Array:
        return self._hold.lagged(tau)


def signature(effect: Effect, forces: Array, angles: Array, g: float, hold: Hold) -> Signature:
    """Evaluate an effect for the unit vectors of its parameters, in which it is linear.

    Parameters
    ----------
    effect : Effect
    forces : (n, 3) array, m/s², in sensor axes
    angles : (n, 2) array, rad, attitude
    g : float, m/s²
    hold : Hold

    Raises
    ------
    InputError
        If the effect needs a column that the holds lack.
    """
    n, k = len(forces), len(effect.parameters)
    columns = _Columns(hold)
    f = (forces[:, 0], forces[:, 1], forces[:, 2])
    attitude = (angles[:, 0], angles[:, 1])
    force, reading = np.zeros((n, 3, k)), np.zeros((n, 2, k))
    for j, p in enumerate(np.eye(k)):
        for i, value in enumerate(effect.output(f, tuple(p), g, columns, np)):
            force[:, i, j] = value
        force[:, :, j] -= forces @ np.array(effect.axes(tuple(p), np), dtype=float).T
        for i, value in enumerate(effect.reading(attitude, tuple(p), columns, np)):
            reading[:, i, j] = value
    return Signature(force, reading)
