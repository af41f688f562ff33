"""From formulas to fast array functions: trace once with symbols, differentiate, generate code.

A sensor model, an approach and the leveling equations are written once, in components. Here they
are evaluated with SymPy symbols, differentiated exactly, freed of common subexpressions and turned
into NumPy functions. The symbolic form is kept (`TracedFunction.expressions`), so that other
kernels can be generated from the same definitions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from accelstudy.symbolic.algebra import sp


class _Symbolic:
    """SymPy's functions under NumPy's names."""

    _names: ClassVar = {
        "arctan2": "atan2",
        "abs": "Abs",
        "maximum": "Max",
        "minimum": "Min",
        **{name: name for name in ("sqrt", "sin", "cos", "tan", "exp", "sign", "pi")},
    }

    def __getattr__(self, name: str) -> Any:
        if name not in self._names:
            raise AttributeError(name)
        return getattr(sp, self._names[name])


symbolic = _Symbolic()
"""The namespace `xp` for tracing."""


def symbols(*names: str) -> tuple[sp.Symbol, ...]:
    """Real symbols, so that derivatives of abs and of squares stay simple."""
    return tuple(sp.Symbol(name, real=True) for name in names)


def derivative(expressions: Sequence[Any], variables: Sequence[sp.Symbol]) -> sp.Matrix:
    """Jacobian matrix; the derivative of a step is zero, as it is almost everywhere."""
    matrix = sp.Matrix([_slopes(sp.sympify(e), variables) for e in expressions])
    # SymPy leaves that of a step as it is if it does not know what steps to be finite.
    of_step = matrix.atoms(sp.Derivative)
    assert all(isinstance(left.expr, sp.sign) for left in of_step)
    matrix = matrix.xreplace(dict.fromkeys(of_step, sp.S.Zero))
    return matrix.replace(sp.DiracDelta, lambda *_: sp.S.Zero)


def _slopes(expression: Any, variables: Sequence[sp.Symbol]) -> list[Any]:
    """Derivatives of an expression; SymPy would look for each variable in each term of a sum."""
    terms = [(term, term.free_symbols) for term in sp.Add.make_args(expression)]
    return [sp.Add(*(t.diff(v) for t, free in terms if v in free)) for v in variables]


def inverse(matrix: sp.Matrix) -> sp.Matrix:
    """Inverse of a 3 × 3 matrix.

    The inverse is formed of placeholders. With the entries themselves SymPy would expand their
    products, which takes seconds for a full matrix and saves nothing in the generated code. `inv`
    would also prove that the determinant is not zero, which takes longer than all else.
    """
    if matrix.is_diagonal():
        return sp.diag(*(1 / matrix[i, i] for i in range(3)))
    place = sp.Matrix(3, 3, lambda i, j: sp.Dummy() if matrix[i, j] != 0 else 0)
    entries = {place[i, j]: matrix[i, j] for i in range(3) for j in range(3) if place[i, j] != 0}
    return (place.adjugate() / place.det(method="berkowitz")).xreplace(entries)


@dataclass(frozen=True)
class TracedFunction:
    """A generated NumPy function and the symbolic form from which it was generated.

    Parameters
    ----------
    arguments : tuple of Symbol
    expressions : matrix of expressions; a call returns an array whose shape begins with theirs
    """

    arguments: tuple[sp.Symbol, ...]
    expressions: sp.Matrix

    @cached_property
    def _entries(self) -> list[tuple[int, int]]:
        rows, columns = self.expressions.shape
        return [(i, j) for i in range(rows) for j in range(columns) if self.expressions[i, j] != 0]

    @cached_property
    def _function(self) -> Callable[..., list[Any]]:
        nonzero = [self.expressions[entry] for entry in self._entries]
        function: Callable[..., list[Any]] = sp.lambdify(
            self.arguments, nonzero, modules="numpy", cse=True
        )
        return function

    @cached_property
    def used(self) -> frozenset[sp.Basic]:
        """Arguments on which the result depends."""
        return frozenset(self.expressions.free_symbols)

    def __call__(self, shape: tuple[int, ...], *arguments: Any) -> NDArray[np.float64]:
        """Evaluate at arrays that broadcast to `shape`; returns an array (rows, columns, *shape).

        The components come first, so that each is contiguous. Entries that are zero by structure
        cost nothing.
        """
        result = np.zeros((*self.expressions.shape, *shape))
        for entry, value in zip(self._entries, self._function(*arguments), strict=True):
            result[entry] = value
        return result


def jacobian_of(
    function: Callable[..., Sequence[Any]], n: int
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """Jacobian of a function ``function(components, xp)`` of `n` components, by tracing.

    Returns a function of an array (..., n) with values (..., m, n).
    """
    variables = symbols(*(f"v{i}" for i in range(n)))
    traced = TracedFunction(variables, derivative(function(variables, symbolic), variables))

    def evaluate(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.moveaxis(traced(values.shape[:-1], *np.moveaxis(values, -1, 0)), (0, 1), (-2, -1))

    return evaluate
