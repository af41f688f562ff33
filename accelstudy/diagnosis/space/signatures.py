"""The signature of an effect: what it would leave in the observations, from its one definition."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.effects import Effect, HoldConditions

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


class Columns:
    """The columns of a `HoldConditions` with further axes, for arrays of parameters or settings.

    A column that is absent raises `InputError` when a formula uses it. Each is computed once.

    Parameters
    ----------
    hold : HoldConditions
    axes : int, number of axes after that of the holds
    """

    def __init__(self, hold: HoldConditions, axes: int) -> None:
        self._hold, self._axes = hold, axes
        self._computed: dict[str | float, Array] = {}

    def __getattr__(self, name: str) -> Array:
        if name not in self._computed:
            values = self._hold.column(name)
            self._computed[name] = values.reshape(len(values), *[1] * self._axes)
        return self._computed[name]

    def lagged(self, tau: Array) -> Array:
        """Temperature behind each of some lags (s, 1), (n, s, 1)."""
        return np.stack([self._behind(t) for t in tau.ravel().tolist()], axis=1)[..., None]

    def _behind(self, tau: float) -> Array:
        """Temperature behind a lag, (n,)."""
        if tau not in self._computed:
            self._computed[tau] = self._hold.lagged(tau)
        return self._computed[tau]


def signature(
    effect: Effect, forces: Array, angles: Array, g: float, hold: HoldConditions
) -> Signature:
    """Signature of one effect; see `signatures`."""
    return signatures((effect,), forces, angles, g, Columns(hold, 2))


def signatures(
    shapes: Sequence[Effect], forces: Array, angles: Array, g: float, hold: Columns
) -> Signature:
    """Evaluate shapes of one effect for the unit vectors of its parameters, in which it is linear.

    Parameters
    ----------
    shapes : s effects of one kind
    forces : (n, 3) array, m/s², in sensor axes
    angles : (n, 2) array, rad, attitude
    g : float, m/s²
    hold : Columns, with two further axes

    Returns
    -------
    Signature
        Of the s k parameters, shape after shape.

    Raises
    ------
    InputError
        If the effect needs a column that the holds lack.
    """
    effect = _together(shapes)
    n, s, k = len(forces), len(shapes), len(effect.parameters)
    p = tuple(np.eye(k))
    f, attitude = (tuple(values.T[:, :, None, None]) for values in (forces, angles))

    def filled(values: Iterable[ArrayLike], count: int) -> Array:
        full = np.zeros((n, count, s, k))
        for i, value in enumerate(values):
            full[:, i] = value
        return full.reshape(n, count, s * k)

    # A formula takes the columns that it needs, and asks for nothing else of the holds.
    columns: Any = hold
    force = filled(effect.output(f, p, g, columns, np), 3)
    if (axes := _axes(effect, k)).any():
        force -= np.tile(np.einsum("nb,abk->nak", forces, axes), s)
    turned = np.zeros((n, 2, s * k))
    if type(effect).reading is not Effect.reading:
        turned = filled(effect.reading(attitude, p, columns, np), 2)
    return Signature(force, turned)


def _axes(effect: Effect, k: int) -> Array:
    """What an effect adds to T, for the unit vectors of its parameters, (3, 3, k)."""
    axes = np.zeros((3, 3, k))
    if type(effect).axes is not Effect.axes:
        for i, row in enumerate(effect.axes(tuple(np.eye(k)), np)):
            for j, value in enumerate(row):
                axes[i, j] = value
    return axes


def _together(shapes: Sequence[Effect]) -> Effect:
    """Shapes of one effect as one, whose settings are arrays (s, 1)."""
    together = type(shapes[0])()
    settings: Any = {
        name: np.array([shape.settings[name] for shape in shapes])[:, None]
        for name in together.settings
    }
    together.settings = settings
    return together
