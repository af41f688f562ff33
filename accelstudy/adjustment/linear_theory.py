"""Linear theory: the error of a calibration as a linear function of the observation errors.

With the Jacobians A and B of the conditions where noise-free observations are adjusted, and with
W = (B Q Bᵀ)⁻¹ and N = Aᵀ W A, observation errors v change the estimates by −N⁻¹ Aᵀ W B v, up to
terms of second order in v. Of normal v the distribution of this is known exactly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from accelstudy.adjustment import cholesky
from accelstudy.adjustment.calibration import CalibrationProblem, calibrate
from accelstudy.adjustment.gauss_helmert import whiten
from accelstudy.adjustment.observations import Observations
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.sensors.sensor import SensorModel


@dataclass(frozen=True)
class LinearTheory:
    """Errors of the calibrations of one set-up, by linear theory.

    There are u parameters; gravity is the last if it is observed.

    Attributes
    ----------
    reference : (u,) array, SI, estimates from observations without noise
    covariance : (u, u) array, of the errors
    sigma : (u,) array, standard deviations a priori, √ of the diagonal of N⁻¹
    redundancy : int
    misfit : float, Ω of the observations without noise; 0 where the model is that of the sensor
    chi_squared : bool
        Whether Ω has the (noncentral) χ² distribution. It has not where parameters have a prior.
    """

    reference: Array
    covariance: Array
    sigma: Array
    redundancy: int
    misfit: float
    chi_squared: bool
    _whitening: Array  # (n, c, o), L⁻¹ B, from errors to misclosures of unit weight
    _gravity: float  # 1/σ_g, the same for gravity; 0 where it is not observed
    _rest: Array  # (m,), misclosures of unit weight without errors
    _solution: Array  # (m, u), −L⁻¹ A N⁻¹, from misclosures to errors of the estimates
    _normal: Array  # (u, u), N

    @classmethod
    def of(
        cls, model: SensorModel, approach: Approach, observed: Observations
    ) -> LinearTheory | None:
        """Linearise a set-up.

        Parameters
        ----------
        model, approach : as in `calibrate`
        observed : Observations, one session without noise

        Returns
        -------
        LinearTheory, or None if the session has no calibration
        """
        ideal = calibrate(model, approach, observed)
        if not ideal.converged[0]:
            return None
        problem = CalibrationProblem.of(model, approach, observed)
        x, v = ideal.parameters[0], ideal.residuals[0]
        at = problem.linearise(x[None], problem.observations + v)
        white = whiten(at, v.T[:, None], problem.cofactors.T)
        by_errors = cholesky.forward(white.factor, at.jac_observations)
        a = np.moveaxis(white.design[:, :, 0], -1, 0).reshape(-1, len(x))
        rest = white.misclosures[:, 0].T.ravel()
        gravity = float(np.sqrt(problem.weights[-1])) if problem.with_gravity else 0.0
        if gravity:
            a = np.vstack([a, gravity * np.eye(len(x))[-1:]])
            rest = np.append(rest, gravity * (x[-1] - problem.direct[0, -1]))
        # What is known of parameters a priori has no error in a simulation.
        certain = problem.weights * (np.arange(len(x)) < model.n_parameters)
        normal = a.T @ a + np.diag(certain)
        scale = np.sqrt(np.diagonal(normal))
        inverse = np.linalg.inv(normal / scale[:, None] / scale) / scale[:, None] / scale
        return cls(
            reference=x,
            covariance=inverse - inverse * certain @ inverse,
            sigma=np.sqrt(np.diagonal(inverse)),
            redundancy=ideal.redundancy,
            misfit=float(ideal.omega[0]),
            chi_squared=not certain.any(),
            _whitening=np.moveaxis(by_errors[:, :, 0], -1, 0),
            _gravity=gravity,
            _rest=rest,
            _solution=-a @ inverse,
            _normal=normal,
        )

    def errors(self, errors: Array, gravity: Array | None = None) -> tuple[Array, Array]:
        """Errors of the estimates (R, u), and Ω (R,), of given errors of the observations.

        Parameters
        ----------
        errors : (R, n, o) array, of the forces and, where the approach uses them, of the angles
        gravity : (R,) array, m/s², of the value of gravity, where it is observed
        """
        z = np.einsum("nco,rno->rnc", self._whitening, errors).reshape(len(errors), -1)
        if gravity is not None and self._gravity:
            z = np.column_stack([z, -self._gravity * gravity])
        estimates = z @ self._solution
        explained = np.einsum("ru,ru->r", estimates @ self._normal, estimates)
        return estimates, self.misfit + np.einsum("rm,rm->r", z + 2 * self._rest, z) - explained

    def directions(self, scale: Array) -> tuple[Array, Array]:
        """The part of the noise that linear theory sees, P ε, and the errors, root · P ε.

        Parameters
        ----------
        scale : (n o + 1,) array, standard deviations of the errors of the observations, position
            by position, and of gravity; ε are the errors over them

        Returns
        -------
        P : (r, n o + 1) array with orthonormal rows; its transpose is its pseudo-inverse
        root : (u, r) array, whose product with its transpose is the covariance
        """
        n, c, o = self._whitening.shape
        solution = self._solution[: n * c].reshape(n, c, -1)
        by_errors = np.einsum("nco,ncu->nou", self._whitening, solution).reshape(n * o, -1)
        by_gravity = -self._gravity * self._solution[-1] * bool(self._gravity)
        slope = np.vstack([by_errors, by_gravity]).T * scale
        size = np.linalg.norm(slope, axis=1)
        size[size == 0] = 1.0
        left, values, seen = np.linalg.svd(slope / size[:, None], full_matrices=False)
        significant = values > np.finfo(float).eps * len(scale) * values[0]
        return seen[significant], size[:, None] * left[:, significant] * values[significant]
