"""The tilt error that a calibration leaves: what a user of the calibrated sensor sees."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.levels import MAX_TILT_GON
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of, roll_pitch, tilt_slope, wrap_angle
from accelstudy.sensors.sensor import SensorModel

ATTITUDES = 200
"""Least number of attitudes over which a tilt error is averaged, unless another is given."""
RINGS = (0.0, 0.323911810519907637, 0.529656775285156812, 0.883861700758049036)
"""Chebyshev's nodes, and their negatives: the mean over all seven of a polynomial up to degree 7 is
that over [−1, 1] (Abramowitz & Stegun, table 25.5)."""
GOLDEN = (np.sqrt(5) - 1) / 2


def cap_forces(max_tilt: float, attitudes: int, g: float = STANDARD_GRAVITY) -> Array:
    """Specific forces (k, 3) of attitudes spread evenly over all tilts up to `max_tilt` (rad).

    They are rings of equally many, at Chebyshev's nodes of the cosine of the tilt, so that a plain
    mean over them is a quadrature: up to 50 gon, that of a squared tilt error is right to nine
    digits. Their order is mixed, since effects that depend on conditions meet them one by one.

    Parameters
    ----------
    max_tilt : float, rad
    attitudes : int, k is at least so many
    g : float, m/s²
    """
    panels = max(1, math.isqrt(attitudes // (4 * 7 * 7)))
    nodes = np.unique([RINGS, np.negative(RINGS)])
    across = (np.arange(panels)[:, None] + (1 + nodes) / 2).ravel() / panels
    around = math.ceil(attitudes / len(across))
    ring = np.arange(len(across))[:, None]
    azimuth = 2 * np.pi / around * (np.arange(around) + GOLDEN * ring % 1)
    z = 1 - across[:, None] * (1 - np.cos(max_tilt)) + 0 * azimuth
    radius = np.sqrt(1 - z * z)
    force = -g * np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=-1)
    return force.reshape(-1, 3)[np.argsort(GOLDEN * np.arange(z.size) % 1)]


def attitudes_in_use(
    hold: HoldConditions, g: float, max_tilt: float = MAX_TILT_GON * GON
) -> tuple[Array, HoldConditions]:
    """Return attitudes in which a sensor is used, in conditions like those of its calibration.

    Parameters
    ----------
    hold : HoldConditions, of the positions of the calibration, in their order
    g : float, m/s²
    max_tilt : float, rad

    Returns
    -------
    f_b : (k, 3) array, m/s², over all tilts up to the largest
    HoldConditions
    """
    f_b = cap_forces(max_tilt, ATTITUDES, g)
    roll, pitch = roll_pitch(tuple(f_b.T))
    # All positions count alike, however many there are.
    used = hold.take(np.arange(len(f_b)) * len(hold.column("order")) // len(f_b))
    yaw = np.zeros(len(f_b)) if used.yaw is None else used.yaw
    return f_b, replace(used, roll=roll, pitch=pitch, yaw=yaw)


@dataclass(frozen=True)
class TiltError:
    """Errors of roll and pitch as a function of the estimates, about a reference calibration.

    The mean over attitudes of the squared error of an estimate x is, with δ = x − reference,
    constant + 2 linear δ + δᵀ quadratic δ: the reference is propagated exactly, and the difference
    from it linearly.

    Attributes
    ----------
    reference : (u,) array, SI
    constant : (2,) array, rad², of roll and of pitch
    linear : (2, u) array
    quadratic : (2, u, u) array
    """

    reference: Array
    constant: Array
    linear: Array
    quadratic: Array

    def squares(self, estimates: Array) -> Array:
        """Mean over attitudes of the squared errors of roll and of pitch, (R, 2)."""
        delta = estimates - self.reference
        scattered = [np.einsum("ru,ru->r", delta @ q, delta) for q in self.quadratic]
        square = self.constant + 2 * delta @ self.linear.T + np.stack(scattered, -1)
        return np.asarray(np.maximum(square, 0.0))

    def rms(self, estimates: Array) -> Array:
        """Rms over attitudes of the errors of roll and of pitch, (R, 2), of estimates (R, u)."""
        return np.sqrt(self.squares(estimates))

    def rms_of_all(self, covariance: Array) -> Array:
        """Rms over attitudes and over calibrations whose mean is the reference, (2,)."""
        return np.sqrt(self.constant + np.einsum("auw,uw->a", self.quadratic, covariance))


def tilt_error(
    simulated: SensorModel,
    truth: Array,
    estimated: SensorModel,
    reference: Array,
    f_b: Array,
    g: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
) -> TiltError:
    """Propagate calibration errors to roll and pitch, without noise of the leveled reading.

    Effects that the estimated model lacks count in full. Effects of the rig, estimated or not, do
    not count: the sensor has left it.

    Parameters
    ----------
    simulated, estimated : SensorModel, of the simulated sensor and of the calibration
    truth : (u',) array, SI, of the simulated model
    reference : (u,) array, SI, of the estimated model, near the estimates, such as their mean
    f_b : (k, 3) array, m/s², attitudes
    g : float, m/s²
    hold : HoldConditions, optional
        What else is known of the attitudes, where effects depend on it.
    """
    reference = np.where(estimated.stays, reference, 0.0)
    output = simulated.sense(f_b, np.where(simulated.stays, truth, 0.0), g, hold)
    corrected = estimated.correct(output, reference, g, hold)
    offset = wrap_angle(angles_of(corrected) - angles_of(f_b))
    slope = tilt_slope(estimated, reference, output, corrected, g, hold)
    slope = np.where(estimated.stays, slope, 0.0)
    return TiltError(
        reference,
        constant=np.mean(offset**2, axis=0),
        linear=np.einsum("ka,kau->au", offset, slope) / len(f_b),
        quadratic=np.einsum("kau,kaw->auw", slope, slope) / len(f_b),
    )


def error_in_use(
    model: SensorModel,
    parameters: Array | None = None,
    max_tilt: float = MAX_TILT_GON * GON,
    g: float = STANDARD_GRAVITY,
    hold: HoldConditions | None = None,
) -> TiltError:
    """Tilt error of a calibration in use, as a function of the errors of its parameters.

    Parameters
    ----------
    model : SensorModel
    parameters : (u,) array, SI; those of an ideal sensor by default
    max_tilt : float, rad, up to which the sensor is used
    g : float, m/s²
    hold : HoldConditions, optional
        Conditions of the positions, where effects depend on them; use is in like conditions.
    """
    at = np.zeros(model.n_parameters) if parameters is None else parameters
    f_b, used = attitudes_in_use(hold or HoldConditions(order=np.ones(1)), g, max_tilt)
    return tilt_error(model, at, model, at, f_b, g, used)
