"""What is known of the holds of a session besides the forces."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.effects.lag import TemperatureCourse

REFERENCE_TEMPERATURE = 20.0
"""°C, at which the bias and the scale are what their own parameters say."""
MIN_STEP = 0.02
"""m/s², a change of force from hold to hold below this counts as noise and not as a step."""
OF_ALL = ("course", "full_range")
"""Attributes of `HoldConditions` with one value for the whole session."""


@dataclass(frozen=True)
class HoldConditions:
    """What is known of the static holds (positions) besides the forces, in order of acquisition.

    Every column is optional and holds one value per position. An effect that needs a missing column
    cannot be simulated or estimated; the error names the column.

    Parameters
    ----------
    temperature : (n,) array, °C
    time : (n,) array, s since the start of the session
    vibration : (n,) array, m/s², rms during the hold
    roll, pitch, yaw : (n,) arrays, rad, attitude known from outside
    step_x, step_y, step_z : (n,) arrays, m/s², specific force less that of the hold before; 0 in
        the first hold
    order : (n,) array, the time or, where there is none, the number of the hold, from 1 on
    course : TemperatureCourse, of the whole session, with the holds that were left out; by default
        of these holds alone
    full_range : float, m/s², the sensor measures ± this
    """

    temperature: Array | None = None
    time: Array | None = None
    vibration: Array | None = None
    roll: Array | None = None
    pitch: Array | None = None
    yaw: Array | None = None
    step_x: Array | None = None
    step_y: Array | None = None
    step_z: Array | None = None
    order: Array | None = None
    course: TemperatureCourse | None = None
    full_range: float | None = None

    def take(self, positions: NDArray[np.int_]) -> HoldConditions:
        """Return some of the holds; steps and lagged temperatures still depend on all."""
        columns = {name: getattr(self, name) for name in self.columns()}
        return HoldConditions(
            **{k: None if v is None else np.asarray(v)[positions] for k, v in columns.items()},
            course=self._whole_course(),
            full_range=self.full_range,
        )

    def with_steps(self, forces: Array) -> HoldConditions:
        """Return the holds, which are in order of acquisition, with columns that follow from it.

        These are the steps of forces (n, 3), m/s², and `order` unless it is known.
        """
        step = np.diff(forces, axis=0, prepend=forces[:1])
        step = np.where(np.abs(step) < MIN_STEP, 0.0, step)
        order = self.order
        if order is None:
            order = np.arange(1.0, len(forces) + 1) if self.time is None else self.time
        return replace(self, step_x=step[:, 0], step_y=step[:, 1], step_z=step[:, 2], order=order)

    @classmethod
    @cache
    def columns(cls) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(field.name for field in fields(cls) if field.name not in OF_ALL)

    def column(self, name: str) -> Array:
        """Return a column, or raise `InputError` if these holds do not have it."""
        values = getattr(self, name)
        if values is None:
            raise InputError(f"the model needs the column {name!r} of each position; it is absent")
        return np.asarray(values, dtype=float)

    def lagged(self, tau: float) -> Array:
        """Temperature of a body that follows the thermometer with a lag of `tau` s, °C, (n,).

        Raises
        ------
        InputError
            If there is no temperature or, for a lag above 0, no time.
        """
        temperature = self.column("temperature")
        if tau == 0:
            return temperature
        time, course = self.column("time"), self._whole_course()
        assert course is not None
        return temperature + course.behind(time, tau)

    def _whole_course(self) -> TemperatureCourse | None:
        if self.course is not None or self.time is None or self.temperature is None:
            return self.course
        return TemperatureCourse(np.asarray(self.time), np.asarray(self.temperature))
