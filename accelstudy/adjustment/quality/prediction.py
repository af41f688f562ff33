"""How well a calibration predicts positions that it did not use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.gauss_helmert import ConditionEquations, Linearisation, adjust
from accelstudy.adjustment.observations import Observations
from accelstudy.adjustment.quality.solution import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.leveling.angles import angles_of, wrap_angle
from accelstudy.sensors.sensor import SensorModel

Array = NDArray[np.float64]

NEAR_POLE = 0.1
"""Cosine of pitch below which an error of roll says nothing of the tilt."""
MAX_REFITS = 200
"""Number of positions up to which each is left out in an adjustment of its own. Among more, one
position changes the parameters so little that the derivatives at the common solution suffice."""


@dataclass(frozen=True)
class HeldOut:
    """How well each position is predicted by a calibration from all others.

    Attributes
    ----------
    misclosures : (n, c) array, m/s², |f_b| − g, or the output less that in the robot's attitude;
        NaN where the others do not determine the parameters
    cofactors : (n, c, c) array, (m/s²)², covariance matrices a priori of the misclosures
    angles : (n, 2) array, rad, calibrated roll and pitch less the robot's; None without a robot.
        NaN in roll where the x axis is nearly vertical
    """

    misclosures: Array
    cofactors: Array
    angles: Array | None

    @property
    def n_predicted(self) -> int:
        """Number of positions that could be predicted; the rms are over these."""
        return int(np.count_nonzero(~np.isnan(self.misclosures[:, 0])))

    @property
    def rms(self) -> float:
        """Rms of |misclosure|, m/s²."""
        return float(_rms(np.linalg.norm(self.misclosures, axis=1)))

    @property
    def rms_angles(self) -> Array | None:
        """Rms of roll and of pitch, rad, (2,)."""
        return None if self.angles is None else np.array([_rms(a) for a in self.angles.T])


def _rms(values: Array) -> float:
    predicted = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(predicted**2))) if len(predicted) else np.nan


def held_out(model: SensorModel, approach: Approach, observed: Observations) -> HeldOut | None:
    """Leave each position out in turn, calibrate, and predict it; None if r < c.

    Parameters
    ----------
    model, approach, observed : as in `calibrate`, one session
    """
    problem = CalibrationProblem.of(model, approach, observed)
    n, c, u = observed.forces.shape[1], approach.n_conditions, len(problem.weights)
    if n * c + np.count_nonzero(problem.weights) - u < c:
        return None
    if n > MAX_REFITS:
        x, misclosures, cofactors = _derived(solve(model, approach, observed))
    else:
        x, misclosures, cofactors = _refitted(problem, c)
    angles = None
    if observed.angles is not None and approach.uses_angles:
        p = x[:, : model.n_parameters]
        g = x[:, -1] if problem.with_gravity else np.full(n, problem.conditions.gravity)
        # Each position has parameters of its own, so they are sessions of one position.
        hold = None if observed.hold is None else observed.hold.take(np.arange(n)[:, None])
        f_b = model.correct(observed.forces[0][:, None], p, g, hold)[:, 0]
        readings = observed.angles[0]
        attitude = readings - model.errors_of_reading(readings[:, None], p, hold)[:, 0]
        angles = _attitude_error(f_b, attitude)
    return HeldOut(misclosures, cofactors, angles)


def _refitted(problem: CalibrationProblem, c: int) -> tuple[Array, Array, Array]:
    """Parameters (n, u), misclosures (n, c) and their cofactors, each without one position."""
    n, u = problem.observations.shape[1], len(problem.weights)
    forces = np.repeat(np.moveaxis(problem.observations[..., :3], -1, 0), n, axis=1)
    initial, direct = (
        np.repeat(np.pad(values, ((0, 0), (0, c))), n, axis=0)
        for values in (problem.initial, problem.direct)
    )
    result = adjust(
        _WithoutOne(problem.conditions, c),
        np.repeat(problem.observations, n, axis=0),
        problem.cofactors,
        initial,
        parameter_observations=direct,
        parameter_weights=np.pad(problem.weights, (0, c)),
        latent=np.concatenate([forces, np.eye(n)[None]]),
    )
    return result.parameters[:, :u], -result.parameters[:, u:], result.cofactors[:, u:, u:]


def _derived(solution: Solution) -> tuple[Array, Array, Array]:
    """Results as of `_refitted` by derivatives at the common solution, dx = Q_xx Ãᵀ R_ii⁻¹ e_i."""
    n, c = solution.misclosures.shape
    root, rank = solution.root
    root = np.where((rank == c)[:, None, None], root, np.nan)
    scaled = root @ np.swapaxes(root, 1, 2) @ solution.errors[: n * c].reshape(n, c, 1)
    design = solution.design[: n * c].reshape(n, c, -1)
    steps = (np.swapaxes(design, 1, 2) @ scaled)[..., 0] @ solution.cofactors
    scatter = solution.whitening @ root
    return (
        solution.parameters + steps,
        (solution.whitening @ scaled)[..., 0],
        scatter @ np.swapaxes(scatter, 1, 2),
    )


@dataclass(frozen=True)
class _WithoutOne:
    """Condition equations in which replicate i does without position i, all of equal shape.

    The conditions of the position are not removed. Each gets an unknown shift, the last c
    parameters, which absorbs all information of the position. At the end it is minus the misclosure
    that the others predict. The last row of `latent` marks the position.
    """

    conditions: ConditionEquations
    n_conditions: int

    def linearise(self, parameters: Array, adjusted: Array, latent: Array) -> Linearisation:
        c, left_out = self.n_conditions, latent[-1]
        at = self.conditions.linearise(parameters[:-c], adjusted, latent[:-1])
        shifts = np.eye(c)[:, :, None, None] * left_out
        carried = () if at.latent is None else at.latent
        return Linearisation(
            at.psi + parameters[-c:, :, None] * left_out,
            np.concatenate([at.jac_parameters, shifts], axis=1),
            at.jac_observations,
            np.concatenate([carried, left_out[None]]),
        )


def _attitude_error(f: Array, angles: Array) -> Array:
    """Roll and pitch of `f` less the given ones, (n, 2), roll wrapped into ±π."""
    roll, pitch = (angles_of(f) - angles).T
    roll = np.where(np.cos(angles[:, 1]) < NEAR_POLE, np.nan, wrap_angle(roll))
    return np.stack([roll, pitch], axis=-1)
