"""Loops over SciPy's least squares, as a careful user would write them.

The residual function works on all positions at once, the start is the ideal sensor, and MINPACK's
Levenberg-Marquardt does the rest.
"""

import numpy as np
from scipy.optimize import least_squares

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.leveling.angles import specific_force
from problem import NOISE
from ways.base import Way, register


def axes(x):
    """T of eq. (4) of Thalmann & Neuner (2018)."""
    return np.array([[1.0, -x[6], x[7]], [0.0, 1.0, -x[8]], [0.0, 0.0, 1.0]])


def body_force(x, l):
    """f_b of the sensor's output, (n, 3): eq. (5) solved for it."""
    return (l - x[:3]) / (1 + x[3:6]) @ axes(x).T


def body_force_derivatives(x, l):
    """∂f_b/∂x, (n, 3, 9)."""
    f_a = (l - x[:3]) / (1 + x[3:6])
    by_bias = -axes(x) / (1 + x[3:6])
    result = np.zeros((len(l), 3, 9))
    result[:, :, :3] = by_bias
    result[:, :, 3:6] = by_bias * f_a[:, None]
    result[:, 0, 6] = -f_a[:, 1]
    result[:, 0, 7] = f_a[:, 2]
    result[:, 1, 8] = -f_a[:, 2]
    return result


def gravity_residuals(forces, angles):
    """|f_b| − g of equal weight, and its derivatives, as functions of x."""

    def residuals(x):
        f_b = body_force(x, forces)
        return (np.sqrt(np.sum(f_b * f_b, axis=1)) - STANDARD_GRAVITY) / NOISE.sigma_force

    def derivatives(x):
        f_b = body_force(x, forces)
        unit = f_b / np.sqrt(np.sum(f_b * f_b, axis=1, keepdims=True))
        by_x = np.einsum("ni,nij->nj", unit, body_force_derivatives(x, forces))
        return by_x / NOISE.sigma_force

    return residuals, derivatives


def robot_residuals(forces, angles):
    """f_b − f(φ, θ), weighted with its covariance matrix at the read angles, and derivatives."""
    roll, pitch = angles.T
    reference = np.stack(specific_force(roll, pitch, STANDARD_GRAVITY), axis=-1)
    by_angles = STANDARD_GRAVITY * np.array(
        [
            [np.zeros_like(roll), np.cos(pitch)],
            [-np.cos(pitch) * np.cos(roll), np.sin(pitch) * np.sin(roll)],
            [np.cos(pitch) * np.sin(roll), np.sin(pitch) * np.cos(roll)],
        ]
    )
    covariance = NOISE.sigma_force**2 * np.eye(3) + NOISE.sigma_angle**2 * np.einsum(
        "ian,jan->nij", by_angles, by_angles
    )
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))

    def residuals(x):
        return np.einsum("nij,nj->ni", whitening, body_force(x, forces) - reference).ravel()

    def derivatives(x):
        return (whitening @ body_force_derivatives(x, forces)).reshape(-1, 9)

    return residuals, derivatives


class Loop(Way):
    """Session after session."""

    calibrations, difference = 100, 0.02
    analytic = False

    def __init__(self, approach):
        self._problem = robot_residuals if approach.uses_angles else gravity_residuals

    def solve(self, observed):
        """Solve them."""
        none = [None] * len(observed.forces)
        angles = none if observed.angles is None else observed.angles
        return np.stack(
            [self.solve_one(f, a) for f, a in zip(observed.forces, angles, strict=True)], axis=1
        )

    def solve_one(self, forces, angles):
        """Estimates and standard deviations a posteriori of one session, (2, 9)."""
        residuals, derivatives = self._problem(forces, angles)
        jacobian = derivatives if self.analytic else "2-point"
        result = least_squares(residuals, np.zeros(9), jacobian, method="lm")
        m, u = result.jac.shape
        cofactors = np.linalg.inv(result.jac.T @ result.jac)
        return np.array([result.x, np.sqrt(2 * result.cost / (m - u) * np.diagonal(cofactors))])


@register
class Differences(Loop):
    """With the derivatives that SciPy forms by differences, its default."""

    name, title = "scipy", "SciPy's `least_squares` in a loop"


@register
class Analytic(Loop):
    """With analytic derivatives."""

    name, title = "scipy_jacobian", "SciPy's in a loop, analytic Jacobian"
    analytic = True
