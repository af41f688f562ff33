"""What an effect would leave in the observations: its signature, from its one definition.

An effect of time changes the output within a hold, too. Its rate is the derivative of the same
definition by the time of the hold, the temperature going on as it does from hold to hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects import Effect, Hold

Array = NDArray[np.float64]

MOMENT = 0.01
"""s, beside which all courses of time are straight."""
STEADY = 0.25
"""Deviation of a temperature from the mean of those before and after it, beside their difference,
up to which its course is steady."""


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


class Moment:
    """The columns of a `Hold` at some moment of each hold.

    One that is absent raises `InputError` when a formula uses it.

    Parameters
    ----------
    hold : Hold
    dt : float, s, after the middle of each hold
    """

    def __init__(self, hold: Hold, dt: float = 0.0) -> None:
        self._hold, self._dt = hold, dt
        self.used: set[str] = set()

    def __getattr__(self, name: str) -> Array:
        self.used.add(name)
        values = self._hold.column(name)
        if self._dt == 0:
            return values
        if name == "time":
            return values + self._dt
        if name == "temperature":
            return values + self._dt * temperature_rate(self._hold.column("time"), values)
        return values

    def lagged(self, tau: float) -> Array:
        """Temperature behind a lag, which follows from the difference of the two."""
        if tau == 0:
            return self.temperature
        self.used.add("temperature")
        behind = self._hold.lagged(tau)
        return behind + self._dt * (self._hold.column("temperature") - behind) / tau


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
    now = Moment(hold)
    f = (forces[:, 0], forces[:, 1], forces[:, 2])
    attitude = (angles[:, 0], angles[:, 1])

    def output(at: Moment) -> Array:
        force = np.zeros((n, 3, k))
        for j, p in enumerate(np.eye(k)):
            for i, value in enumerate(effect.output(f, tuple(p), g, at, np)):
                force[:, i, j] = value
        return force

    force, reading, rate = output(now), np.zeros((n, 2, k)), np.zeros((n, 3, k))
    if hold.time is not None and now.used & {"time", "temperature"}:
        rate = rate_of(output, hold)
    for j, p in enumerate(np.eye(k)):
        force[:, :, j] -= forces @ np.array(effect.axes(tuple(p), np), dtype=float).T
        for i, value in enumerate(effect.reading(attitude, tuple(p), now, np)):
            reading[:, i, j] = value
    return Signature(force, reading, rate)


def rate_of(output: Callable[[Moment], Array], hold: Hold) -> Array:
    """Rate at which what depends on the holds changes within them, per s; a jump has none."""

    def difference(dt: float) -> Array:
        return (output(Moment(hold, dt)) - output(Moment(hold, -dt))) / (2 * dt)

    rate = difference(MOMENT)
    return np.where(np.isclose(rate, difference(2 * MOMENT), rtol=1e-3), rate, 0.0)


def temperature_rate(time: Array, temperature: Array) -> Array:
    """Rate of the temperature within each hold, (n,), K/s, as it goes on from hold to hold.

    That is honest where its course is steady. Where it is set anew between the holds, it rests
    within them as far as anybody knows.
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
