"""The compiled function of a calibration: its arguments, and the formulas that it evaluates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import sympy as sp

from accelstudy.adjustment.equations import CalibrationEquations
from accelstudy.kernel.formulas import Formulas
from accelstudy.symbolic.tracing import TracedFunction, symbols

NAME = "calibrate"
INTEGERS = ("positions", "replicates")
POINTERS = (
    *("known", "forces", "angles", "initial", "weights"),
    *("work", "results", "correlations"),
)
"""Arguments of the function, in order; `KernelFunction` says what they hold."""


@dataclass(frozen=True)
class KernelFunction:
    """The function that calibrates the replicates of one kind of sensor model with one approach.

    The function has these arguments, for n positions, R replicates, u parameters (gravity is the
    last if it is estimated), o observations per position and k known numbers:

        known         (n, 2 o + k)  variances of the observations, their 1/σ (0 where σ = 0),
                                    and the numbers of `known`
        forces        (R, n, 3)
        angles        (R, n, 2)     if the approach uses them
        initial       (R, u)        of the parameters; the last is observed if it is gravity
        weights       (u,)          of the observations of parameters: of gravity, or none
        work          (n, work, LANES)
        results       (2 u + 3, R') estimates, sigmas, Ω, iterations, converged (1 or 0); R' is R
                                    rounded up to a multiple of LANES
        correlations  (u (u − 1)/2, LANES)  sums over the converged replicates, below the diagonal
                                    row by row; added to what is there

    Parameters
    ----------
    equations : CalibrationEquations
    """

    equations: CalibrationEquations

    @property
    def unknowns(self) -> int:
        """Parameters u."""
        return len(self.equations.parameters)

    @property
    def observed(self) -> int:
        """Observations o per position."""
        return len(self.equations.observations)

    @property
    def conditions(self) -> int:
        """Conditions c per position."""
        return int(self.equations.linear.expressions.shape[0])

    @cached_property
    def latent(self) -> tuple[sp.Symbol, ...]:
        """Symbols of f_a of the iteration before; none where the approach knows the force."""
        return () if self.equations.known_force is not None else symbols("a_x", "a_y", "a_z")

    @cached_property
    def _same(self) -> frozenset[sp.Symbol]:
        lanes = {*self.equations.parameters, *self.equations.observations, *self.latent}
        return frozenset(self.equations.trace.arguments) - lanes - set(self.equations.trace.force)

    @cached_property
    def sensitive(self) -> Formulas:
        """f_a from the known force, or from that of the iteration before."""
        eq, trace = self.equations, self.equations.trace
        if not self.latent:
            return Formulas(list(eq.sensitive.expressions), self._same)
        before = dict(zip(trace.force, self.latent, strict=True))
        step = trace.newton_step.expressions.xreplace(before)
        return Formulas([a + s for a, s in zip(self.latent, step, strict=True)], self._same)

    @cached_property
    def linear(self) -> Formulas:
        """[ψ | A | B], row by row."""
        return Formulas(list(self.equations.linear.expressions), self._same)

    @cached_property
    def known(self) -> TracedFunction:
        """Known numbers of a position, (k, 1)."""
        expressions = [*self.sensitive.known.values(), *self.linear.known.values()]
        return TracedFunction(
            self.equations.trace.arguments, sp.Matrix(len(expressions), 1, expressions)
        )

    @property
    def columns(self) -> int:
        """Numbers of `known` per position."""
        return 2 * self.observed + len(self.known.expressions)

    @property
    def work(self) -> int:
        """Vectors of `work` per position."""
        c, u, o = self.conditions, self.unknowns, self.observed
        return 2 * o + len(self.latent) + c * (u + 1 + o)
