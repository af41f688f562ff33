"""The temperature of a body that follows a thermometer with a lag."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array


@dataclass(frozen=True, eq=False)
class TemperatureCourse:
    """A temperature that is known at some times, linear between them and constant after the last.

    Attributes
    ----------
    time : (k,) array, s, in any order
    temperature : (k,) array, °C
    """

    time: Array
    temperature: Array
    _knots: dict[float, tuple[Array, Array, Array]] = field(default_factory=dict, repr=False)

    def behind(self, time: ArrayLike, tau: float) -> Array:
        """Temperature of a body that follows the course with a first-order lag, less the course, K.

        The body has T_τ with τ dT_τ/dt = T − T_τ, and T_τ = T until the first time that is known.
        Where T grows by s per second, T_τ − T goes to −s τ by exp(−Δt/τ), which is exact.

        Parameters
        ----------
        time : array of any shape, s
        tau : float, s, above 0
        """
        known, behind, rise = self._at_knots(tau)
        at = np.asarray(time, dtype=float)
        i = np.maximum(np.searchsorted(known, at, side="right") - 1, 0)
        since = np.maximum(at - known[i], 0.0)
        return np.asarray((behind[i] + rise[i]) * np.exp(-since / tau) - rise[i])

    def _at_knots(self, tau: float) -> tuple[Array, Array, Array]:
        """Times that are known, s, the lag at each, K, and s τ from there on, K; (k,) each."""
        if tau not in self._knots:  # a log is leveled in parts
            known, first = np.unique(self.time, return_index=True)
            # After the last time the temperature stays as it is.
            rise = np.append(np.diff(self.temperature[first]) / np.diff(known), 0.0) * tau
            behind = np.zeros(len(known))
            decay, now = np.exp(-np.diff(known) / tau), 0.0
            # Numbers of Python are faster than those of NumPy, one by one.
            for k, (lasting, end) in enumerate(zip(decay.data, rise[:-1].data, strict=True), 1):
                behind[k] = now = (now + end) * lasting - end
            self._knots[tau] = known, behind, rise
        return self._knots[tau]


def course_of_log(time: Array, temperature: Array) -> TemperatureCourse | None:
    """Course by the readings (n,) of a thermometer; None if there is none.

    It has every reading, since the noise of one that it lacked would not lag.
    """
    known = np.isfinite(temperature) & np.isfinite(time)
    return TemperatureCourse(time[known], temperature[known]) if known.any() else None
