"""The condition equations of a calibration, traced from a sensor model and an approach.

They follow from the definitions of the effects and of the approach alone. With f_s = h(f_a, x) and
f_b = T(x) f_a, an approach gives conditions ψ(f_b) = 0 for the f_b that belongs to the adjusted
output. The derivatives

    ∂f_a/∂f_s = H⁻¹,  ∂f_a/∂x = −H⁻¹ ∂h/∂x,   H = ∂h/∂f_a,

and the chain rule give A and B. The force f_a is carried through the iterations (the `latent`
quantity of the adjustment) and improved by one Newton step in each; it is exact when they end.

An approach that knows the force from the angles has f_a = T⁻¹ f_b(φ, θ, g), and conditions in the
output of the sensor, ψ = f_s − h(f_a, x). They need no inverse of h, which a saturated sensor does
not have.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.adjustment.gauss_helmert import Linearisation
from accelstudy.approaches import Approach
from accelstudy.effects import HoldConditions
from accelstudy.sensors.trace import SensorTrace
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import TracedFunction, derivative, inverse, symbolic, symbols

Array = NDArray[np.float64]


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
    def known_force(self) -> sp.Matrix | None:
        """Force in the body frame by the approach, as a function of readings; None if unknown."""
        force = self.approach.force(self.attitude, self.trace.g, symbolic) if self.angles else None
        return None if force is None else sp.Matrix(force)

    @cached_property
    def sensitive(self) -> TracedFunction:
        """f_a of the force that the approach knows, generated."""
        assert self.known_force is not None
        f_a = inverse(self.trace.t_matrix) * self.known_force
        return TracedFunction((*self.trace.arguments, *self.angles), f_a)

    @cached_property
    def linear(self) -> TracedFunction:
        """[ψ | A | B] as a function of f_a, f_s, x and the robot's readings, generated."""
        expressions = (
            self._in_body() if self.known_force is None else self._in_output(self.known_force)
        )
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

    def _in_output(self, known_force: sp.Matrix) -> sp.Matrix:
        trace, h = self.trace, sp.Matrix(self.trace.h)
        by_force = derivative(h, trace.force) * inverse(trace.t_matrix)
        turned = derivative(trace.t_matrix * sp.Matrix(trace.force), self.parameters)
        by_known = by_force * (derivative(known_force, self.parameters) - turned)
        a = -(derivative(h, self.parameters) + by_known)
        b = sp.Matrix.hstack(sp.eye(3), -by_force * derivative(known_force, self.angles))
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
        arguments = (x, self.settings, g, self.hold)
        if eq.known_force is not None:
            f_a = trace.evaluate(eq.sensitive, forces, forces, *arguments, *angles)[:, 0]
        else:
            f_a = latent + trace.evaluate(trace.newton_step, latent, forces, *arguments)[:, 0]
        values = trace.evaluate(eq.linear, f_a, forces, *arguments, *angles)
        u = len(parameters)
        return Linearisation(values[:, 0], values[:, 1 : 1 + u], values[:, 1 + u :], f_a)


@cache
def equations_of(
    trace: SensorTrace, approach: Approach, estimates_gravity: bool
) -> CalibrationEquations:
    """Return the condition equations, generated once, as that takes a fraction of a second."""
    return CalibrationEquations(trace, approach, estimates_gravity)
