"""The signature of an effect: what it would leave in the observations, from its one definition.

An effect of time changes the output within a hold, too. Its rate is the derivative of the same
definition by the time of the hold; the temperature changes as it does from hold to hold.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.effects import Effect, HoldConditions

Array = NDArray[np.float64]

MOMENT = 0.01
"""s, so short that every course in time is straight."""
STEADY = 0.25
"""The course of a temperature is steady if its values deviate from the mean of their neighbours by
less than this share of the neighbours' difference."""


@dataclass(frozen=True)
class Signature:
    """Derivatives of the observations by the k parameters of an effect, at zero.

    Attributes
    ----------
    force : (n, 3, k) array, of the sensor's output
    angles : (n, 2, k) array, of the robot's reading
    rate : (n, 3, k) array, of the change of the output within a hold, per s
    """

    force: Array
    angles: Array
    rate: Array

    def reduced(self, directions: Array) -> Signature:
        """Signature of combinations of the parameters, `directions` (k, l)."""
        return Signature(self.force @ directions, self.angles @ directions, self.rate @ directions)

    def split(self, count: int) -> list[Signature]:
        """Signatures of so many shapes that stand side by side."""
        parts = (np.split(part, count, axis=2) for part in (self.force, self.angles, self.rate))
        return [Signature(*part) for part in zip(*parts, strict=True)]


class Moment:
    """The columns of a `HoldConditions` at some moment of each hold.

    A column that is absent raises `InputError` when a formula uses it. Each is computed once.

    Parameters
    ----------
    hold : HoldConditions
    dt : float, s, after the middle of each hold
    axes : int, number of axes after that of the holds
    """

    def __init__(self, hold: HoldConditions, dt: float = 0.0, axes: int = 0) -> None:
        self._hold, self._dt, self._axes = hold, dt, axes
        self._known: dict[str | float, Array] = {}
        self.used: set[str] = set()

    def __getattr__(self, name: str) -> Array:
        self.used.add(name)
        if name not in self._known:
            values = self._column(name)
            self._known[name] = values.reshape(len(values), *[1] * self._axes)
        return self._known[name]

    def _column(self, name: str) -> Array:
        values = self._hold.column(name)
        if self._dt == 0:
            return values
        if name == "time":
            return values + self._dt
        if name == "temperature":
            return values + self._dt * temperature_rate(self._hold.column("time"), values)
        return values

    def lagged(self, tau: Array) -> Array:
        """Temperature behind each of some lags (s, 1), (n, s, 1)."""
        self.used.add("temperature")
        return np.stack([self._behind(t) for t in tau.ravel().tolist()], axis=1)[..., None]

    def _behind(self, tau: float) -> Array:
        """Temperature behind a lag, (n,); its rate follows from the difference of the two."""
        if tau == 0:
            return self._column("temperature")
        if tau not in self._known:
            behind = self._hold.lagged(tau)
            rate = (self._hold.column("temperature") - behind) / tau
            self._known[tau] = behind + self._dt * rate
        return self._known[tau]


class Moments:
    """Holds, now and at the moments between which rates are taken.

    Attributes
    ----------
    hold : HoldConditions
    now : Moment
    around : tuple of Moment, `MOMENT` and twice that before and after; empty without a time, or
        where no rates are wanted
    """

    def __init__(self, hold: HoldConditions, rates: bool = True) -> None:
        self.hold, self.now = hold, Moment(hold, axes=2)
        steps = (-2, -1, 1, 2) if rates and hold.time is not None else ()
        self.around = tuple(Moment(hold, step * MOMENT, axes=2) for step in steps)


def signature(
    effect: Effect, forces: Array, angles: Array, g: float, hold: HoldConditions
) -> Signature:
    """Signature of one effect; see `signatures`."""
    return signatures((effect,), forces, angles, g, Moments(hold))


def signatures(
    shapes: Sequence[Effect], forces: Array, angles: Array, g: float, moments: Moments
) -> Signature:
    """Evaluate shapes of one effect for the unit vectors of its parameters, in which it is linear.

    Parameters
    ----------
    shapes : s effects of one kind
    forces : (n, 3) array, m/s², in sensor axes
    angles : (n, 2) array, rad, attitude
    g : float, m/s²
    moments : Moments

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

    def output(at: Moment) -> Array:
        return filled(effect.output(f, p, g, at, np), 3)

    now = moments.now
    now.used.clear()
    force, rate = output(now), np.zeros((n, 3, s * k))
    if moments.around and now.used & {"time", "temperature"}:
        rate = _rate(*map(output, moments.around))
    if (axes := _axes(effect, k)).any():
        force -= np.tile(np.einsum("nb,abk->nak", forces, axes), s)
    turned = np.zeros((n, 2, s * k))
    if type(effect).reading is not Effect.reading:
        turned = filled(effect.reading(attitude, p, now, np), 2)
    return Signature(force, turned, rate)


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


def rate_of(output: Callable[[Moment], Array], hold: HoldConditions) -> Array:
    """Rate at which what depends on the holds changes within them, per s; a jump has none."""
    return _rate(*(output(Moment(hold, step * MOMENT)) for step in (-2, -1, 1, 2)))


def _rate(before: Array, shortly: Array, soon: Array, after: Array) -> Array:
    """Rate between what is at −2, −1, 1 and 2 times `MOMENT`."""
    rate = (soon - shortly) / (2 * MOMENT)
    return np.where(np.isclose(rate, (after - before) / (4 * MOMENT), rtol=1e-3), rate, 0.0)


def temperature_rate(time: Array, temperature: Array) -> Array:
    """Rate of the temperature within each hold, (n,), K/s, as it changes from hold to hold.

    This needs a steady course. Where the temperature is set anew between the holds, nothing shows
    that it changes within them, and the rate is zero.
    """
    at = np.unique(time, return_index=True)[1]
    t, values = time[at], temperature[at]
    if len(t) < 3:
        return np.zeros(len(time))
    share = (t[1:-1] - t[:-2]) / (t[2:] - t[:-2])
    between = values[:-2] + share * (values[2:] - values[:-2])
    off, change = values[1:-1] - between, values[2:] - values[:-2]
    if np.sum(off**2) > STEADY**2 * np.sum(change**2):
        return np.zeros(len(time))
    return np.interp(time, t, np.gradient(values, t, edge_order=2))
