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
from numpy.typing import ArrayLike

from accelstudy.adjustment.gauss_helmert import Linearisation
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.sensors.trace import SensorTrace
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.formula_cache import key_of
from accelstudy.symbolic.tracing import (
    Traced,
    derivative,
    inverse,
    symbolic,
    symbols,
    traced,
)


class CalibrationEquations:
    """Condition equations of a traced sensor model and an approach.

    Parameters
    ----------
    trace : SensorTrace
    approach : Approach
    estimates_gravity : bool
        Whether g is the last of the parameters, or fixed.

    Attributes
    ----------
    key : str, under which functions are kept; None if they are not
    n_parameters, n_observations : int, the latter per position
    knows_force : bool, whether the angles tell the force by the approach
    """

    def __init__(self, trace: SensorTrace, approach: Approach, estimates_gravity: bool) -> None:
        self.trace = trace
        self.approach = approach
        self.estimates_gravity = estimates_gravity
        self.key = key_of(*trace.kinds, type(approach), f"gravity {estimates_gravity}")
        self.n_parameters = trace.n_parameters + estimates_gravity
        self.n_observations = 5 if approach.uses_angles else 3
        level = (0.0, 0.0)
        self.knows_force = (
            approach.uses_angles and approach.force(level, STANDARD_GRAVITY, np) is not None
        )

    @cached_property
    def angles(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the robot's readings."""
        return symbols("phi_r", "theta_r") if self.approach.uses_angles else ()

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the parameters."""
        formulas = self.trace.formulas
        return (*formulas.p, formulas.g) if self.estimates_gravity else formulas.p

    @property
    def observations(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the observations."""
        return (*self.trace.formulas.output, *self.angles)

    @cached_property
    def attitude(self) -> tuple[Any, ...]:
        """Roll and pitch without the errors of the robot's reading."""
        errors = self.trace.formulas.reading_errors(self.angles) if self.angles else ()
        return tuple(a - e for a, e in zip(self.angles, errors, strict=True))

    @cached_property
    def known_force(self) -> sp.Matrix:
        """Force in the body frame by an approach that knows it, as a function of readings."""
        return sp.Matrix(self.approach.force(self.attitude, self.trace.formulas.g, symbolic))

    @property
    def arguments(self) -> tuple[sp.Symbol, ...]:
        """Symbols in the order in which generated functions take them."""
        return (*self.trace.formulas.arguments, *self.angles)

    @traced
    def sensitive(self) -> Traced:
        """f_a of the force that the approach knows."""
        return self.arguments, inverse(self.trace.formulas.t_matrix) * self.known_force

    @traced
    def linear(self) -> Traced:
        """[ψ | A | B] as a function of f_a, f_s, x and the robot's readings."""
        return self.arguments, self._in_output() if self.knows_force else self._in_body()

    def _in_body(self) -> sp.Matrix:
        trace = self.trace.formulas
        force = symbols("f_b_x", "f_b_y", "f_b_z")
        psi = sp.Matrix(self.approach.conditions(force, self.attitude, trace.g, symbolic))
        by_force = derivative(psi, force)
        a = by_force * trace.body_by(self.parameters) + derivative(psi, self.parameters)
        b = by_force * trace.body_by_output
        if self.angles:
            b = sp.Matrix.hstack(b, derivative(psi, self.angles))
        at = dict(zip(force, trace.t_matrix * sp.Matrix(trace.force), strict=True))
        return sp.Matrix.hstack(psi, a, b).xreplace(at)

    def _in_output(self) -> sp.Matrix:
        trace, known_force = self.trace.formulas, self.known_force
        h = sp.Matrix(trace.h)
        by_force = derivative(h, trace.force) * inverse(trace.t_matrix)
        turned = derivative(trace.t_matrix * sp.Matrix(trace.force), self.parameters)
        by_known = by_force * (derivative(known_force, self.parameters) - turned)
        a = -(derivative(h, self.parameters) + by_known)
        b = sp.Matrix.hstack(sp.eye(3), -by_force * derivative(known_force, self.angles))
        return sp.Matrix.hstack(sp.Matrix(trace.output) - h, a, b)

    def at(
        self,
        settings: Array,
        gravity: ArrayLike,
        hold: HoldConditions | None,
        common: Array | None = None,
    ) -> CalibrationConditions:
        """Return the conditions for settings (s,), gravity (float, where fixed) and holds.

        `common` (n, 2, k) has the derivatives of errors that the angles of all positions share.
        """
        return CalibrationConditions(self, settings, gravity, hold, common)


@dataclass(frozen=True)
class CalibrationConditions:
    """`CalibrationEquations` with all known quantities, as the adjustment takes them.

    Errors that the angles of all positions share are parameters, too: they follow those of the
    model, and gravity stays the last.
    """

    equations: CalibrationEquations
    settings: Array
    gravity: ArrayLike
    hold: HoldConditions | None
    common: Array | None = None

    def linearise(self, parameters: Array, adjusted: Array, latent: Array) -> Linearisation:
        """Linearise; `latent` is f_a of the iteration before."""
        eq, trace = self.equations, self.equations.trace
        u = trace.n_parameters
        x, g = parameters[:u], np.asarray(self.gravity, dtype=float)
        if eq.estimates_gravity:
            g = parameters[-1]
        forces, angles = adjusted[:3], adjusted[3:]
        if self.common is not None:
            shared = parameters[u : u + self.common.shape[-1]]
            angles = angles - np.einsum("nak,kr->arn", self.common, shared)
        arguments = (x, self.settings, g, self.hold)
        if eq.knows_force:
            f_a = trace.evaluate(eq.sensitive, forces, forces, *arguments, *angles)[:, 0]
        else:
            f_a = latent + trace.evaluate(trace.newton_step, latent, forces, *arguments)[:, 0]
        values = trace.evaluate(eq.linear, f_a, forces, *arguments, *angles)
        psi, (a, b) = values[:, 0], np.split(values[:, 1:], [eq.n_parameters], axis=1)
        if self.common is not None:
            by_shared = -np.einsum("carn,nak->ckrn", b[:, 3:], self.common)
            a = np.concatenate([a[:, :u], by_shared, a[:, u:]], axis=1)
        return Linearisation(psi, a, b, f_a)


@cache
def equations_of(
    trace: SensorTrace, approach: Approach, estimates_gravity: bool
) -> CalibrationEquations:
    """Return the condition equations, generated once, as that takes a fraction of a second."""
    return CalibrationEquations(trace, approach, estimates_gravity)
