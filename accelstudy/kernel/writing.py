"""The code of a calibration of many replicates: what `gauss_helmert.adjust` does, in lanes.

It follows `accelstudy.adjustment.gauss_helmert`, which explains it, step by step and name by name.
The conditions come from the traced expressions of `CalibrationEquations`. A group of replicates
iterates together. A lane that has ended keeps its results, and what is computed in it afterwards is
ignored.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from accelstudy.adjustment.equations import CalibrationEquations
from accelstudy.adjustment.gauss_helmert import (
    MAX_ITERATIONS,
    PIVOT_TOLERANCE,
    ROUNDING,
    STEP_TOLERANCE,
)
from accelstudy.kernel.formulas import Formulas
from accelstudy.kernel.lanes import (
    LANES,
    Code,
    Lanes,
    Mask,
    Term,
    Variable,
    above,
    absolute,
    fma,
    larger,
)
from accelstudy.kernel.lanes import sqrt as root
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.formula_cache import cached_by_key
from accelstudy.symbolic.tracing import Traced, symbols, traced

NAME = "calibrate"
INTEGERS = ("positions", "replicates")
POINTERS = (
    *("known", "forces", "angles", "initial", "weights"),
    *("work", "results", "correlations"),
)
"""Arguments of the function, in order; `KernelFunction` says what they hold."""


class KernelFunction:
    """The function that calibrates the replicates of one kind of sensor model with one approach.

    The function has these arguments, for n positions, R replicates, u parameters (gravity is the
    last if it is estimated), o observations per position and k known numbers:

        known         (n, 2 o + k)  σ of the observations, their 1/σ (0 where σ = 0),
                                    and the numbers of `known`
        forces        (R, n, 3)
        angles        (R, n, 2)     if the approach uses them
        initial       (R, u)        of the parameters; the last is observed if it is gravity
        weights       (u,)          of the observations of parameters: of gravity, and of those that
                                    have a prior, about zero
        work          (n, work, LANES)
        results       (2 u + 3, R') estimates, sigmas, Ω, iterations, converged (1 or 0); R' is R
                                    rounded up to a multiple of LANES
        correlations  (u (u − 1)/2, LANES)  sums over the converged replicates, below the diagonal
                                    row by row; added to what is there

    Parameters
    ----------
    equations : CalibrationEquations

    Attributes
    ----------
    key : under which the numbers of `known`, and the text of the function, are kept
    u, o, c : parameters, and observations and conditions per position
    """

    def __init__(self, equations: CalibrationEquations) -> None:
        self.equations = equations
        self.key = equations.key
        self.u, self.o = equations.n_parameters, equations.n_observations
        self.c = equations.linear.shape[0]

    @cached_property
    def latent(self) -> tuple[sp.Symbol, ...]:
        """Symbols of f_a of the iteration before; none where the approach knows the force."""
        return () if self.equations.knows_force else symbols("a_x", "a_y", "a_z")

    @cached_property
    def _same(self) -> frozenset[sp.Symbol]:
        eq, trace = self.equations, self.equations.trace.formulas
        lanes = {*eq.parameters, *eq.observations, *self.latent, *trace.force}
        return frozenset(trace.arguments) - lanes

    @cached_property
    def sensitive(self) -> Formulas:
        """f_a from the known force, or from that of the iteration before."""
        eq, trace = self.equations, self.equations.trace
        if eq.knows_force:
            return Formulas(list(eq.sensitive.expressions), self._same)
        before = dict(zip(trace.formulas.force, self.latent, strict=True))
        step = trace.newton_step.expressions.xreplace(before)
        return Formulas([a + s for a, s in zip(self.latent, step, strict=True)], self._same)

    @cached_property
    def linear(self) -> Formulas:
        """[ψ | A | B], row by row."""
        return Formulas(list(self.equations.linear.expressions), self._same)

    @traced
    def known(self) -> Traced:
        """Known numbers of a position, (k, 1)."""
        expressions = [*self.sensitive.known.values(), *self.linear.known.values()]
        arguments = self.equations.trace.formulas.arguments
        return arguments, sp.Matrix(len(expressions), 1, expressions)

    @property
    def columns(self) -> int:
        """Numbers of `known` per position."""
        return 2 * self.o + self.known.shape[0]

    @property
    def work(self) -> int:
        """Vectors of `work` per position."""
        latent = 0 if self.equations.knows_force else 3  # `latent` itself would load SymPy
        return 2 * self.o + latent + self.c * (self.u + 1 + self.o)


Rows: TypeAlias = list[list[Term]]
"""A matrix: its lower triangle by rows, with or without the diagonal."""


def text_of(function: KernelFunction) -> str:
    """Write the function as LLVM's text, which is cached."""
    return cached_by_key(function.key, "kernel", lambda: _Writer(function).code.text())


class _Writer:
    """Writes the function."""

    def __init__(self, of: KernelFunction) -> None:
        self.of = of
        self.u, self.o, self.c = of.u, of.o, of.c
        self.weighted = [*of.equations.trace.informed]
        if of.equations.estimates_gravity:
            self.weighted.append(self.u - 1)
        self.code = code = Code(NAME, INTEGERS, POINTERS)
        self.stored: Rows = []

        padded = code.integer("add", code.arguments["replicates"], LANES - 1)
        groups = code.integer("sdiv", padded, LANES)
        self.stride = code.integer("mul", groups, LANES)
        self.weights = {k: code.load_each("weights", [k]) for k in self.weighted}
        with code.loop(groups) as group:
            self.group(code.integer("mul", group, LANES))

    # Memory ------------------------------------------------------------------------------------

    def known(self, i: Any, column: int) -> Lanes:
        row = self.code.integer("mul", i, self.of.columns)
        return self.code.load_each("known", [self.code.integer("add", row, column)])

    def slot(self, i: Any, vector: int) -> Any:
        """Offset of a vector of a position in `work`."""
        row = self.code.integer("mul", i, self.of.work * LANES)
        return self.code.integer("add", row, vector * LANES)

    def read(self, i: Any, first: int, count: int) -> list[Lanes]:
        return [self.code.load("work", self.slot(i, first + k)) for k in range(count)]

    def write(self, i: Any, first: int, values: list[Term]) -> None:
        for k, value in enumerate(values):
            self.code.store(value, "work", self.slot(i, first + k))

    # A group of replicates -----------------------------------------------------------------------

    def group(self, first: Any) -> None:
        code, u = self.code, self.u
        last = code.integer("sub", code.arguments["replicates"], 1)
        # The lanes beyond the last replicate repeat it.
        rows = [code.smaller(code.integer("add", first, lane), last) for lane in range(LANES)]
        tolerance = self.observe(rows)
        starts = [code.integer("mul", row, u) for row in rows]
        initial = [
            code.load_each("initial", [code.integer("add", start, k) for start in starts])
            for k in range(u)
        ]
        x = [Variable(code, value) for value in initial]
        results = _Results.of(code, u)
        numbers = code.of_integer(first) + code.lane_numbers()
        active = Variable(code, 1.0)
        with code.loop(MAX_ITERATIONS) as iteration:
            step = self.step(x, initial)
            going = active.get() > 0.0
            converged = going & step.within(code, tolerance)
            number = code.of_integer(code.integer("add", iteration, 1))
            results.iterations.set(going.select(number, results.iterations.get()))
            with code.builder.if_then(converged.any()):
                results.update(converged, step, x)
            still = going & step.finite(code) & ~converged
            active.set(still.select(1.0, 0.0))
            code.leave_unless(still.any())
        self.write_results(first, results, numbers < code.of_integer(code.arguments["replicates"]))

    def observe(self, rows: list[Any]) -> Term:
        """Take the observations into `work`; returns the tolerance of the step."""
        code, o = self.code, self.o
        largest = Variable(code, 0.0)
        widths = {"forces": 3, "angles": 2} if o > 3 else {"forces": 3}
        positions = code.arguments["positions"]
        starts = {
            width: [code.integer("mul", row, code.integer("mul", positions, width)) for row in rows]
            for width in widths.values()
        }
        with code.loop(code.arguments["positions"]) as i:
            values: list[Term] = []
            for pointer, width in widths.items():
                for k in range(width):
                    at = code.integer("add", code.integer("mul", i, width), k)
                    offsets = [code.integer("add", start, at) for start in starts[width]]
                    values.append(code.load_each(pointer, offsets))
            size: Term = largest.get()
            for k, value in enumerate(values):
                size = larger(absolute(value) * self.known(i, o + k), size)
            largest.set(size)
            self.write(i, 0, values)
            self.write(i, o, [0.0] * o)
            if self.of.latent:
                self.write(i, 2 * o, values[:3])
        return larger(largest.get() * (ROUNDING * np.finfo(float).eps), STEP_TOLERANCE)

    def step(self, x: list[Variable], initial: Sequence[Term]) -> _Step:
        """Write one iteration; it changes x and, in `work`, v and f_a."""
        code, u = self.code, self.u
        at = [variable.get() for variable in x]
        normal = {(i, j): Variable(code, 0.0) for i in range(u) for j in range(i + 1)}
        right = [Variable(code, 0.0) for _ in range(u)]
        size_psi, size_v, omega = (Variable(code, 0.0) for _ in range(3))
        with code.loop(code.arguments["positions"]) as i:
            self.condition(i, at, normal, right, size_psi)

        n = {key: variable.get() for key, variable in normal.items()}
        r: list[Term] = [variable.get() for variable in right]
        misclosures: dict[int, Term] = {}
        for k, weight in self.weights.items():
            # Gravity is observed; a parameter with a prior is zero a priori.
            misclosures[k] = -at[k] if k in self.of.equations.trace.informed else initial[k] - at[k]
            n[k, k] = n[k, k] + weight
            r[k] = fma(weight, misclosures[k], r[k])
        scale = [root(n[k, k]) for k in range(u)]
        unit = [1.0 / s for s in scale]
        scaled = [[n[i, j] * unit[i] * unit[j] for j in range(i + 1)] for i in range(u)]
        lower, pivots = factor(scaled, PIVOT_TOLERANCE)
        half = forward(lower, pivots, [r[k] * unit[k] for k in range(u)])
        dx = [d * s for d, s in zip(backward(lower, pivots, half), unit, strict=True)]

        with code.loop(code.arguments["positions"]) as i:
            self.residuals(i, dx, size_v, omega)
        total: Term = omega.get()
        for k, weight in self.weights.items():
            rest = misclosures[k] - dx[k]
            total = fma(weight * rest, rest, total)
        for variable, present, change in zip(x, at, dx, strict=True):
            variable.set(present + change)
        size_x = root(dot(half, half))
        return _Step(lower, pivots, unit, total, (size_x, size_v.get(), size_psi.get()))

    def condition(
        self,
        i: Any,
        x: list[Lanes],
        normal: dict[tuple[int, int], Variable],
        right: list[Variable],
        size_psi: Variable,
    ) -> None:
        """Linearise the conditions of a position, and add them to the normal equations."""
        c, u, o, eq = self.c, self.u, self.o, self.of.equations
        l, v = self.read(i, 0, o), self.read(i, o, o)
        table: dict[Any, Term] = dict(zip(eq.parameters, x, strict=True))
        table |= zip(eq.observations, (a + b for a, b in zip(l, v, strict=True)), strict=True)
        if self.of.latent:
            table |= zip(self.of.latent, self.read(i, 2 * o, 3), strict=True)
        sensitive, linear = self.of.sensitive, self.of.linear
        f_a = self.evaluate(sensitive, table, i, 2 * o)
        if self.of.latent:
            self.write(i, 2 * o, f_a)
        table |= zip(eq.trace.formulas.force, f_a, strict=True)
        values = self.evaluate(linear, table, i, 2 * o + len(sensitive.known))
        rows = [values[k * (1 + u + o) : (k + 1) * (1 + u + o)] for k in range(c)]
        psi = [row[0] for row in rows]
        a = [row[1 : 1 + u] for row in rows]
        b = [row[1 + u :] for row in rows]

        sigmas = [self.known(i, k) for k in range(o)]

        def by_sigma(rows: Rows) -> Rows:
            return [[x * sigma for x, sigma in zip(row, sigmas, strict=True)] for row in rows]

        whitening, pivots, unit = factor_of_rows(by_sigma(b))
        w = [p - dot(row, v) for p, row in zip(psi, b, strict=True)]

        def white(columns: Rows) -> Rows:
            solved = [forward(whitening, pivots, list(k)) for k in zip(*columns, strict=True)]
            return [list(row) for row in zip(*solved, strict=True)]

        psi_white = forward(whitening, pivots, psi)
        w_white = forward(whitening, pivots, w)
        a_white = white(a)
        bq_white = by_sigma(unit)
        size: Term = size_psi.get()
        for value in psi_white:
            size = larger(absolute(value), size)
        size_psi.set(size)
        for (j, k), variable in normal.items():
            total: Term = variable.get()
            for row in a_white:
                total = fma(row[j], row[k], total)
            variable.set(total)
        for k, variable in enumerate(right):
            total = variable.get()
            for row, misclosure in zip(a_white, w_white, strict=True):
                total = fma(-row[k], misclosure, total)
            variable.set(total)

        self.stored = [
            [*row, misclosure, *cofactors]
            for row, misclosure, cofactors in zip(a_white, w_white, bq_white, strict=True)
        ]
        for number, value in enumerate(value for row in self.stored for value in row):
            if isinstance(value, Lanes):  # a constant is not stored
                self.write(i, 2 * o + len(self.of.latent) + number, [value])

    def evaluate(
        self, formulas: Formulas, table: dict[Any, Term], i: Any, column: int
    ) -> list[Term]:
        """Write formulas at a position, whose known numbers begin at a column."""
        known = {symbol: self.known(i, column + k) for k, symbol in enumerate(formulas.known)}
        return formulas.write(self.code, {**table, **known})

    def residuals(self, i: Any, dx: list[Term], size_v: Variable, omega: Variable) -> None:
        """Residuals of a position after a step, v = −(B Q)ᵀ L⁻ᵀ (A dx + w)."""
        u, o = self.u, self.o
        number = 2 * o + len(self.of.latent)
        v_new: list[Term] = [0.0] * o
        total: Term = omega.get()
        for stored in self.stored:
            row = [
                self.read(i, number + k, 1)[0] if isinstance(value, Lanes) else value
                for k, value in enumerate(stored)
            ]
            number += len(row)
            misclosure = row[u]
            for value, change in zip(row[:u], dx, strict=True):
                misclosure = fma(value, change, misclosure)
            total = fma(misclosure, misclosure, total)
            v_new = [
                fma(-misclosure, value, v) for value, v in zip(row[u + 1 :], v_new, strict=True)
            ]
        omega.set(total)
        size: Term = size_v.get()
        for k, (new, before) in enumerate(zip(v_new, self.read(i, o, o), strict=True)):
            size = larger(absolute(new - before) * self.known(i, o + k), size)
        size_v.set(size)
        self.write(i, o, v_new)

    def write_results(self, first: Any, results: _Results, valid: Mask) -> None:
        """Write the results of a group."""
        code, u = self.code, self.u
        lower: Rows = [[variable.get() for variable in row] for row in results.lower]
        pivots: list[Term] = [variable.get() for variable in results.pivots]
        unit = [variable.get() for variable in results.unit]
        q = inverse(lower, pivots)
        sigma = [root(q[k, k]) for k in range(u)]
        rows: list[Term] = [variable.get() for variable in results.x]
        rows += [s * k for s, k in zip(sigma, unit, strict=True)]
        rows += [results.omega.get(), results.iterations.get(), results.converged.get()]
        for k, value in enumerate(rows):
            row = code.integer("mul", self.stride, k)
            code.store(value, "results", code.integer("add", row, first))
        counted = valid & (results.converged.get() > 0.0)
        reciprocal = [1.0 / s for s in sigma]
        pairs = [(j, k) for j in range(u) for k in range(j)]
        for number, (j, k) in enumerate(pairs):
            correlation = q[j, k] * reciprocal[j] * reciprocal[k]
            at = number * LANES
            before = code.load("correlations", at)
            code.store(before + counted.select(correlation, 0.0), "correlations", at)


@dataclass(frozen=True)
class _Step:
    """One iteration: the factor of the scaled normal matrix, 1/scale, Ω and sizes of the step."""

    lower: Rows
    pivots: list[Term]
    unit: list[Term]
    omega: Term
    sizes: tuple[Term, Lanes, Lanes]

    def within(self, code: Code, tolerance: Term) -> Mask:
        x, v, psi = (code.compare("<=", size, tolerance) for size in self.sizes)
        return x & v & psi

    def finite(self, code: Code) -> Mask:
        x, v, psi = (code.compare("<", size, math.inf) for size in self.sizes)
        return x & v & psi


@dataclass(frozen=True)
class _Results:
    """Results of the lanes."""

    x: list[Variable]
    lower: list[list[Variable]]
    pivots: list[Variable]
    unit: list[Variable]
    omega: Variable
    iterations: Variable
    converged: Variable

    @classmethod
    def of(cls, code: Code, u: int) -> _Results:
        def unknown(count: int) -> list[Variable]:
            return [Variable(code, math.nan) for _ in range(count)]

        lower = [unknown(k) for k in range(u)]
        counts = (Variable(code, 0.0) for _ in range(2))
        return cls(unknown(u), lower, unknown(u), unknown(u), *unknown(1), *counts)

    def update(self, ended: Mask, step: _Step, x: list[Variable]) -> None:
        pairs: list[tuple[Variable, Term]] = [
            (self.omega, step.omega),
            (self.converged, 1.0),
            *zip(self.x, (variable.get() for variable in x), strict=True),
            *zip(self.pivots, step.pivots, strict=True),
            *zip(self.unit, step.unit, strict=True),
        ]
        for variables, row in zip(self.lower, step.lower, strict=True):
            pairs += zip(variables, row, strict=True)
        for variable, value in pairs:
            variable.set(ended.select(value, variable.get()))


# Cholesky factorisation of a small symmetric matrix in each lane --------------------------------


def dot(a: list[Term], b: list[Any]) -> Term:
    """Sum of products."""
    total: Term = 0.0
    for x, y in zip(a, b, strict=True):
        total = fma(x, y, total)
    return total


def factor(matrix: Rows, tolerance: float) -> tuple[Rows, list[Term]]:
    """L with L Lᵀ = M, of the lower triangle: its part below the diagonal, and 1/L_kk.

    A pivot at or below `tolerance` is NaN, and all that comes after it.
    """
    lower: Rows = [[] for _ in matrix]
    pivots: list[Term] = []
    for j in range(len(matrix)):
        pivot = matrix[j][j]
        for value in lower[j]:
            pivot = fma(-value, value, pivot)
        pivots.append(1.0 / root(above(pivot, tolerance)))
        for i in range(j + 1, len(matrix)):
            below = matrix[i][j]
            for a, b in zip(lower[i], lower[j], strict=True):
                below = fma(-a, b, below)
            lower[i].append(below * pivots[j])
    return lower, pivots


def factor_of_rows(rows: Rows) -> tuple[Rows, list[Term], Rows]:
    """L and 1/L_kk, as of `factor`, and U with R = L U for rows R, and U Uᵀ = I."""
    lower: Rows = [[] for _ in rows]
    pivots: list[Term] = []
    unit: Rows = []
    for row, below in zip(rows, lower, strict=True):
        for other in unit:
            below.append(dot(row, other))
            row = [fma(-below[-1], b, a) for a, b in zip(row, other, strict=True)]
        pivots.append(1.0 / root(above(dot(row, row), 0.0)))
        unit.append([value * pivots[-1] for value in row])
    return lower, pivots, unit


def forward(lower: Rows, pivots: list[Term], right: list[Term]) -> list[Term]:
    """Solve L y = b."""
    result: list[Term] = []
    for row, pivot, value in zip(lower, pivots, right, strict=True):
        for a, y in zip(row, result, strict=True):
            value = fma(-a, y, value)
        result.append(value * pivot)
    return result


def backward(lower: Rows, pivots: list[Term], right: list[Term]) -> list[Term]:
    """Solve Lᵀ x = y."""
    result = list(right)
    for i in reversed(range(len(result))):
        for j in range(i + 1, len(result)):
            result[i] = fma(-lower[j][i], result[j], result[i])
        result[i] = result[i] * pivots[i]
    return result


def inverse(lower: Rows, pivots: list[Term]) -> dict[tuple[int, int], Term]:
    """(L Lᵀ)⁻¹, its lower triangle."""
    u = len(lower)
    columns = [forward(lower, pivots, [float(k == i) for i in range(u)]) for k in range(u)]
    return {(j, k): dot(columns[j], columns[k]) for j in range(u) for k in range(j + 1)}
