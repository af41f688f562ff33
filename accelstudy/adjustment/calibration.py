"""The calibration of an accelerometer as a Gauss–Helmert adjustment."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.equations import CalibrationConditions, equations_of
from accelstudy.adjustment.gauss_helmert import (
    Adjustment,
    Linearisation,
    adjust,
    whitened_design,
)
from accelstudy.adjustment.observations import Observations
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.sensors.sensor import SensorModel

AT_ONCE = 100_000
"""Positions, of all sessions together, that are adjusted at once; more would only take memory."""


def calibrate(model: SensorModel, approach: Approach, observed: Observations) -> Adjustment:
    """Calibrate R simulated or measured sessions.

    Parameters
    ----------
    model : SensorModel
    approach : Approach
    observed : Observations

    Returns
    -------
    Adjustment
        Parameters in the order of ``model.parameters``; those of errors that all angles share
        follow, and gravity is the last if it is observed (``sigma_gravity > 0``). Observations are
        f_x, f_y, f_z and, with a robot, roll and pitch; variances are absolute, so the variance of
        unit weight a priori is 1.

    Raises
    ------
    InputError
        If angles or a column are missing that the approach or the model needs, or there are fewer
        conditions than unknowns.
    """
    count, n = observed.forces.shape[:2]
    size = max(1, AT_ONCE // n)
    if count <= size:
        return CalibrationProblem.of(model, approach, observed).adjust()
    parts = []
    for start in range(0, count, size):
        part = observed.sessions(slice(start, start + size))
        parts.append(CalibrationProblem.of(model, approach, part).adjust())
    return Adjustment.concatenate(parts)


@dataclass(frozen=True)
class CalibrationProblem:
    """Observed sessions as the linearised problem that `adjust` solves.

    `observed` holds the forces (R, n, 3) and, if the approach uses them, the angles (R, n, 2).
    `direct` holds what is known of the parameters directly, (R, u), and `weights` (u,) its weights:
    gravity, what effects know of their parameters a priori, and errors that all angles share.
    """

    model: SensorModel
    conditions: CalibrationConditions
    observed: tuple[Array, ...]
    cofactors: Array
    initial: Array
    direct: Array
    weights: Array

    @classmethod
    def of(
        cls, model: SensorModel, approach: Approach, observed: Observations
    ) -> CalibrationProblem:
        """Arrange the observations of sessions for the adjustment."""
        forces = np.asarray(observed.forces, dtype=float)
        n = forces.shape[1]
        common = observed.common if approach.uses_angles else None
        values, sigmas = [forces], [np.broadcast_to(observed.sigma_force, (n, 3))]
        if approach.uses_angles:
            if observed.angles is None:
                raise InputError(f"approach {approach.name!r} needs the robot's roll and pitch")
            values.append(np.asarray(observed.angles, dtype=float))
            sigmas.append(np.broadcast_to(observed.sigma_angle, (n, 2)))

        with_gravity = observed.sigma_gravity > 0
        equations = equations_of(model.trace, approach, with_gravity)
        u, shared = model.n_parameters, 0 if common is None else common.shape[-1]
        initial = np.zeros((len(forces), equations.n_parameters + shared))
        direct, weights = np.zeros_like(initial), np.zeros(initial.shape[1])
        weights[:u] = model.prior_weights
        for k, name in enumerate(model.parameter_names):
            if name in observed.known:
                direct[:, k], sigma = observed.known[name]
                weights[k] = sigma**-2
        weights[u : u + shared] = 1.0
        if observed.initial is not None:
            initial[:, :u] = observed.initial
        if with_gravity:
            initial[:, -1] = direct[:, -1] = observed.gravity
            weights[-1] = observed.sigma_gravity**-2
        fixed = float(np.ravel(observed.gravity)[0])
        if not with_gravity and np.any(np.asarray(observed.gravity) != fixed):
            raise InputError(
                "gravity differs between the sessions, but is held fixed: give one value for all, "
                "or sigma_gravity > 0"
            )
        return cls(
            model=model,
            conditions=equations.at(model.settings, fixed, observed.hold, common),
            observed=tuple(values),
            cofactors=np.concatenate(sigmas, axis=-1) ** 2,
            initial=initial,
            direct=direct,
            weights=weights,
        )

    @property
    def with_gravity(self) -> bool:
        """Whether gravity is an observation, and with that the last parameter."""
        return self.conditions.equations.estimates_gravity

    @cached_property
    def observations(self) -> Array:
        """All observations, (R, n, o)."""
        return np.concatenate(self.observed, axis=-1)

    def adjust(self) -> Adjustment:
        """Adjust all sessions."""
        return adjust(
            self.conditions,
            self.observations,
            self.cofactors,
            self.initial,
            parameter_observations=self.direct,
            parameter_weights=self.weights,
            latent=np.moveaxis(self.observations[..., :3], -1, 0),
        )

    def linearise(self, parameters: Array, adjusted: Array) -> Linearisation:
        """Linearise all sessions at parameters (R, u') and observations (R, n, o)."""
        forces = latent = adjusted[..., :3]
        if not self.conditions.equations.knows_force:
            p = parameters[:, : self.model.n_parameters]
            g = parameters[:, -1] if self.with_gravity else self.conditions.gravity
            latent = self.model.sensitive_force(forces, p, g, self.conditions.hold)
        components = (np.moveaxis(each, -1, 0) for each in (parameters, adjusted, latent))
        return self.conditions.linearise(*components)

    def rows(self, parameters: Array) -> Array:
        """Design matrices at unit weight, (R, conditions, u'), of the raw observations."""
        white = whitened_design(self.linearise(parameters, self.observations), self.cofactors.T)
        return np.asarray(white.transpose(2, 0, 3, 1).reshape(len(parameters), -1, white.shape[1]))


@dataclass(frozen=True)
class Block:
    """Calibrations of R replicates of one set-up; NaN where one did not converge.

    Attributes
    ----------
    estimates, sigma_priori : (R, u) arrays, SI; gravity is the last parameter if it is observed
    omega : (R,) array
    redundancy : int
    iterations : (R,) int array
    converged : (R,) bool array
    correlation_sum : (u, u) array, sum over the converged replicates of the correlations from Σ_xx
    """

    estimates: Array
    sigma_priori: Array
    omega: Array
    redundancy: int
    iterations: NDArray[np.int_]
    converged: NDArray[np.bool_]
    correlation_sum: Array

    @classmethod
    def of(cls, result: Adjustment) -> Block:
        """Reduce an adjustment to the numbers that a study needs."""
        q = result.cofactors[result.converged]
        sigma = np.sqrt(np.diagonal(q, axis1=1, axis2=2))
        return cls(
            estimates=result.parameters,
            sigma_priori=result.sigma_priori,
            omega=result.omega,
            redundancy=result.redundancy,
            iterations=result.iterations,
            converged=result.converged,
            correlation_sum=(q / (sigma[:, :, None] * sigma[:, None, :])).sum(axis=0),
        )
