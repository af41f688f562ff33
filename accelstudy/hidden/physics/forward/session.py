"""A session as it really is: where the joints stand, when, how warm it is and how it shakes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY = 9.80665
"""m/s², at the place of all sessions."""


@dataclass(frozen=True)
class Course:
    """A temperature that changes linearly between given times; before and after it is constant.

    Attributes
    ----------
    times : (k,) array, s
    values : (k,) array, °C
    """

    times: Array
    values: Array

    def at(self, time: Array) -> Array:
        """Temperature at times, °C."""
        return np.interp(time, self.times, self.values)

    def lagged(self, time: Array, tau: float) -> Array:
        """Temperature of a body that follows with a first-order lag of `tau` seconds, °C.

        Before the first time the body and what surrounds it are equally warm.
        """
        if tau == 0:
            return self.at(time)
        moments = np.union1d(self.times, time)
        outside = self.at(moments)
        # Behind a linear change a body lags, in the long run, by tau times the slope. Any other
        # difference decays.
        steps = np.diff(moments)
        back = tau * np.diff(outside) / steps
        decay = np.exp(-steps / tau)
        body = [float(outside[0])]
        for i, kept in enumerate(decay.tolist()):
            away = body[i] - (outside[i] - back[i])
            body.append(float(outside[i + 1] - back[i] + kept * away))
        return np.asarray(body)[np.searchsorted(moments, time)]


@dataclass(frozen=True)
class Session:
    """The holds of a session as they really are, whatever the sensor does.

    Attributes
    ----------
    name : str, of the design
    joints : (n, 2) array, rad, true angles of the roll and the pitch joint
    yaw : (n,) array, rad
    sigma : float, m/s², of a position mean
    sigma_angle : float, rad, of an encoder's reading
    n_samples : int, in a hold; 0 if nothing is known of the samples
    length : float, s, of a hold
    time : (n,) array, s, middles of the holds; None if they were not written down
    course : Course, of the temperature; None without a thermometer
    vibration : (n,) array, m/s²; None if it was not measured
    slopes : bool, whether the slopes within the holds were kept
    full_range : float, m/s², the sensor is stated to measure ± this; None if nothing is stated
    """

    name: str
    joints: Array
    yaw: Array
    sigma: float
    sigma_angle: float
    n_samples: int = 0
    length: float = 20.0
    time: Array | None = None
    course: Course | None = None
    vibration: Array | None = None
    slopes: bool = False
    full_range: float | None = None

    @property
    def n(self) -> int:
        """Number of holds."""
        return len(self.joints)

    @cached_property
    def temperature(self) -> Array | None:
        """Temperature in the middles of the holds, °C."""
        if self.course is None or self.time is None:
            return None
        return self.course.at(self.time)

    @cached_property
    def clock(self) -> Array:
        """Time of each hold, or its number where there is no time."""
        return np.arange(1.0, self.n + 1) if self.time is None else self.time

    @property
    def duration(self) -> float:
        """From the first hold to the last, as the clock has it."""
        return float(self.clock[-1] - self.clock[0])

    def later(self, seconds: float) -> Session:
        """The same holds some seconds later."""
        if self.time is None:
            raise ValueError(f"{self.name}: has no time")
        return replace(self, time=self.time + seconds)
