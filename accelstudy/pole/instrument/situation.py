"""A pole with its sensor in given attitudes: what its foot depends on, and how strongly."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import jacobian as leveling_jacobian
from accelstudy.leveling.angles import roll_pitch
from accelstudy.pole.instrument.geometry import INPUTS, foot, jacobian, leaning
from accelstudy.pole.instrument.sensor import CalibratedSensor
from accelstudy.pole.instrument.setup import Setup

Array = NDArray[np.float64]

PARAMETERS = "parameters"
"""Errors of the calibration's parameters, (u,), SI."""
FORCE = "force"
"""Error of the reading in the axes of the sensor, (3,), m/s²."""


@dataclass(frozen=True)
class Situation:
    """A pole in k attitudes; the heading is zero, since errors turn with it.

    Attributes
    ----------
    setup : Setup
    sensor : CalibratedSensor
    tilt, direction : (k,) arrays, rad, see `leaning`
    """

    setup: Setup
    sensor: CalibratedSensor
    tilt: Array
    direction: Array

    @cached_property
    def forces(self) -> Array:
        """True specific forces in the pole's axes, (k, 3), m/s²."""
        return leaning(self.tilt, self.direction, self.sensor.gravity)

    @cached_property
    def sensor_forces(self) -> Array:
        """The same in the axes of the sensor, (k, 3), m/s²."""
        return self.sensor.mounting.from_frd(self.forces)

    @cached_property
    def hold(self) -> HoldConditions | None:
        """Conditions of the sensor's effects besides the force; each attitude stands alone."""
        return self.sensor.conditions(self.sensor_forces, self.setup.temperature_change)

    @cached_property
    def readings(self) -> Array:
        """Output of the sensor without noise, (k, 1, 3), m/s²."""
        sensor, forces = self.sensor, self.sensor_forces[:, None]
        return sensor.model.sense(forces, sensor.parameters, sensor.gravity, self.hold)

    @cached_property
    def inputs(self) -> Array:
        """True `INPUTS` of `foot`, (k, 13), without bending."""
        known = np.zeros((len(self.tilt), len(INPUTS)))
        roll, pitch = roll_pitch(tuple(self.forces.T))
        values = {
            "roll": roll,
            "pitch": pitch,
            "length": self.setup.length,
            "offset_forward": self.setup.offset_forward,
            "offset_right": self.setup.offset_right,
        }
        for name, value in values.items():
            known[:, INPUTS.index(name)] = value
        return known

    @cached_property
    def _jacobian(self) -> Array:
        return jacobian(self.inputs)

    def slope(self, on: tuple[str, ...]) -> Array:
        """Derivative of the foot with respect to wrong inputs, (k, 3, m).

        Parameters
        ----------
        on : tuple of str, some of `INPUTS`, or `PARAMETERS` or `FORCE` alone
        """
        if on not in ((PARAMETERS,), (FORCE,)):
            return self._jacobian[..., [INPUTS.index(name) for name in on]]
        angles = [INPUTS.index("roll"), INPUTS.index("pitch")]
        by_force = self._jacobian[..., angles] @ leveling_jacobian(self.forces)
        # Errors of a reading propagate by ∂f_b/∂f_s, which is close to I.
        by_force = by_force @ self.sensor.mounting.matrix
        if on == (FORCE,):
            return by_force
        sensor = self.sensor
        by_parameters = sensor.model.correction_jacobian(
            self.readings, sensor.parameters, sensor.gravity, self.hold
        )
        return by_force @ by_parameters[:, 0]

    def errors(self, wrong: Mapping[tuple[str, ...], Array]) -> Array:
        """Error of the foot that is computed from wrong values, with the exact geometry.

        Parameters
        ----------
        wrong : mapping of the wrong inputs, as in `slope`, to errors (R, k, m)

        Returns
        -------
        (R, k, 3) array, m, north, east and down
        """
        sensor = self.sensor
        readings, parameters = self.readings, sensor.parameters
        if (FORCE,) in wrong:
            readings = readings + wrong[FORCE,][:, :, None]
        if (PARAMETERS,) in wrong:
            parameters = parameters + wrong[PARAMETERS,]
        forces = sensor.model.correct(readings, parameters, sensor.gravity, self.hold)[..., 0, :]
        leveled = roll_pitch(tuple(np.moveaxis(sensor.mounting.to_frd(forces), -1, 0)))

        inputs = {name: self.inputs[:, i] for i, name in enumerate(INPUTS)}
        inputs |= {"roll": leveled[0], "pitch": leveled[1]}
        for on, values in wrong.items():
            if on not in ((PARAMETERS,), (FORCE,)):
                inputs |= {name: inputs[name] + values[..., i] for i, name in enumerate(on)}
        computed = np.stack(np.broadcast_arrays(*foot(tuple(inputs.values()))), axis=-1)
        return computed - np.stack(foot(tuple(self.inputs.T)), axis=-1)
