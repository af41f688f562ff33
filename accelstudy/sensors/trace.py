"""A composition of effects in symbols, and the functions that are generated from it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, cached_property
from typing import Any

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.effects import Effect, HoldConditions
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.formula_cache import cached_by_key, key_of
from accelstudy.symbolic.tracing import (
    Traced,
    TracedFunction,
    derivative,
    inverse,
    symbolic,
    symbols,
    traced,
)

HOLD = "hold_"
"""Prefix of the symbols of columns of `HoldConditions`."""


class SensorFormulas:
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
        self._hold = HoldSymbols(HOLD)
        effects = [_in_symbols(kind) for kind in kinds]
        parameters = [symbols(*(q.name for q in effect.parameters)) for effect in effects]
        self._effects = list(zip(effects, parameters, strict=True))
        self.p = tuple(symbol for of_effect in parameters for symbol in of_effect)
        self.settings = tuple(symbol for effect in effects for symbol in effect.settings.values())

        self.t_matrix = sp.eye(3)
        for effect, p in self._effects:
            self.t_matrix += sp.Matrix(effect.axes(p, symbolic))
        self.before_last = self._adding(self.force, last=False)
        self.h = self._adding(self.before_last, last=True)
        # Only now all temperatures behind a lag are known.
        self._readings = self.reading_errors(self.force[:2])

    def _adding(self, force: Sequence[Any], last: bool) -> list[Any]:
        """Sum the outputs of the effects that act last, or of all others."""
        total = list(force)
        for effect, p in self._effects:
            if effect.last == last:
                added = effect.output(tuple(force), p, self.g, self._hold, symbolic)
                total = [a + b for a, b in zip(total, added, strict=True)]
        return total

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
        conditions = (*self._hold.columns.values(), *self._hold.lagged_by.values())
        return (*self.force, *self.output, *self.p, *self.settings, self.g, *conditions)

    @property
    def lags(self) -> list[tuple[int, str]]:
        """Number of the setting with the lag, and name, of each temperature behind a lag."""
        return [(self.settings.index(tau), str(t)) for tau, t in self._hold.lagged_by.items()]

    @property
    def conditions(self) -> list[str]:
        """Names of columns of holds, and of temperatures behind lags, that occur."""
        return self._conditions_in([*self.h, *self.t_matrix, *self._readings])

    def _conditions_in(self, expressions: Sequence[Any]) -> list[str]:
        conditions = {*self._hold.columns.values(), *self._hold.lagged_by.values()}
        return sorted(map(str, sp.Matrix(expressions).free_symbols & conditions))

    @property
    def affine(self) -> bool:
        """Whether the output is linear in the force, and depends on nothing but it."""
        slopes = derivative(self.h, self.force).free_symbols
        return not (slopes & {*self.force, self.g} or self._conditions_in(self.h))

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

    @property
    def slope_of_last(self) -> sp.Matrix:
        """∂f_s/∂f_o, (3, 3), as a function of f_a."""
        slope = derivative(self._adding(self.force, last=True), self.force)
        return slope.xreplace(dict(zip(self.force, self.before_last, strict=True)))


class SensorTrace:
    """Functions that are generated from a composition of kinds of effects.

    Attributes
    ----------
    kinds : tuple of types of Effect
    key : str, under which they are kept; None if they are not
    n_parameters : int
    informed : tuple of int, which parameters, by number, have a prior
    """

    def __init__(self, kinds: tuple[type[Effect], ...]) -> None:
        self.kinds = kinds
        self.key = key_of(*kinds)
        has = [kind.informed for kind in kinds for _ in kind.parameters]
        self.n_parameters = len(has)
        self.informed = tuple(i for i, known in enumerate(has) if known)

    @cached_property
    def formulas(self) -> SensorFormulas:
        """The composition in symbols."""
        return SensorFormulas(self.kinds)

    @cached_property
    def conditions(self) -> frozenset[str]:
        """Names of columns of holds, and of temperatures behind lags, that occur."""
        return frozenset(cached_by_key(self.key, "conditions", lambda: self.formulas.conditions))

    @cached_property
    def affine(self) -> bool:
        """Whether the output is linear in the force, and depends on nothing but it."""
        return cached_by_key(self.key, "affine", lambda: self.formulas.affine)

    @cached_property
    def _lags(self) -> list[tuple[int, str]]:
        return cached_by_key(self.key, "lags", lambda: self.formulas.lags)

    def lags(self, settings: Array) -> list[tuple[float, str]]:
        """Lags of temperatures, of settings (s,), with the names of the temperatures."""
        return [(float(settings[number]), name) for number, name in self._lags]

    def evaluate(
        self,
        function: TracedFunction,
        force: Array,
        output: Array,
        parameters: Array,
        settings: Array,
        g: Array,
        hold: HoldConditions | None,
        *more: Array,
    ) -> Array:
        """Call a generated function, components first.

        force, output : (3, ..., n); parameters : (u, ...); settings : (s,); g : (...); more :
        (..., n), arguments of the function beyond `arguments`. Returns (rows, columns, ..., n).
        """
        hold = hold or HoldConditions()
        columns = [
            hold.column(name) if HOLD + name in function.used else 0.0 for name in hold.columns()
        ]
        columns += [
            hold.lagged(tau) if name in function.used else 0.0 for tau, name in self.lags(settings)
        ]
        shape = np.broadcast_shapes(force.shape[1:], (*parameters.shape[1:], 1), (*g.shape, 1))
        x = (*parameters[..., None], *settings)
        return function(shape, *force, *output, *x, g[..., None], *columns, *more)

    @traced
    def sense(self) -> Traced:
        """f_s of f_b."""
        at = self.formulas
        f_a = inverse(at.t_matrix) * sp.Matrix(at.force)
        of = dict(zip(at.force, f_a, strict=True))
        h = [sp.sympify(e).subs(of, simultaneous=True) for e in at.h]
        return at.arguments, sp.Matrix(h)

    @traced
    def reading(self) -> Traced:
        """Errors of the robot's reading, with roll and pitch in place of the first two forces."""
        at = self.formulas
        return at.arguments, sp.Matrix(at.reading_errors(at.force[:2]))

    @traced
    def body_jacobian(self) -> Traced:
        """∂f_b/∂x for the parameters of the model."""
        return self.formulas.arguments, self.formulas.body_by(self.formulas.p)

    @traced
    def output_jacobian(self) -> Traced:
        """∂f_b/∂f_s."""
        return self.formulas.arguments, self.formulas.body_by_output

    @traced
    def by_last(self) -> Traced:
        """∂f_s/∂f_o: what the last effects make of a change that comes before them."""
        return self.formulas.arguments, self.formulas.slope_of_last

    @traced
    def newton_step(self) -> Traced:
        """What to add to f_a so that the model's output comes closer to l."""
        at = self.formulas
        return at.arguments, at.h_inverse * (sp.Matrix(at.output) - sp.Matrix(at.h))

    @traced
    def body(self) -> Traced:
        """f_b of f_a."""
        at = self.formulas
        return at.arguments, at.t_matrix * sp.Matrix(at.force)


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
