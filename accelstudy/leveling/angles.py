"""Leveling: roll and pitch from the specific force, and back (Thalmann & Neuner 2018, section 3).

North-east-down convention: at level f_b = (0, 0, −g).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array
from accelstudy.effects import HoldConditions
from accelstudy.effects.components import Number, Vector
from accelstudy.sensors.sensor import SensorModel
from accelstudy.symbolic.tracing import jacobian_of

MAX_CURVATURE = 0.2
"""Size of the terms of second order, beside those of first order, beyond which standard deviations
of roll and pitch do not hold. With equal noise on all axes it is nearer than 5 sigmas then."""


def roll_pitch(f: Vector, xp: Any = np) -> tuple[Number, Number]:
    """Roll and pitch in rad of the components of a specific force (eq. 6).

    Roll lies in (−π, π] and has no meaning where f_y = f_z = 0; pitch lies in [−π/2, π/2].
    """
    x, y, z = f
    return xp.arctan2(-y, -z), xp.arctan2(x, xp.sqrt(y * y + z * z))


def angles_of(forces: ArrayLike) -> Array:
    """Roll and pitch, (..., 2) in rad, of specific forces (..., 3)."""
    forces = np.asarray(forces, dtype=float)
    return np.stack(roll_pitch(tuple(np.moveaxis(forces, -1, 0))), axis=-1)


def usual_norm(forces: ArrayLike) -> float:
    """Median norm of specific forces (n, 3), m/s²; at rest it is close to gravity."""
    return float(np.median(np.linalg.norm(forces, axis=1)))


def wrap_angle(angle: ArrayLike) -> Array:
    """Return the angles in [−π, π) that point the same way, in rad; arrays of any shape."""
    return np.asarray((np.asarray(angle, dtype=float) + np.pi) % (2 * np.pi) - np.pi)


def specific_force(roll: Number, pitch: Number, g: Number, xp: Any = np) -> Vector:
    """Components of the specific force at rest in an attitude; the inverse of `roll_pitch`."""
    return (
        g * xp.sin(pitch),
        -g * xp.cos(pitch) * xp.sin(roll),
        -g * xp.cos(pitch) * xp.cos(roll),
    )


def jacobian(f: ArrayLike) -> Array:
    """Partial derivatives of roll and pitch with respect to the specific force (eq. 7).

    Parameters
    ----------
    f : (..., 3) array, m/s²

    Returns
    -------
    (..., 2, 3) array, rad/(m/s²); derived from `roll_pitch`, of which it is the only definition.
    """
    return np.asarray(jacobian_of(roll_pitch, 3)(np.asarray(f, dtype=float)))


def near_pole(angles: ArrayLike, sigma: ArrayLike) -> NDArray[np.bool_]:
    """Whether attitudes are too close to the roll pole, pitch ±π/2, for linear propagation.

    A distance δ to the pole that is known to σ_θ makes a direction about it, the roll, uncertain by
    σ_φ (1 ± σ_θ/δ). An error of the roll makes the distance longer by up to σ_φ² sin δ cos δ / 2,
    whatever its sign, and so the pitch smaller. For equal noise σ on all axes both terms, the
    second without its half and beside σ_θ, are σ/(g sin δ), the reciprocal of the distance in
    sigmas. Up to `MAX_CURVATURE`, 93 to 97 % of the errors are below two standard deviations, where
    95.4 % are expected. That is over attitudes all around the pole, also for unequal noise, and it
    is what simulations find (tests/leveling).

    Parameters
    ----------
    angles : (..., 2) array, rad, roll and pitch as measured
    sigma : (..., 2) array, rad, their standard deviations by linear propagation; where they are
        unknown (NaN), only the pole itself is too close

    Returns
    -------
    (...) bool array
    """
    roll, pitch = np.moveaxis(np.asarray(sigma, dtype=float), -1, 0)
    distance = np.pi / 2 - np.abs(np.asarray(angles, dtype=float)[..., 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        on_roll = pitch / distance
        on_pitch = roll**2 * np.sin(distance) * np.cos(distance) / pitch
    return (distance == 0) | (on_roll > MAX_CURVATURE) | (on_pitch > MAX_CURVATURE)


def tilt_slope(
    model: SensorModel,
    parameters: Array,
    f_s: Array,
    f_b: Array,
    g: float,
    hold: HoldConditions | None = None,
) -> Array:
    """Partial derivatives of roll and pitch with respect to the parameters of a calibration.

    Parameters
    ----------
    model, parameters : sensor model and its (u,) parameters, SI
    f_s : (k, 3) array, m/s², output of the sensor
    f_b : (k, 3) array, m/s², the specific force that the model makes of it
    g : float, m/s²
    hold : HoldConditions, optional
        What else is known of the attitudes, where effects depend on it.

    Returns
    -------
    (k, 2, u) array
    """
    return np.asarray(jacobian(f_b) @ model.correction_jacobian(f_s, parameters, g, hold))


def tilt_by_output(
    model: SensorModel,
    parameters: Array,
    f_s: Array,
    f_b: Array,
    g: float,
    hold: HoldConditions | None = None,
) -> Array:
    """Partial derivatives of roll and pitch with respect to the output of the sensor.

    Where a sensor loses gain, as beyond the knee of a saturation, a small error of its output is a
    large one of the force. Parameters as in `tilt_slope`; f_s and f_b are (..., 3).

    Returns
    -------
    (..., 2, 3) array, rad/(m/s²)
    """
    return np.asarray(jacobian(f_b) @ model.output_jacobian(f_s, parameters, g, hold))


def sigma_roll_pitch(f: ArrayLike, cov: ArrayLike) -> Array:
    """Propagate the covariance matrix of a specific force to roll and pitch (section 3.1).

    Parameters
    ----------
    f : (..., 3) array, m/s²
    cov : (..., 3, 3) array, (m/s²)²

    Returns
    -------
    (..., 2) array, standard deviations of roll and pitch in rad. Near level and for equal noise σ
    on all axes they are σ/(g cos θ) and σ/g.
    """
    jac = jacobian(f)
    variance = np.einsum("...ij,...jk,...ik->...i", jac, np.asarray(cov, dtype=float), jac)
    return np.sqrt(variance)
