"""Comparison of two calibrations of one sensor: whether it changed, in what, and what it matters.

What two calibrations have in common are the effects that both estimate (`epochs/common.py`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import GON
from accelstudy.campaign.calibration.applying import SensorCalibration
from accelstudy.effects import Parameter
from accelstudy.epochs.common import Common, in_common, session_like
from accelstudy.epochs.congruence import Epochs, Test
from accelstudy.leveling.error import ATTITUDES, MAX_TILT_GON, cap_forces, tilt_error
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

NOTHING = 1e-12
"""rad, difference that is rounding alone."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two calibrations, and what they have in common.

    Attributes
    ----------
    first, second : SensorCalibration
    common : Common, the effects that both have
    tilt_range : float, rad
    """

    first: SensorCalibration
    second: SensorCalibration
    common: Common
    tilt_range: float

    @property
    def model(self) -> SensorModel:
        """The effects that both have."""
        return self.common.model

    @property
    def values(self) -> Array:
        """Parameters of both, (2, p), SI."""
        return self.common.values

    @cached_property
    def epochs(self) -> Epochs:
        """The second less the first."""
        (first, second), (one, other) = self.values, self.common.covariances
        a, b = self.common.dof.tolist()
        return Epochs(second - first, (one, other), (a, b))

    @cached_property
    def test(self) -> Test:
        """Whether the sensor is still what it was."""
        return self.epochs.test()

    @cached_property
    def changed(self) -> tuple[int, ...]:
        """Places of the parameters that changed; all others are congruent."""
        return self.epochs.changed()

    def instead_of(self, place: int) -> list[str]:
        """Names of parameters that may have changed instead of one of `changed`."""
        names = self.model.parameter_names
        return [names[i] for i in self.epochs.instead_of(place, self.changed)]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters that both have."""
        return self.model.parameters

    @cached_property
    def tilt(self) -> Array:
        """Rms by which roll and pitch differ, and that which chance would give, (2, 2), rad.

        Readings are those of the sensor as it was; they are leveled as if it had not changed, and
        as it is now.
        """
        g, forces = self.second.gravity, cap_forces(self.tilt_range, ATTITUDES, self.second.gravity)
        hold = session_like(self.second, -forces / g).hold
        error = tilt_error(self.model, self.values[0], self.model, self.values[1], forces, g, hold)
        by_chance = np.einsum("auw,uw->a", error.quadratic, self.epochs.covariance)
        return np.sqrt([np.where(error.constant > NOTHING**2, error.constant, 0.0), by_chance])

    def only_in(self, one: SensorCalibration) -> list[str]:
        """Effects of the sensor that one of the calibrations has, and the other lacks."""
        return self.common.missing_in(one)


def compare(
    first: SensorCalibration,
    second: SensorCalibration,
    tilt_range: float = MAX_TILT_GON * GON,
) -> Comparison:
    """Compare two calibrations of one sensor.

    Parameters
    ----------
    first, second : SensorCalibration, the older one first
    tilt_range : float, rad, over which tilts are compared

    Raises
    ------
    InputError
        As `in_common`.
    """
    return Comparison(first, second, in_common((first, second)), tilt_range)
