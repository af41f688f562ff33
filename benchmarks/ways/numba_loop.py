"""Numba: a loop over the sessions, printed from the same traced formulas and compiled as it stands.

It follows `accelstudy.adjustment.gauss_helmert`, which explains it, one session after the other, in
scalars: sums over small matrices, their factors and solutions are written out, and what is zero
by structure is left out. Products are added by fused multiply-adds, as the compiled code of this
package does. There is no `prange` and no `fastmath`.
"""

import math
from contextlib import contextmanager
from importlib.util import find_spec

import numpy as np
import sympy as sp

from accelstudy.adjustment.calibration import CalibrationProblem
from accelstudy.adjustment.equations import equations_of
from accelstudy.adjustment.gauss_helmert import (
    MAX_ITERATIONS,
    PIVOT_TOLERANCE,
    STEP_TOLERANCE,
    redundancy_of,
)
from problem import MODEL
from ways.base import Way, register

INSTALLED = find_spec("numba") is not None
if INSTALLED:
    from numba import njit, types
    from numba.extending import intrinsic

    @intrinsic
    def fma(typing, a, b, c):
        """Product and sum a b + c, rounded once."""
        number = types.float64

        def code(context, builder, signature, arguments):
            return builder.fma(*arguments)

        return number(number, number, number), code


@register
class Loop(Way):
    """A loop over sessions, compiled by Numba."""

    name, title = "numba", "Numba, a loop over sessions"
    calibrations, difference = 5000, 1e-10

    @staticmethod
    def missing():
        """Return what to install."""
        return "" if INSTALLED else "uv pip install numba"

    def __init__(self, approach):
        self._approach = approach
        self._text = _Text(equations_of(MODEL.trace, approach, False))
        names = {"fma": fma, "sqrt": math.sqrt, "math": math, "nan": math.nan}
        exec("\n".join(self._text.lines), names)
        self._fit = njit(error_model="numpy")(names["fit"])

    def solve(self, observed):
        """Solve them."""
        problem = CalibrationProblem.of(MODEL, self._approach, observed)
        count, n, _ = problem.observations.shape
        u, c = self._text.u, self._text.c
        results, work = np.empty((2 * u + 1, count)), np.empty((n, self._text.work))
        gravity = float(problem.conditions.gravity)
        self._fit(problem.observations, problem.cofactors, gravity, work, results)
        sigma_0 = np.sqrt(results[-1] / redundancy_of(c * n, problem.weights))
        return np.array([results[:u].T, (results[u : 2 * u] * sigma_0).T])


class _Text:
    """The lines of the function. Operands are names (text) or constants (numbers)."""

    def __init__(self, equations):
        self.equations = equations
        self.u, self.o = len(equations.parameters), len(equations.observations)
        self.c = equations.linear.shape[0]
        self.latent = 0 if equations.knows_force else 3
        self.work = 2 * self.o + self.latent + self.c * (self.u + 1 + self.o)
        self.lines, self.indent, self.count = [], "", 0
        with self.block("def fit(observed, cofactors, g, work, results):"):
            self.line("count, n = observed.shape[:2]")
            with self.block("for session in range(count):"):
                self.session()

    def session(self):
        u, o = self.u, self.o
        x, unit = self.names("x", u), self.names("unit", u)
        right, dx = self.names("right", u), self.names("dx", u)
        normal = [self.names(f"n{i}", i + 1) for i in range(u)]
        for k in range(2 * u + 1):
            self.line(f"results[{k}, session] = nan")
        self.line(" = ".join([*x, "0.0"]))
        with self.block("for i in range(n):"):
            for k in range(o):
                self.line(f"work[i, {k}] = observed[session, i, {k}]")
                self.line(f"work[i, {o + k}] = 0.0")
            for k in range(self.latent):
                self.line(f"work[i, {2 * o + k}] = observed[session, i, {k}]")
        with self.block(f"for _ in range({MAX_ITERATIONS}):"):
            sums = [*(value for row in normal for value in row), *right]
            self.line(" = ".join([*sums, "omega", "size_v", "size_psi", "0.0"]))
            with self.block("for i in range(n):"):
                stored = self.position(x, normal, right)
            for k in range(u):
                self.line(f"unit_{k} = 1.0 / sqrt({normal[k][k]})")
            scaled = [
                [self.named(f"{normal[i][j]} * {unit[i]} * {unit[j]}") for j in range(i + 1)]
                for i in range(u)
            ]
            factor = self.factor(scaled, PIVOT_TOLERANCE)
            half = self.forward(factor, [self.product(right[k], unit[k]) for k in range(u)])
            for k, value in enumerate(self.backward(factor, half)):
                self.line(f"{dx[k]} = {value} * {unit[k]}")
                self.line(f"{x[k]} += {dx[k]}")
            with self.block("for i in range(n):"):
                self.residuals(stored, dx)
            self.line(f"size = max(sqrt({self.dot(half, half)}), size_v, size_psi)")
            with self.block("if not size < math.inf:"):
                self.line("break")
            with self.block(f"if size <= {STEP_TOLERANCE!r}:"):
                for k in range(u):
                    column = self.forward(factor, [float(j == k) for j in range(u)])
                    self.line(f"results[{k}, session] = {x[k]}")
                    variance = self.dot(column, column)
                    self.line(f"results[{u + k}, session] = sqrt({variance}) * {unit[k]}")
                self.line(f"results[{2 * u}, session] = omega")
                self.line("break")

    def position(self, x, normal, right):
        """Add a position to the normal equations; returns what it keeps for the residuals."""
        u, o, equations = self.u, self.o, self.equations
        trace, formulas = equations.trace, equations.trace.formulas
        v = [self.named(f"work[i, {o + k}]") for k in range(o)]
        adjusted = [self.named(f"work[i, {k}] + {v[k]}") for k in range(o)]
        table = dict(zip(equations.parameters, x, strict=True)) | {formulas.g: "g"}
        table |= dict(zip(equations.observations, adjusted, strict=True))
        inner = equations.sensitive if not self.latent else trace.newton_step
        before = [self.named(f"work[i, {2 * o + k}]") for k in range(self.latent)]
        table |= zip(formulas.force[: self.latent], before, strict=True)
        f_a = self.formulas(inner.expressions, table)
        if self.latent:
            f_a = [self.named(f"{a} + {b}") for a, b in zip(before, f_a, strict=True)]
        for k, value in enumerate(f_a[: self.latent]):
            self.line(f"work[i, {2 * o + k}] = {value}")
        table |= zip(formulas.force, f_a, strict=True)
        values = self.formulas(equations.linear.expressions, table)
        rows = [values[k : k + 1 + u + o] for k in range(0, len(values), 1 + u + o)]
        psi, a, b = zip(*((row[0], row[1 : 1 + u], row[1 + u :]) for row in rows), strict=True)

        q = [self.named(f"cofactors[i, {k}]") for k in range(o)]
        bq = [[self.product(value, each) for value, each in zip(row, q, strict=True)] for row in b]
        m = [[self.dot(bq[j], b[k]) for k in range(j + 1)] for j in range(self.c)]
        whitening = self.factor(m, 0.0)
        for value in self.forward(whitening, psi):
            self.line(f"size_psi = max(size_psi, abs({value}))")
        w = [self.named(f"{value} - {self.dot(row, v)}") for value, row in zip(psi, b, strict=True)]
        columns = [*zip(*a, strict=True), w, *zip(*bq, strict=True)]
        white = zip(*(self.forward(whitening, column) for column in columns), strict=True)
        stored, place = [], 2 * o + self.latent
        for row in white:
            for i in range(u):
                for j in range(i + 1):
                    self.line(f"{normal[i][j]} = {self.added(row[i], row[j], normal[i][j])}")
                self.line(f"{right[i]} = {self.added(_minus(row[i]), row[u], right[i])}")
            stored.append([])
            for value in row:
                if isinstance(value, str):
                    self.line(f"work[i, {place}] = {value}")
                stored[-1].append(f"work[i, {place}]" if isinstance(value, str) else value)
                place += isinstance(value, str)
        return stored

    def residuals(self, stored, dx):
        """Residuals v of a position, and what it adds to Ω."""
        u, o = self.u, self.o
        v = [0.0] * o
        for row in stored:
            misclosure = row[u]
            for value, change in zip(row[:u], dx, strict=True):
                misclosure = self.added(value, change, misclosure)
            self.line(f"omega = {self.added(misclosure, misclosure, 'omega')}")
            v = [
                self.added(_minus(misclosure), row[u + 1 + k], before) for k, before in enumerate(v)
            ]
        for k, value in enumerate(v):
            step = f"abs({value} - work[i, {o + k}]) / sqrt(cofactors[i, {k}])"
            self.line(f"size_v = max(size_v, {step})")
            self.line(f"work[i, {o + k}] = {value}")

    def formulas(self, expressions, table):
        """Values of expressions at the names of their symbols."""
        self.count += 1
        names = {symbol: sp.Symbol(name) for symbol, name in table.items()}
        shared, results = sp.cse(list(expressions), sp.numbered_symbols(f"f{self.count}_"))
        for symbol, expression in shared:
            self.line(f"{symbol} = {sp.pycode(expression.xreplace(names))}")
        return [
            float(each) if each.is_number else self.named(sp.pycode(each.xreplace(names)))
            for each in results
        ]

    # Small matrices, lower triangles in rows; a factor is what is below the diagonal, and 1/L_kk.

    def factor(self, matrix, tolerance):
        lower, pivots = [[] for _ in matrix], []
        for j in range(len(matrix)):
            pivot = matrix[j][j]
            for value in lower[j]:
                pivot = self.added(_minus(value), value, pivot)
            pivots.append(self.named(f"1.0 / sqrt({pivot} if {pivot} > {tolerance} else nan)"))
            for i in range(j + 1, len(matrix)):
                below = matrix[i][j]
                for a, b in zip(lower[i], lower[j], strict=True):
                    below = self.added(_minus(a), b, below)
                lower[i].append(self.product(below, pivots[j]))
        return lower, pivots

    def forward(self, factor, right):
        result = []
        for row, pivot, value in zip(*factor, right, strict=True):
            for a, y in zip(row, result, strict=True):
                value = self.added(_minus(a), y, value)
            result.append(self.product(value, pivot))
        return result

    def backward(self, factor, right):
        (lower, pivots), result = factor, list(right)
        for i in reversed(range(len(result))):
            for j in range(i + 1, len(result)):
                result[i] = self.added(_minus(lower[j][i]), result[j], result[i])
            result[i] = self.product(result[i], pivots[i])
        return result

    def dot(self, a, b):
        total = 0.0
        for x, y in zip(a, b, strict=True):
            total = self.added(x, y, total)
        return total

    # Numbers.

    def product(self, a, b):
        """Write a b."""
        for one, other in ((a, b), (b, a)):
            if one in (0, 1, -1):
                return {0: 0.0, 1: other, -1: _minus(other)}[one]
        return self.named(f"{a} * {b}") if isinstance(a, str) or isinstance(b, str) else a * b

    def added(self, a, b, c):
        """Write a b + c."""
        if {a, b} & {0, 1, -1} or c == 0 or not (isinstance(a, str) or isinstance(b, str)):
            product = self.product(a, b)
            return c if product == 0 else product if c == 0 else self.named(f"{product} + {c}")
        return self.named(f"fma({a}, {b}, {c})")

    # Lines.

    def names(self, name, count):
        return [f"{name}_{k}" for k in range(count)]

    def named(self, expression):
        """Write an expression; returns its name."""
        self.count += 1
        self.line(f"t{self.count} = {expression}")
        return f"t{self.count}"

    def line(self, text):
        self.lines.append(self.indent + text)

    @contextmanager
    def block(self, head):
        """Write what stands below a line."""
        self.line(head)
        self.indent += "    "
        yield
        self.indent = self.indent[4:]


def _minus(a):
    return f"(-{a})" if isinstance(a, str) else -a
