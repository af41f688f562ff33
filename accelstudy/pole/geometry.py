"""The foot of a pole: the one definition from which all derivatives are traced, and the attitudes.

Positions are north, east, down. The pole's own axes are forward, right and down along the pole. Its
attitude is yaw, pitch and roll, as everywhere in the project; upright all three are zero.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.effects.components import Number, Vector
from accelstudy.leveling.angles import jacobian as leveling_jacobian
from accelstudy.leveling.angles import roll_pitch
from accelstudy.pole.sensor import CalibratedSensor
from accelstudy.pole.setup import Setup

Array = NDArray[np.float64]

PARAMETERS = "parameters"
"""Errors of the calibration's parameters, (u,), SI."""
FORCE = "force"
"""Error of the reading, the sensor's output, in its axes, (3,), m/s²."""
INPUTS = (
    "top_north",
    "top_east",
    "top_down",
    "roll",
    "pitch",
    "yaw",
    "length",
    "offset_forward",
    "offset_right",
    "mounting_forward",
    "mounting_right",
    "bend_forward",
    "bend_right",
)
"""Arguments of `foot`, in order.

The top is the centre of the antenna or prism, m, and the offset is its distance from the pole's
axis. The mounting angles turn the pole against the leveled axes, about forward and about right,
rad. Bending moves the foot away from the straight line that leveling assumes, m.
"""


def foot(inputs: Sequence[Number], xp: Any = np) -> Vector:
    """North, east and down of the foot, m, as a function of the `INPUTS`."""
    (north, east, down, roll, pitch, yaw, length, offset_forward, offset_right,
     mounting_forward, mounting_right, bend_forward, bend_right) = inputs  # fmt: skip
    arm = (bend_forward - offset_forward, bend_right - offset_right, length)
    arm = _about_right(_about_forward(arm, mounting_forward, xp), mounting_right, xp)
    arm = _about_down(_about_right(_about_forward(arm, roll, xp), pitch, xp), yaw, xp)
    return north + arm[0], east + arm[1], down + arm[2]


def _about_forward(v: Vector, angle: Number, xp: Any) -> Vector:
    c, s = xp.cos(angle), xp.sin(angle)
    return v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]


def _about_right(v: Vector, angle: Number, xp: Any) -> Vector:
    c, s = xp.cos(angle), xp.sin(angle)
    return c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]


def _about_down(v: Vector, angle: Number, xp: Any) -> Vector:
    c, s = xp.cos(angle), xp.sin(angle)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@cache
def _jacobian_function() -> Any:
    from accelstudy.symbolic.tracing import jacobian_of

    return jacobian_of(foot, len(INPUTS))


def jacobian(inputs: ArrayLike) -> Array:
    """Partial derivatives of the foot with respect to all inputs.

    Parameters
    ----------
    inputs : (..., 13) array, in the order of `INPUTS`

    Returns
    -------
    (..., 3, 13) array, m per unit of the input
    """
    return np.asarray(_jacobian_function()(np.asarray(inputs, dtype=float)))


def leaning(tilt: ArrayLike, direction: ArrayLike, g: float = STANDARD_GRAVITY) -> Array:
    """Specific force in the pole's axes when it leans.

    Parameters
    ----------
    tilt : (...) array, rad, angle between the pole and the vertical
    direction : (...) array, rad, in which the top leans, from forward towards right
    g : float, m/s²

    Returns
    -------
    (..., 3) array, m/s²
    """
    tilt, direction = np.broadcast_arrays(
        np.asarray(tilt, dtype=float), np.asarray(direction, dtype=float)
    )
    down = (np.sin(tilt) * np.cos(direction), np.sin(tilt) * np.sin(direction), np.cos(tilt))
    return -g * np.stack(down, axis=-1)


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
    def by_last(self) -> Array:
        """What the effects that act last make of a small change that comes before them, (k, 3, 3).

        A bias and a scale act before them, and noise comes after them.
        """
        model, p, g = self.sensor.model, self.sensor.parameters, self.sensor.gravity
        f_a = model.sensitive_force(self.readings, p, g, self.hold)
        return model.slope_of_last(f_a, p, self.hold)[:, 0]

    @cached_property
    def inputs(self) -> Array:
        """True `INPUTS` of `foot`, (k, 13), without bending."""
        inputs = np.zeros((len(self.tilt), len(INPUTS)))
        roll, pitch = roll_pitch(tuple(self.forces.T))
        values = {
            "roll": roll,
            "pitch": pitch,
            "length": self.setup.length,
            "offset_forward": self.setup.offset_forward,
            "offset_right": self.setup.offset_right,
        }
        for name, value in values.items():
            inputs[:, INPUTS.index(name)] = value
        return inputs

    @cached_property
    def _jacobian(self) -> Array:
        return jacobian(self.inputs)

    def slope(self, names: tuple[str, ...]) -> Array:
        """Derivative of the foot with respect to wrong inputs, (k, 3, m).

        Parameters
        ----------
        names : tuple of str, some of `INPUTS`, or `PARAMETERS` or `FORCE` alone
        """
        if names not in ((PARAMETERS,), (FORCE,)):
            return self._jacobian[..., [INPUTS.index(name) for name in names]]
        angles = [INPUTS.index("roll"), INPUTS.index("pitch")]
        by_force = self._jacobian[..., angles] @ leveling_jacobian(self.forces)
        sensor, model = self.sensor, self.sensor.model
        of_model = model.output_jacobian if names == (FORCE,) else model.correction_jacobian
        by_names = of_model(self.readings, sensor.parameters, sensor.gravity, self.hold)
        return by_force @ sensor.mounting.matrix @ by_names[:, 0]

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
        for names, values in wrong.items():
            if names not in ((PARAMETERS,), (FORCE,)):
                inputs |= {name: inputs[name] + values[..., i] for i, name in enumerate(names)}
        computed = np.stack(np.broadcast_arrays(*foot(tuple(inputs.values()))), axis=-1)
        return computed - np.stack(foot(tuple(self.inputs.T)), axis=-1)
