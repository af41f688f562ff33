"""The calibration of an accelerometer as a Gauss–Helmert adjustment.

The condition equations follow from the definitions of the effects and of the approach alone. With
f_s = h(f_a, x) and f_b = T(x) f_a, an approach gives conditions ψ(f_b) = 0 for the f_b that belongs
to the adjusted output, and

    ∂f_a/∂f_s = H⁻¹,  ∂f_a/∂x = −H⁻¹ ∂h/∂x,   H = ∂h/∂f_a,

and the chain rule give A and B. The force f_a is carried through the iterations (the `latent`
quantity of the adjustment) and improved by one Newton step in each; it is exact when they end.

An approach that knows the force from the angles has f_a = T⁻¹ f_b(φ, θ, g), and conditions in the
output of the sensor, ψ = f_s − h(f_a, x). They need no inverse of h, which a saturated sensor does
not have.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.gauss_helmert import (
    Adjustment,
    Linearisation,
    adjust,
    joined,
    whitened_design,
)
from accelstudy.approaches import Approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.sensors.sensor import SensorModel, SensorTrace
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import TracedFunction, derivative, inverse, symbolic, symbols

Array = NDArray[np.float64]

AT_ONCE = 100_000
"""Positions, of all sessions together, that are adjusted at once; more would only take memory."""


@dataclass(frozen=True)
class Observations:
    """What was observed in n positions, R times.

    Parameters
    ----------
    forces : (R, n, 3) array, m/s², sensor output f_s
    sigma_force : float or (n, 3) array, m/s²
    angles : (R, n, 2) array, rad, roll and pitch of the robot; None without a robot
    sigma_angle : float or (n, 2) array, rad
    gravity : float or (R,) array, m/s²; one number where it is held fixed
    sigma_gravity : float, m/s²; 0 holds gravity fixed
    hold : HoldConditions, of the positions
    initial : (u,) array, SI, initial values of the model's parameters; an ideal sensor if None
    slope, sd_slope : (n, 3) arrays, m/s²/s, of the output within each position, and its standard
        deviation, R = 1; the adjustment does not use them
    """

    forces: Array
    sigma_force: ArrayLike
    angles: Array | None = None
    sigma_angle: ArrayLike = 0.0
    gravity: ArrayLike = STANDARD_GRAVITY
    sigma_gravity: float = 0.0
    hold: HoldConditions | None = None
    initial: Array | None = None
    slope: Array | None = None
    sd_slope: Array | None = None

    def take(self, positions: NDArray[np.int_]) -> Observations:
        """Return the sessions with some of their positions."""

        def chosen(values: ArrayLike) -> ArrayLike:
            return np.asarray(values)[positions] if np.ndim(values) == 2 else values

        return replace(
            self,
            forces=self.forces[:, positions],
            angles=None if self.angles is None else self.angles[:, positions],
            sigma_force=chosen(self.sigma_force),
            sigma_angle=chosen(self.sigma_angle),
            hold=None if self.hold is None else self.hold.take(positions),
            slope=None if self.slope is None else self.slope[positions],
            sd_slope=None if self.sd_slope is None else self.sd_slope[positions],
        )

    def sessions(self, chosen: slice) -> Observations:
        """Return some of the sessions."""
        angles, gravity = self.angles, np.asarray(self.gravity)
        return replace(
            self,
            forces=self.forces[chosen],
            angles=None if angles is None else angles[chosen],
            gravity=gravity[chosen] if gravity.ndim else gravity,
        )

    def first(self, replicates: int) -> Observations:
        """Return the first `replicates` sessions; all if there are fewer."""
        return self.sessions(slice(replicates))


class CalibrationEquations:
    """Condition equations of a traced sensor model and an approach.

    Parameters
    ----------
    trace : SensorTrace
    approach : Approach
    estimates_gravity : bool
        Whether g is the last of the parameters, or fixed.
    """

    def __init__(self, trace: SensorTrace, approach: Approach, estimates_gravity: bool) -> None:
        self.trace = trace
        self.approach = approach
        self.estimates_gravity = estimates_gravity
        self.angles = symbols("phi_r", "theta_r") if approach.uses_angles else ()
        self.parameters = (*trace.p, trace.g) if estimates_gravity else trace.p
        self.observations = (*trace.output, *self.angles)

    @cached_property
    def attitude(self) -> tuple[Any, ...]:
        """Roll and pitch without the errors of the robot's reading."""
        errors = self.trace.reading_errors(self.angles) if self.angles else ()
        return tuple(a - e for a, e in zip(self.angles, errors, strict=True))

    @cached_property
    def told(self) -> sp.Matrix | None:
        """Force in the body frame by the approach, as a function of readings; None if unknown."""
        force = self.approach.force(self.attitude, self.trace.g, symbolic) if self.angles else None
        return None if force is None else sp.Matrix(force)

    @cached_property
    def sensitive(self) -> TracedFunction:
        """f_a of the force that the approach knows, generated."""
        assert self.told is not None
        f_a = inverse(self.trace.t_matrix) * self.told
        return TracedFunction((*self.trace.arguments, *self.angles), f_a)

    @cached_property
    def linear(self) -> TracedFunction:
        """[ψ | A | B] as a function of f_a, f_s, x and the robot's readings, generated."""
        expressions = self._in_body() if self.told is None else self._in_output(self.told)
        return TracedFunction((*self.trace.arguments, *self.angles), expressions)

    def _in_body(self) -> sp.Matrix:
        trace = self.trace
        force = symbols("f_b_x", "f_b_y", "f_b_z")
        psi = sp.Matrix(self.approach.conditions(force, self.attitude, trace.g, symbolic))
        by_force = derivative(psi, force)
        a = by_force * trace.body_by(self.parameters) + derivative(psi, self.parameters)
        b = by_force * trace.body_by_output
        if self.angles:
            b = sp.Matrix.hstack(b, derivative(psi, self.angles))
        at = dict(zip(force, trace.t_matrix * sp.Matrix(trace.force), strict=True))
        return sp.Matrix.hstack(psi, a, b).xreplace(at)

    def _in_output(self, told: sp.Matrix) -> sp.Matrix:
        trace, h = self.trace, sp.Matrix(self.trace.h)
        by_force = derivative(h, trace.force) * inverse(trace.t_matrix)
        turned = derivative(trace.t_matrix * sp.Matrix(trace.force), self.parameters)
        by_told = by_force * (derivative(told, self.parameters) - turned)
        a = -(derivative(h, self.parameters) + by_told)
        b = sp.Matrix.hstack(sp.eye(3), -by_force * derivative(told, self.angles))
        return sp.Matrix.hstack(sp.Matrix(trace.output) - h, a, b)

    def at(
        self, settings: Array, gravity: ArrayLike, hold: HoldConditions | None
    ) -> CalibrationConditions:
        """Return the conditions for settings (s,), gravity (float, where fixed) and holds."""
        return CalibrationConditions(self, settings, gravity, hold)


@dataclass(frozen=True)
class CalibrationConditions:
    """`CalibrationEquations` with all known quantities, as the adjustment takes them."""

    equations: CalibrationEquations
    settings: Array
    gravity: ArrayLike
    hold: HoldConditions | None

    def linearise(self, parameters: Array, adjusted: Array, latent: Array) -> Linearisation:
        """Linearise; `latent` is f_a of the iteration before."""
        eq, trace = self.equations, self.equations.trace
        x, g = parameters, np.asarray(self.gravity, dtype=float)
        if eq.estimates_gravity:
            x, g = parameters[:-1], parameters[-1]
        forces, angles = adjusted[:3], adjusted[3:]
        known = (x, self.settings, g, self.hold)
        if eq.told is not None:
            f_a = trace.evaluate(eq.sensitive, forces, forces, *known, *angles)[:, 0]
        else:
            f_a = latent + trace.evaluate(trace.newton_step, latent, forces, *known)[:, 0]
        values = trace.evaluate(eq.linear, f_a, forces, *known, *angles)
        u = len(parameters)
        return Linearisation(values[:, 0], values[:, 1 : 1 + u], values[:, 1 + u :], f_a)


@cache
def equations_of(
    trace: SensorTrace, approach: Approach, estimates_gravity: bool
) -> CalibrationEquations:
    """Return the condition equations, generated once, as that takes a fraction of a second."""
    return CalibrationEquations(trace, approach, estimates_gravity)


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
        Parameters in the order of ``model.parameters``; gravity follows as the last one if it is
        observed (``sigma_gravity > 0``). Observations are f_x, f_y, f_z and, with a robot, roll and
        pitch; variances are absolute, so the variance of unit weight a priori is 1.

    Raises
    ------
    InputError
        If angles or a column are missing that the approach or the model needs, or there are fewer
        conditions than unknowns.
    """
    count, n = observed.forces.shape[:2]
    size = max(1, AT_ONCE // n)
    if count <= size:
        return _calibrated(CalibrationProblem.of(model, approach, observed))
    parts = []
    for start in range(0, count, size):
        part = observed.sessions(slice(start, start + size))
        parts.append(_calibrated(CalibrationProblem.of(model, approach, part)))
    return joined(parts)


def _calibrated(problem: CalibrationProblem) -> Adjustment:
    return adjust(
        problem.conditions,
        problem.observations,
        problem.cofactors,
        problem.initial,
        parameter_observations=problem.initial,
        parameter_weights=problem.weights,
        latent=np.moveaxis(problem.observations[..., :3], -1, 0),
    )


def whitened_jacobian(
    model: SensorModel, approach: Approach, observed: Observations, parameters: ArrayLike
) -> Array:
    """Design matrix of the first session, scaled to unit weight, at given parameters.

    Parameters
    ----------
    model, approach, observed : as in `calibrate`; the observations must fit the parameters
    parameters : (u,) array, SI, without gravity

    Returns
    -------
    (m, u') array; AᵀA is the normal matrix. With observed gravity a column and a row are added.
    """
    problem = CalibrationProblem.of(model, approach, observed)
    x = problem.initial[:1].copy()
    x[0, : model.n_parameters] = parameters
    at = problem.linearised(x[0], problem.observations[0])
    white = whitened_design(at, problem.cofactors.T)
    rows = np.moveaxis(white[:, :, 0], 1, -1).reshape(-1, x.shape[1])
    weighted = np.flatnonzero(problem.weights)
    return np.concatenate([rows, np.diag(np.sqrt(problem.weights))[weighted]])


@dataclass(frozen=True)
class CalibrationProblem:
    """Observed sessions in the form in which `adjust` takes them.

    `observed` holds the forces (R, n, 3) and, if the approach uses them, the angles (R, n, 2).
    """

    model: SensorModel
    conditions: CalibrationConditions
    observed: tuple[Array, ...]
    cofactors: Array
    initial: Array
    weights: Array

    @classmethod
    def of(
        cls, model: SensorModel, approach: Approach, observed: Observations
    ) -> CalibrationProblem:
        """Arrange what was observed."""
        forces = np.asarray(observed.forces, dtype=float)
        n = forces.shape[1]
        values, sigmas = [forces], [np.broadcast_to(observed.sigma_force, (n, 3))]
        if approach.uses_angles:
            if observed.angles is None:
                raise InputError(f"approach {approach.name!r} needs the robot's roll and pitch")
            values.append(np.asarray(observed.angles, dtype=float))
            sigmas.append(np.broadcast_to(observed.sigma_angle, (n, 2)))

        with_gravity = observed.sigma_gravity > 0
        equations = equations_of(model.trace, approach, with_gravity)
        initial = np.zeros((len(forces), len(equations.parameters)))
        weights = np.zeros(len(equations.parameters))
        if observed.initial is not None:
            initial[:, : model.n_parameters] = observed.initial
        if with_gravity:
            initial[:, -1] = observed.gravity
            weights[-1] = observed.sigma_gravity**-2
        fixed = float(np.ravel(observed.gravity)[0])
        if not with_gravity and np.any(np.asarray(observed.gravity) != fixed):
            raise InputError(
                "gravity differs between the sessions, but is held fixed: give one value for all, "
                "or sigma_gravity > 0"
            )
        return cls(
            model=model,
            conditions=equations.at(model.settings, fixed, observed.hold),
            observed=tuple(values),
            cofactors=np.concatenate(sigmas, axis=-1) ** 2,
            initial=initial,
            weights=weights,
        )

    @cached_property
    def observations(self) -> Array:
        """All observations, (R, n, o)."""
        return np.concatenate(self.observed, axis=-1)

    def linearised(self, parameters: Array, adjusted: Array) -> Linearisation:
        """Linearise one session at parameters (u',) and observations (n, o)."""
        forces, latent = adjusted[:, :3], adjusted[:, :3]
        if self.conditions.equations.told is None:
            p = parameters[: self.model.n_parameters]
            g = parameters[-1] if self.weights.any() else self.conditions.gravity
            latent = self.model.sensitive_force(forces, p, g, self.conditions.hold)
        return self.conditions.linearise(
            parameters[:, None], adjusted.T[:, None], latent.T[:, None]
        )
