"""A composition of effects in symbols, and the functions that are generated from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.effects import Effect, HoldConditions
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import TracedFunction, derivative, inverse, symbolic, symbols


class SensorTrace:
    """A composition of kinds of effects evaluated with symbols, those of their settings included.

    Attributes
    ----------
    force, output, p, settings, g : the symbols of a force, of the output, of the parameters, of the
        settings of the effects and of gravity
    t_matrix : Matrix (3, 3), T
    h : list of 3 expressions, f_s as a function of f_a
    """

    def __init__(self, kinds: tuple[type[Effect], ...]) -> None:
        self.force = symbols("f_x", "f_y", "f_z")
        self.output = symbols("l_x", "l_y", "l_z")
        (self.g,) = symbols("g")
        self._hold = HoldSymbols("hold_")
        effects = [_in_symbols(kind) for kind in kinds]
        parameters = [symbols(*(q.name for q in effect.parameters)) for effect in effects]
        self._effects = list(zip(effects, parameters, strict=True))
        self.p = tuple(symbol for of_effect in parameters for symbol in of_effect)
        self.settings = tuple(symbol for effect in effects for symbol in effect.settings.values())

        self.t_matrix = sp.eye(3)
        for effect, p in self._effects:
            self.t_matrix += sp.Matrix(effect.axes(p, symbolic))
        self._before_last = self._adding(self.force, last=False)
        self.h = self._adding(self._before_last, last=True)

    def _adding(self, force: Sequence[Any], last: bool) -> list[Any]:
        """Add what effects make of a force, those that act last or the others."""
        total = list(force)
        for effect, p in self._effects:
            if effect.last == last:
                added = effect.output(tuple(force), p, self.g, self._hold, symbolic)
                total = [a + b for a, b in zip(total, added, strict=True)]
        return total

    @property
    def hold(self) -> dict[str, sp.Symbol]:
        """Symbols of the columns of `HoldConditions`."""
        return self._hold.columns

    @property
    def lagged(self) -> dict[sp.Symbol, sp.Symbol]:
        """Symbols of temperatures behind a lag, by that of the lag."""
        return self._hold.lagged_by

    @property
    def informed(self) -> tuple[int, ...]:
        """Which parameters, by number, have a prior."""
        has = [effect.informed for effect, p in self._effects for _ in p]
        return tuple(i for i, known in enumerate(has) if known)

    def lags(self, settings: NDArray[np.float64]) -> list[float]:
        """Lags of the temperatures of `lagged`, of settings (s,)."""
        values = dict(zip(self.settings, settings, strict=True))
        return [float(values[tau]) for tau in self.lagged]

    def reading_errors(self, angles: tuple[Any, Any]) -> tuple[Any, Any]:
        """Sum of what the effects add to the robot's reading of roll and pitch."""
        total: tuple[Any, Any] = (sp.S.Zero, sp.S.Zero)
        for effect, p in self._effects:
            added = effect.reading(angles, p, self._hold, symbolic)
            total = (total[0] + added[0], total[1] + added[1])
        return total

    @property
    def arguments(self) -> tuple[sp.Symbol, ...]:
        """Symbols in the order in which generated functions take them."""
        conditions = (*self.hold.values(), *self.lagged.values())
        return (*self.force, *self.output, *self.p, *self.settings, self.g, *conditions)

    def evaluate(
        self,
        function: TracedFunction,
        force: NDArray[np.float64],
        output: NDArray[np.float64],
        parameters: NDArray[np.float64],
        settings: NDArray[np.float64],
        g: NDArray[np.float64],
        hold: HoldConditions | None,
        *more: NDArray[np.float64],
    ) -> NDArray[np.float64]:
        """Call a generated function, components first.

        force, output : (3, ..., n); parameters : (u, ...); settings : (s,); g : (...); more :
        (..., n), arguments of the function beyond `arguments`. Returns (rows, columns, ..., n).
        """
        hold = hold or HoldConditions()
        columns = [
            hold.column(name) if symbol in function.used else 0.0
            for name, symbol in self.hold.items()
        ]
        columns += [
            hold.lagged(tau) if symbol in function.used else 0.0
            for tau, symbol in zip(self.lags(settings), self.lagged.values(), strict=True)
        ]
        shape = np.broadcast_shapes(force.shape[1:], (*parameters.shape[1:], 1), (*g.shape, 1))
        x = (*parameters[..., None], *settings)
        return function(shape, *force, *output, *x, g[..., None], *columns, *more)

    @cached_property
    def sense(self) -> TracedFunction:
        """f_s of f_b."""
        f_a = inverse(self.t_matrix) * sp.Matrix(self.force)
        at = dict(zip(self.force, f_a, strict=True))
        h = [sp.sympify(e).subs(at, simultaneous=True) for e in self.h]
        return TracedFunction(self.arguments, sp.Matrix(h))

    @cached_property
    def reading(self) -> TracedFunction:
        """Errors of the robot's reading, with roll and pitch in place of the first two forces."""
        return TracedFunction(self.arguments, sp.Matrix(self.reading_errors(self.force[:2])))

    @cached_property
    def h_inverse(self) -> sp.Matrix:
        """(∂f_s/∂f_a)⁻¹, (3, 3)."""
        return inverse(derivative(self.h, self.force))

    @cached_property
    def body_by_output(self) -> sp.Matrix:
        """∂f_b/∂f_s = T H⁻¹, (3, 3), as a function of f_a."""
        return self.t_matrix * self.h_inverse

    def body_by(self, parameters: tuple[sp.Symbol, ...]) -> sp.Matrix:
        """∂f_b/∂x at a given output, (3, u), as a function of f_a."""
        f_b = self.t_matrix * sp.Matrix(self.force)
        return derivative(f_b, parameters) - self.body_by_output * derivative(self.h, parameters)

    @cached_property
    def body_jacobian(self) -> TracedFunction:
        """∂f_b/∂x for the parameters of the model, generated."""
        return TracedFunction(self.arguments, self.body_by(self.p))

    @cached_property
    def output_jacobian(self) -> TracedFunction:
        """∂f_b/∂f_s, generated."""
        return TracedFunction(self.arguments, self.body_by_output)

    @cached_property
    def by_last(self) -> TracedFunction:
        """∂f_s/∂f_o, generated: what the last effects make of a change that comes before them."""
        slope = derivative(self._adding(self.force, last=True), self.force)
        at = dict(zip(self.force, self._before_last, strict=True))
        return TracedFunction(self.arguments, slope.xreplace(at))

    @cached_property
    def newton_step(self) -> TracedFunction:
        """What to add to f_a so that the model's output comes closer to l."""
        misfit = sp.Matrix(self.output) - sp.Matrix(self.h)
        return TracedFunction(self.arguments, self.h_inverse * misfit)

    @cached_property
    def body(self) -> TracedFunction:
        """f_b of f_a."""
        return TracedFunction(self.arguments, self.t_matrix * sp.Matrix(self.force))


@cache
def trace_of(kinds: tuple[type[Effect], ...]) -> SensorTrace:
    """Return the trace of effects of some kinds; it takes a fraction of a second, so once."""
    return SensorTrace(kinds)


def _in_symbols(kind: type[Effect]) -> Effect:
    """Effect of a kind whose settings are symbols."""
    effect = kind()
    names = tuple(effect.settings)
    values = symbols(*(f"{effect.name}_{name}" for name in names))
    effect.settings = dict(zip(names, values, strict=True))
    return effect
