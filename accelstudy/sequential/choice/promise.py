"""The tilt accuracy that is promised, and the one reached so far."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.leveling.error import ATTITUDES, TiltError, cap_forces, holds_in_use, tilt_error
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Promise:
    """Rms of roll and of pitch, each, that a calibration may leave.

    The rms is over all tilts up to `tilt_range` and over all possible outcomes of the calibration,
    without the noise of the leveled reading.

    Attributes
    ----------
    accuracy : float, rad
    tilt_range : float, rad
    """

    accuracy: float
    tilt_range: float

    def tilt_error(
        self,
        model: SensorModel,
        parameters: Array | None = None,
        gravity: float = STANDARD_GRAVITY,
        hold: HoldConditions | None = None,
    ) -> TiltError:
        """Tilt error of a calibration as a function of the errors of its parameters.

        Parameters
        ----------
        model : SensorModel
        parameters : (u,) array, SI; those of an ideal sensor by default
        gravity : float, m/s²
        hold : HoldConditions, optional
            Conditions of the positions, where effects depend on them; use is in like conditions.
        """
        at = np.zeros(model.n_parameters) if parameters is None else parameters
        f_b = cap_forces(self.tilt_range, ATTITUDES, gravity)
        if hold is not None and hold.order is not None:
            hold = holds_in_use(hold, len(hold.order), f_b)
        return tilt_error(model, at, model, at, f_b, gravity, hold)

    def reached(self, rms: Array) -> NDArray[np.bool_]:
        """Whether the rms of roll and of pitch, (..., 2), both keep the promise."""
        return np.asarray(np.all(rms <= self.accuracy, axis=-1))

    def weight(self, error: TiltError, rms: Array) -> Array:
        """W of the next choice, (R, u, u): mean variance of the angles that miss the promise.

        rms : (R, 2) array, of roll and pitch so far
        """
        missing = (rms > self.accuracy) | self.reached(rms)[..., None]
        share = missing / missing.sum(axis=-1, keepdims=True)
        return np.einsum("ra,auw->ruw", share, error.quadratic)


def rms_of(error: TiltError, cofactors: Array, variance: Array | float = 1.0) -> Array:
    """Rms of roll and of pitch, (R, 2), rad, by cofactors (R, u', u') and variances of unit weight.

    Gravity, where it is estimated, does not count.
    """
    u = len(error.reference)
    covariance = cofactors[:, :u, :u] * np.reshape(variance, (-1, 1, 1))
    return np.array([error.rms_of_all(each) for each in covariance]).reshape(-1, 2)
