"""From formulas to code in lanes, with common subexpressions computed once."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial, reduce
from typing import Any, TypeAlias

from accelstudy.kernel.lanes import Code, Mask, Term, absolute, fma, sqrt
from accelstudy.symbolic.algebra import sp

Table: TypeAlias = "dict[sp.Symbol, Term]"


class Formulas:
    """Expressions, split into parts that differ between replicates and parts that do not.

    Parts that depend on the position alone (temperatures, settings, functions of them) are the same
    in all replicates and iterations. They get symbols of their own, whose values `known` are
    computed once.

    Parameters
    ----------
    expressions : sequence of expressions
    same : symbols of quantities that are the same in all replicates

    Attributes
    ----------
    known : dict of symbol to the expression, in symbols of `same`, whose value it stands for
    """

    def __init__(self, expressions: Sequence[Any], same: frozenset[sp.Symbol]) -> None:
        shared, self._results = sp.cse(
            expressions, symbols=sp.numbered_symbols("shared_"), list=True
        )
        self.known: dict[sp.Symbol, Any] = {}
        self._same = same
        self._expanded: dict[sp.Symbol, Any] = {}
        self._shared: list[tuple[sp.Symbol, Any]] = []
        for symbol, expression in shared:
            if expression.free_symbols <= same | self._expanded.keys():
                self._expanded[symbol] = expression.xreplace(self._expanded)
            else:
                self._shared.append((symbol, self._with_symbols(expression)))
        self._results = [self._with_symbols(expression) for expression in self._results]

    def _with_symbols(self, expression: Any) -> Any:
        """Replace the largest parts that are the same in all replicates by symbols."""
        if expression.is_number:
            return expression
        if expression.free_symbols <= self._same | self._expanded.keys():
            expanded = expression.xreplace(self._expanded)
            if expanded.is_Symbol:
                self.known[expanded] = expanded
                return expanded
            names = {value: symbol for symbol, value in self.known.items()}
            # By number: the place of a SymPy dummy in a sum depends on what was traced before.
            symbol = names.get(expanded) or sp.Symbol(f"known_{len(self.known):03}", real=True)
            self.known[symbol] = expanded
            return symbol
        if expression.is_Symbol:
            return expression
        return expression.func(*(self._with_symbols(part) for part in expression.args))

    def write(self, code: Code, table: Mapping[sp.Symbol, Term]) -> list[Term]:
        """Write the expressions at values of all symbols, those of `known` included."""
        values = dict(table)
        for symbol, expression in self._shared:
            values[symbol] = _value(code, expression, values)
        return [_value(code, expression, values) for expression in self._results]


def _value(code: Code, e: Any, values: Table) -> Term:
    if e.is_Symbol:
        return values[e]
    if e.is_number:
        return float(e)
    if e.is_Add:
        return _sum(code, e.args, values)
    if e.is_Mul:
        first, second = _factors(code, e, values)
        return first * second
    if e.is_Pow:
        return _power(code, _value(code, e.base, values), e.exp)
    write = _FUNCTIONS.get(e.func.__name__)
    if write is None:
        raise NotImplementedError(f"no code for {e.func}")
    return write(code, *(_value(code, part, values) for part in e.args))


def _sum(code: Code, terms: Sequence[Any], values: Table) -> Term:
    """Sum, with fused multiply-adds; terms that are no products come first."""
    total: Term = 0.0
    for term in sorted(terms, key=lambda term: bool(term.is_Mul)):
        if term.is_Mul:
            total = fma(*_factors(code, term, values), total)
        else:
            total = _value(code, term, values) + total
    return total


def _factors(code: Code, product: Any, values: Table) -> tuple[Term, Term]:
    """Two factors of a product."""
    coefficient, parts = product.as_coeff_mul()
    factors = [_value(code, part, values) for part in parts]
    first: Term = float(coefficient)
    for factor in factors[:-1]:
        first = first * factor
    return first, factors[-1]


def _power(code: Code, base: Term, exponent: Any) -> Term:
    if exponent.is_negative:
        return 1.0 / _power(code, base, -exponent)
    if exponent.is_Integer:
        half = int(exponent) // 2
        root = base if exponent == 1 or half == 1 else _power(code, base, sp.Integer(half))
        square = root * root if half else root
        return square * base if half and int(exponent) % 2 else square
    if (2 * exponent).is_Integer:
        return _power(code, sqrt(base), 2 * exponent)
    return code.library("pow", base, float(exponent))


_HALF_PI = (math.pi / 2, 6.123233995736766e-17, -1.4973849048591833e-33)
"""π/2 in parts, each with the digits that follow those of the part before."""
_SINE = (
    *(1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06),
    *(-1.98412698298579493134e-04, 8.33333333332248946124e-03, -1.66666666666666324348e-01),
)
_COSINE = (
    *(-1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07),
    *(2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02),
)
"""The polynomials of the C library FDLIBM, error below 2⁻⁵⁷ up to π/4, highest power first."""


def _turned(code: Code, a: Term, quarters: int) -> Term:
    """sin(a + quarters π/2).

    The C library's sine takes one number at a time, and longer than all the rest together.
    """
    count = code.intrinsic("rint", a * (2 / math.pi))
    rest = a
    for part in _HALF_PI:
        rest = fma(count, -part, rest)
    square = rest * rest
    sine, cosine = _polynomial(_SINE, square), _polynomial(_COSINE, square)
    sine = fma(rest * square, sine, rest)
    cosine = fma(square * square, cosine, fma(square, -0.5, 1.0))

    turns = count + float(quarters)
    pairs = code.intrinsic("floor", turns * 0.5)
    odd = code.compare("!=", turns, pairs * 2.0)
    negative = code.compare("!=", pairs, code.intrinsic("floor", pairs * 0.5) * 2.0)
    value = odd.select(cosine, sine)
    return negative.select(-value, value)


def _polynomial(coefficients: Sequence[float], x: Term) -> Term:
    result: Term = coefficients[0]
    for coefficient in coefficients[1:]:
        result = fma(result, x, coefficient)
    return result


def _tangent(code: Code, a: Term) -> Term:
    return _turned(code, a, 0) / _turned(code, a, 1)


def _sign(code: Code, a: Term) -> Term:
    return _above(code, a).select(1.0, code.compare("<", a, 0.0).select(-1.0, a))


def _step(code: Code, a: Term, at_zero: Term = 0.5) -> Term:
    zero = code.compare("==", a, 0.0).select(at_zero, a)
    return _above(code, a).select(1.0, code.compare("<", a, 0.0).select(0.0, zero))


def _above(code: Code, a: Term) -> Mask:
    return code.compare(">", a, 0.0)


def _extreme(name: str) -> Callable[..., Term]:
    return lambda code, *values: reduce(partial(code.intrinsic, name), values)


_FUNCTIONS: dict[str, Callable[..., Term]] = {
    "sin": lambda code, a: _turned(code, a, 0),
    "cos": lambda code, a: _turned(code, a, 1),
    "tan": _tangent,
    "exp": lambda code, a: code.library("exp", a),
    "atan2": lambda code, a, b: code.library("atan2", a, b),
    "Abs": lambda code, a: absolute(a),
    "sign": _sign,
    "Heaviside": _step,
    "Max": _extreme("maximum"),
    "Min": _extreme("minimum"),
}
"""Functions of `accelstudy.symbolic.tracing.symbolic` and of their derivatives."""
