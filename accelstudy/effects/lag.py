"""The temperature of a body that follows a thermometer with a lag."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array


@dataclass(frozen=True)
class TemperatureCourse:
    """A temperature that is known at some times, linear between them and constant after the last.

    Attributes
    ----------
    time : (k,) array, s, in any order
    temperature : (k,) array, °C
    """

    time: Array
    temperature: Array

    def behind(self, time: ArrayLike, tau: float) -> Array:
        """Temperature of a body that follows the course with a first-order lag, less the course, K.

        The body has T_τ with τ dT_τ/dt = T − T_τ, and T_τ = T until the first time that is known.
        Where T grows by s per second, T_τ − T goes to −s τ by exp(−Δt/τ), which is exact.

        Parameters
        ----------
        time : array of any shape, s
        tau : float, s, above 0
        """
        known, first = np.unique(self.time, return_index=True)
        # After the last time the temperature stays as it is.
        rise = np.append(np.diff(self.temperature[first]) / np.diff(known), 0.0) * tau
        behind = [0.0]
        decay = np.exp(-np.diff(known) / tau)
        for lasting, end in zip(decay.tolist(), rise[:-1].tolist(), strict=True):
            behind.append((behind[-1] + end) * lasting - end)
        at = np.asarray(time, dtype=float)
        i = np.maximum(np.searchsorted(known, at, side="right") - 1, 0)
        since = np.maximum(at - known[i], 0.0)
        return np.asarray((np.array(behind)[i] + rise[i]) * np.exp(-since / tau) - rise[i])


def course_of_log(time: Array, temperature: Array) -> TemperatureCourse | None:
    """Course by the readings (n,) of a thermometer, one per second; None if there is none."""
    known = np.isfinite(temperature) & np.isfinite(time)
    _, kept = np.unique(np.floor(time[known]), return_index=True)
    return TemperatureCourse(time[known][kept], temperature[known][kept]) if len(kept) else None
