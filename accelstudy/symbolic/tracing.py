"""From formulas to fast array functions: trace once with symbols, differentiate, generate code.

A sensor model, an approach and the leveling equations are written once, in components. Here they
are evaluated with SymPy symbols, differentiated exactly, freed of common subexpressions and turned
into NumPy functions. The symbolic form can be had (`TracedFunction.expressions`), so that other
kernels can be generated from the same definitions.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, cached_property, partial, reduce
from types import CodeType, FunctionType
from typing import Any, ClassVar, Protocol, TypeAlias

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.formula_cache import cached_by_key, key_of


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
            raise AttributeError(f"xp has no {name!r}; it has {', '.join(sorted(self._names))}")
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


Traced: TypeAlias = "tuple[tuple[sp.Symbol, ...], sp.Matrix]"
"""Arguments, and a matrix of expressions of them."""


class TracedFunction:
    """A NumPy function that is generated from formulas, and the formulas themselves.

    A call returns an array whose shape begins with that of the matrix of expressions. The function
    is kept on disk, and the formulas are traced only if it is not there, or if they are asked for.

    Parameters
    ----------
    trace : function without arguments that returns arguments and expressions
    key : str, under which the function is kept; None if it is not (`formula_cache.key_of`)
    name : str, of the function among those of the key
    """

    def __init__(self, trace: Callable[[], Traced], key: str | None, name: str) -> None:
        self._trace = trace
        self._key, self._name = key, name

    @cached_property
    def _traced(self) -> Traced:
        return self._trace()

    @property
    def arguments(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the arguments."""
        return self._traced[0]

    @property
    def expressions(self) -> sp.Matrix:
        """Matrix of expressions."""
        return self._traced[1]

    def _generate(self) -> tuple[tuple[int, int], list[tuple[int, int]], list[str], CodeType]:
        """Shape, entries that are not zero, symbols that occur, and the code of a function."""
        matrix = self.expressions
        rows, columns = matrix.shape
        entries = [(i, j) for i in range(rows) for j in range(columns) if matrix[i, j] != 0]
        nonzero = [matrix[entry] for entry in entries]
        function = sp.lambdify(self.arguments, nonzero, modules="numpy", cse=True)
        used = sorted(str(symbol) for symbol in matrix.free_symbols)
        return (rows, columns), entries, used, function.__code__

    @cached_property
    def _generated(self) -> tuple[tuple[int, int], list[tuple[int, int]], list[str], CodeType]:
        return cached_by_key(self._key, self._name, self._generate)

    @cached_property
    def _function(self) -> Callable[..., list[Any]]:
        return FunctionType(self._generated[3], _NAMES)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._generated[0]

    @cached_property
    def used(self) -> frozenset[str]:
        """Names of the arguments on which the result depends."""
        return frozenset(self._generated[2])

    @property
    def is_zero(self) -> bool:
        """Whether all entries are zero by structure."""
        return not self._generated[1]

    def __call__(self, shape: tuple[int, ...], *arguments: Any) -> Array:
        """Evaluate at arrays that broadcast to `shape`; returns an array (rows, columns, *shape).

        The components come first, so that each is contiguous. Entries that are zero by structure
        cost nothing.
        """
        result = np.zeros((*self.shape, *shape))
        for entry, value in zip(self._generated[1], self._function(*arguments), strict=True):
            result[entry] = value
        return result


_NAMES = {**vars(np), "reduce": reduce}
"""Functions of generated code."""


class HasKey(Protocol):
    """Something that formulas are of."""

    @property
    def key(self) -> str | None:
        """Under which they are kept."""


def traced(trace: Callable[[Any], Traced]) -> cached_property[TracedFunction]:
    """Make a property of a method that returns arguments and expressions: the function of them."""

    def function(of: HasKey) -> TracedFunction:
        return TracedFunction(partial(trace, of), of.key, trace.__name__)

    function.__doc__ = trace.__doc__
    return cached_property(function)


@cache
def jacobian_of(function: Callable[..., Sequence[Any]], n: int) -> Callable[[Array], Array]:
    """Jacobian of a function ``function(components, xp)`` of `n` components, by tracing.

    Returns a function of an array (..., n) with values (..., m, n).
    """

    def trace() -> Traced:
        variables = symbols(*(f"v{i}" for i in range(n)))
        return variables, derivative(function(variables, symbolic), variables)

    matrix = TracedFunction(trace, key_of(function, str(n)), "jacobian")

    def evaluate(values: Array) -> Array:
        return np.moveaxis(matrix(values.shape[:-1], *np.moveaxis(values, -1, 0)), (0, 1), (-2, -1))

    return evaluate
