"""The tilt error that a calibration leaves: what a user of the calibrated sensor sees."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects import Hold
from accelstudy.leveling import jacobian, roll_pitch
from accelstudy.sensor import SensorModel
from accelstudy.units import STANDARD_GRAVITY

Array = NDArray[np.float64]


def cap_forces(max_tilt: float, attitudes: int, g: float = STANDARD_GRAVITY) -> Array:
    """Specific forces (k, 3) of attitudes spread evenly over all tilts up to `max_tilt` (rad)."""
    i = np.arange(attitudes) + 0.5
    z = 1 - i / attitudes * (1 - np.cos(max_tilt))
    azimuth = np.pi * (1 + np.sqrt(5)) * i
    radius = np.sqrt(1 - z * z)
    return -g * np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=-1)


def holds_in_use(hold: Hold, n: int, f_b: Array) -> Hold:
    """Return conditions like those of a calibration, in attitudes in which the sensor is used.

    Parameters
    ----------
    hold : Hold, of the n positions of the calibration
    n : int
    f_b : (k, 3) array, m/s², of the attitudes
    """
    roll, pitch = roll_pitch(tuple(f_b.T))
    used = hold.take(np.arange(len(f_b)) % n)
    yaw = np.zeros(len(f_b)) if used.yaw is None else used.yaw
    return replace(used, roll=roll, pitch=pitch, yaw=yaw)


@dataclass(frozen=True)
class LevelingError:
    """Errors of roll and pitch after calibration, rms over attitudes, in rad.

    Attributes
    ----------
    per_replicate : (R, 2) array, rms of roll and of pitch of each calibration
    """

    per_replicate: Array

    @property
    def rms(self) -> Array:
        """Rms of roll and of pitch over attitudes and calibrations, (2,)."""
        return np.sqrt(np.mean(self.per_replicate**2, axis=0))

    def quantile(self, probability: float) -> Array:
        """Rms of roll and of pitch that a calibration stays below with `probability`, (2,)."""
        return np.quantile(self.per_replicate, probability, axis=0)


def leveling_error(
    simulated: SensorModel,
    truth: Array,
    estimated: SensorModel,
    estimates: Array,
    f_b: Array,
    g: float = STANDARD_GRAVITY,
    hold: Hold | None = None,
) -> LevelingError:
    """Propagate calibration errors to roll and pitch, without noise of the leveled reading.

    The mean calibration is propagated exactly and the scatter about it linearly; effects that the
    estimated model lacks therefore count in full. Effects of the rig, estimated or not, do not
    count: the sensor has left it.

    Parameters
    ----------
    simulated, estimated : SensorModel, what the sensor is and what is estimated of it
    truth : (u',) array, SI, of the simulated model
    estimates : (R, u) array, SI, of the estimated model
    f_b : (k, 3) array, m/s², attitudes
    g : float, m/s²
    hold : Hold, optional
        What else is known of the attitudes, where effects depend on it.
    """
    estimates = np.where(estimated.stays, estimates, 0.0)
    mean = estimates.mean(axis=0)
    output = simulated.sense(f_b, np.where(simulated.stays, truth, 0.0), g, hold)
    corrected = estimated.correct(output, mean, g, hold)
    offset = np.stack(roll_pitch(tuple(corrected.T)), -1) - np.stack(roll_pitch(tuple(f_b.T)), -1)
    offset = (offset + np.pi) % (2 * np.pi) - np.pi
    slope = jacobian(corrected) @ estimated.correction_jacobian(output, mean, g, hold)

    # Mean over attitudes of (offset + slope δ)², as a quadratic form in δ.
    delta = estimates - mean
    constant = np.mean(offset**2, axis=0)
    linear = np.einsum("ka,kau->au", offset, slope) / len(f_b)
    quadratic = np.einsum("kau,kaw->auw", slope, slope) / len(f_b)
    square = (
        constant
        + 2 * delta @ linear.T
        + np.stack(
            [np.einsum("ru,uw,rw->r", delta, q, delta, optimize=True) for q in quadratic], -1
        )
    )
    return LevelingError(np.sqrt(np.maximum(square, 0.0)))
