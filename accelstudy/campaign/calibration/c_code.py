"""A calibration as functions in C99, generated from the formulas of its effects.

The output of a sensor is evaluated in stages: most effects act on the force in the sensitive axes,
and those that act last on the output that all others leave. Each stage is solved by Newton's
method, with as many steps as it takes wherever the calibration holds. The same expressions count
these steps and are printed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy import __version__
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.campaign.calibration.applying import MARGIN, SensorCalibration
from accelstudy.campaign.calibration.device import KNOWN, in_use, must_be_known
from accelstudy.effects import Effect, get_effect
from accelstudy.effects.base import expressions
from accelstudy.effects.components import AXES
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.conversion import Conversion
from accelstudy.sensors.frames import FRD, Frame
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import derivative, symbols

Array = NDArray[np.float64]

BOUND = 1e-6
"""m/s², error of the solution where it takes steps."""
MOST = 25
"""Steps after which there is no solution."""
FORCES = (0.5, 1.0, 1.5)
"""Parts of g at which the steps are counted."""
DIRECTIONS = 60
"""Directions in which they are counted."""
LOST = 1e-3
"""m/s², a last step beyond which there is no solution."""
ROUNDING = 1e-5
"""m/s², of all in single precision, at 1 g."""
WIDTH = 94
"""Characters of a line of the comment."""
LOOSEST = 1000
"""Precedence of what binds more tightly than any operation."""

HEAD = """\
#ifndef ACCEL_CALIBRATION_H
#define ACCEL_CALIBRATION_H

#include <math.h>

#ifdef ACCEL_DOUBLE
typedef double accel_real;
#define ACCEL(x) x
#else
typedef float accel_real;
#define ACCEL(x) x##f
#endif"""

SOLVE = """\
/* Solve a x = b. */
static inline void accel_solve(accel_real a[3][3], const accel_real b[3], accel_real x[3])
{
    accel_real det = 0, minors[3][3];
    int i, j;
    for (i = 0; i < 3; i++) {
        const accel_real *u = a[(i + 1) % 3], *v = a[(i + 2) % 3];
        for (j = 0; j < 3; j++)
            minors[i][j] = u[(j + 1) % 3] * v[(j + 2) % 3] - u[(j + 2) % 3] * v[(j + 1) % 3];
    }
    for (j = 0; j < 3; j++)
        det += a[0][j] * minors[0][j];
    for (j = 0; j < 3; j++)
        x[j] = (b[0] * minors[0][j] + b[1] * minors[1][j] + b[2] * minors[2][j]) / det;
}"""

ARGUMENTS = {
    "temperature": "degC",
    "time": "s since the start of the calibration session",
    "vibration": "m/s^2, rms while the sensor stands still",
}
"""What a function takes beside a reading."""
LAGGED = "temperature_lagged_"
"""Before the time constant, in the names of temperatures that follow with a lag."""
KEPT = "time_kept"
"""Time, but that of the end of the session after it."""


def c_header(
    calibration: SensorCalibration, raw: Conversion, frame: Frame, mending: Array, unit: str
) -> str:
    """Write a header with a function that turns readings into calibrated forces.

    Parameters
    ----------
    calibration : SensorCalibration
    raw, frame, unit : of the readings
    mending : (3, 3) array, turns forces in frd as they are read into those that were fitted

    Raises
    ------
    InputError
        If an effect depends on what no device knows, or no force explains a reading.
    """
    code = _Code(calibration, raw, frame, mending)
    functions = list(code.functions())
    blocks = provenance(calibration), code.notes(unit), _parameters(calibration)
    lines = [w for block in blocks for text in (*block, "") for w in wrap(text, WIDTH) or [""]]
    comment = "\n".join(f" * {line}".rstrip() for line in lines[:-1]).replace("*/", "* /")
    return "\n\n".join([f"/*\n{comment}\n */", HEAD, *functions, "#endif"]) + "\n"


@dataclass(frozen=True, eq=False)
class _Part:
    """An effect in symbols, as a part of the output.

    Attributes
    ----------
    effect : Effect
    lags : dict of the name of a lagged temperature to its time constant, s
    output, slope : (3, 1) and (3, 3) matrices, what it adds to the output, and the derivative of
        that by the force
    axes : (3, 3) matrix, what it adds to T
    """

    effect: Effect
    lags: dict[str, float]
    output: Any
    slope: Any
    axes: Any

    @property
    def p(self) -> tuple[Any, ...]:
        """Symbols of its parameters."""
        return symbols(*(parameter.name for parameter in self.effect.parameters))

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """Names of what it needs besides the force."""
        known = {*_force(), *self.p, *symbols("g")}
        return tuple(sorted(str(symbol) for symbol in self.output.free_symbols - known))

    @cached_property
    def linear(self) -> bool:
        """Whether the output is linear in the force."""
        return not self.slope.free_symbols & set(_force())

    @cached_property
    def evaluate(self) -> Any:
        """Output and slope, 12 numbers, by NumPy: of force, g, parameters and columns."""
        arguments = (*_force(), *symbols("g"), *self.p, *symbols(*self.columns))
        return sp.lambdify(arguments, [*self.output, *self.slope], modules="numpy", cse=True)

    @cached_property
    def in_c(self) -> tuple[str, ...]:
        """Lines that add it to an output and its slope."""
        values = {f"output[{i}]": self.output[i] for i in range(3)}
        values |= {f"slope[{i}][{j}]": self.slope[i, j] for i in range(3) for j in range(3)}
        values = {name: value for name, value in values.items() if value != 0}
        used = set().union(*(value.free_symbols for value in values.values()))
        force = [(f, i) for i, f in enumerate(_force()) if f in used]
        lines = [f"const accel_real {f} = force[{i}];" for f, i in force]
        return (*lines, *_assigned(values, "+="))


@cache
def _part(spec: str) -> _Part:
    """Evaluate an effect with symbols, once."""
    effect, hold = get_effect(spec), HoldSymbols()
    output, axes, _ = expressions(effect, hold)
    lags = {f"{LAGGED}{float(tau):g}".replace(".", "_"): tau for tau in hold.lagged_by}
    renamed = {hold.lagged_by[tau]: symbols(name)[0] for name, tau in lags.items()}
    if effect.drifts:
        renamed[hold.time] = symbols(KEPT)[0]
    column = sp.Matrix(output).xreplace(renamed)
    lags = {name: float(tau) for name, tau in lags.items()}
    return _Part(effect, lags, column, derivative(column, _force()), sp.Matrix(axes))


class _Stage:
    """Effects that act on the same force.

    Parameters
    ----------
    name : str, of its function in C
    parts : list of the effects, each with its parameters
    g : float, m/s²
    """

    def __init__(self, name: str, parts: Sequence[tuple[_Part, Array]], g: float) -> None:
        self.name, self.parts, self._g = name, parts, g
        self.columns = tuple(sorted({name for part, _ in parts for name in part.columns}))
        self.linear = all(part.linear for part, _ in parts)

    def sensed(self, force: Array, columns: Mapping[str, Array]) -> tuple[Array, Array]:
        """Output (n, 3) of forces (n, 3), and its slope (n, 3, 3)."""
        output, slope = force, np.tile(np.eye(3), (len(force), 1, 1))
        for part, p in self.parts:
            of = [columns[name] for name in part.columns]
            added = np.stack(np.broadcast_arrays(*part.evaluate(*force.T, self._g, *p, *of)), -1)
            output = output + added[..., :3]
            slope = slope + added[..., 3:].reshape(*added.shape[:-1], 3, 3)
        return output, slope

    def steps(self, output: Array, columns: Mapping[str, Array]) -> int:
        """Newton steps until the last is below the bound, wherever a force explains an output."""
        force, sizes = output, np.empty((0, len(output)))
        with np.errstate(all="ignore"):
            while len(sizes) < MOST and not (len(sizes) and np.all(sizes[-1] < BOUND)):
                found, slope = self.sensed(force, columns)
                inverse = np.cross(slope[:, [1, 2, 0]], slope[:, [2, 0, 1]])
                det = np.sum(slope[:, 0] * inverse[:, 0], axis=1)
                step = np.einsum("ni,nij->nj", output - found, inverse) / det[:, None]
                force = force + step
                sizes = np.vstack([sizes, np.abs(step).sum(axis=1)])
        solved = sizes[-1] < BOUND
        if not solved.any():
            return 0
        return 1 if self.linear else int(1 + np.argmax((sizes[:, solved] < BOUND).all(axis=1)))

    @property
    def function(self) -> str:
        """The function of the output and its slope."""
        known = f"const accel_real force[3]{''.join(f', accel_real {c}' for c in self.columns)}"
        lines = ["int i, j;", "for (i = 0; i < 3; i++) {", "    output[i] = force[i];"]
        lines += ["    for (j = 0; j < 3; j++)", "        slope[i][j] = i == j;", "}"]
        for part, p in self.parts:
            lines += self._scope(part, p, part.in_c)
        to = "accel_real output[3], accel_real slope[3][3]"
        return _function(self.name, f"{known}, {to}", lines)

    def _scope(self, part: _Part, p: Array, lines: Sequence[str]) -> list[str]:
        """Lines in a scope of their own, with the numbers that occur in them."""
        names = [str(symbol) for symbol in part.p]
        values = {"g": self._g, **dict(zip(names, p, strict=True))}
        words = set(re.findall(r"\w+", " ".join(lines)))
        numbers = [f"const accel_real {n} = {_number(v)};" for n, v in values.items() if n in words]
        inner = [f"    {line}" for line in (*numbers, *lines)]
        return [f"{{ /* {part.effect.spec} */", *inner, "}"] if lines else []


class _Code:
    """A calibration, and the functions in C that are made of it."""

    def __init__(
        self, calibration: SensorCalibration, raw: Conversion, frame: Frame, mending: Array
    ) -> None:
        self._calibration, self._raw, self._frame = calibration, raw, frame
        self._to_output = mending @ frame.matrix * raw.scale
        ends = np.cumsum([0, *(len(e.parameters) for e in calibration.model.effects)])
        parts = [
            (_part(effect.spec), calibration.parameters[first:last])
            for effect, first, last in zip(calibration.model.effects, ends, ends[1:], strict=False)
        ]
        self._axes = np.eye(3)
        for part, p in parts:
            numbers = dict(zip(part.p, map(sp.Float, p), strict=True))
            self._axes += np.array(part.axes.xreplace(numbers).tolist(), dtype=float)
        stages = [
            _Stage(
                name, [each for each in parts if each[0].effect.last == last], calibration.gravity
            )
            for name, last in (("accel_output", False), ("accel_last", True))
        ]
        self._stages = [stage for stage in stages if stage.parts]
        self.lags = {name: tau for part, _ in parts for name, tau in part.lags.items()}
        needed = {name for stage in self._stages for name in stage.columns}
        self.columns = tuple(sorted({"time" if name == KEPT else name for name in needed}))
        known = {*KNOWN, *self.lags, KEPT}
        must_be_known([(p.effect.name, c) for p, _ in parts for c in p.columns if c not in known])
        self.steps = self._counted()

    def _counted(self) -> tuple[int, ...]:
        """Newton steps of each stage."""
        calibration = self._calibration
        ways = evenly_spread(DIRECTIONS) * calibration.gravity
        sizes = np.concatenate([part * ways for part in FORCES])
        wanted = ["temperature" if name in self.lags else name for name in self.columns]
        forces, hold = in_use(calibration, sizes, wanted, MARGIN)
        columns = {name: hold.column(name) for name in KNOWN}
        columns |= {name: columns["temperature"] for name in self.lags}
        columns[KEPT] = np.minimum(columns["time"], self._end)
        force, steps = forces @ np.linalg.inv(self._axes).T, []
        for stage in self._stages:
            force, _ = stage.sensed(force, columns)
            steps.append(stage.steps(force, columns))
        if 0 in steps:
            name = calibration.model.name
            raise InputError(f"the model {name!r} with these parameters has no inverse")
        return tuple(steps)

    @property
    def _end(self) -> float:
        """Time, s, after which drifts stay as they are."""
        return float(self._calibration.ranges.get("time_s", (0.0, np.inf))[1])

    @property
    def implicit(self) -> bool:
        """Whether it takes more than one step to solve for the force."""
        return max(self.steps, default=1) > 1

    def functions(self) -> Iterable[str]:
        """Write all functions."""
        affine = not self.columns and all(stage.linear for stage in self._stages)
        if not affine:
            yield SOLVE
            yield from (stage.function for stage in self._stages)
        yield self._calibrate(affine)

    @property
    def _arguments(self) -> str:
        return "".join(f", accel_real {name}" for name in self.columns)

    def _kept(self) -> list[str]:
        """Line that declares the time of drifts."""
        if not any(KEPT in stage.columns for stage in self._stages):
            return []
        kept = f"ACCEL(fmax)(time, {_number(0.0)})"
        kept = f"ACCEL(fmin)({kept}, {_number(self._end)})" if np.isfinite(self._end) else "time"
        return [f"const accel_real {KEPT} = {kept};"]

    def _calibrate(self, affine: bool) -> str:
        """Write the function that calibrates a reading."""
        # Counts lose no digits of a float if their offset is a whole number of them.
        offset = np.broadcast_to(self._raw.offset, 3)
        whole = np.round(offset)
        raw = sp.Matrix(symbols(*(f"reading[{i}]" for i in range(3)))) - _matrix(whole)
        linear, constant = self._to_output, -self._to_output @ (offset - whole)
        body = self._frame.matrix.T @ self._axes
        if affine:
            for stage in self._stages[::-1]:
                (zero,), (slope,) = stage.sensed(np.zeros((1, 3)), {})
                inverse = np.linalg.inv(slope)
                linear, constant = inverse @ linear, inverse @ (constant - zero)
            lines = _assigned(
                _named("force", _matrix(body @ linear) * raw + _matrix(body @ constant))
            )
        else:
            lines = ["accel_real output[3], f[3], found[3], slope[3][3], step[3];", "int i, n;"]
            lines += [*self._kept(), *(["int lost = 0;"] if self.implicit else [])]
            lines += _assigned(_named("output", _matrix(linear) * raw + _matrix(constant)))
            for stage, steps in zip(self._stages[::-1], self.steps[::-1], strict=True):
                lines += self._solved(stage, steps)
            output = sp.Matrix(symbols(*(f"output[{i}]" for i in range(3))))
            lines += _assigned(_named("force", _matrix(body) * output))
            if self.implicit:
                lines += ["if (lost)", "    force[0] = force[1] = force[2] = NAN;"]
        arguments = f"const accel_real reading[3]{self._arguments}, accel_real force[3]"
        return _function("accel_calibrate", arguments, lines)

    def _solved(self, stage: _Stage, steps: int) -> list[str]:
        """Lines that turn the output of a stage into the force on which it acts."""
        all_three = "for (i = 0; i < 3; i++)"
        lines = [all_three, "    f[i] = output[i];", f"for (n = 0; n < {steps}; n++) {{"]
        lines += [f"    {stage.name}(f{''.join(f', {c}' for c in stage.columns)}, found, slope);"]
        lines += [f"    {all_three}", "        found[i] = output[i] - found[i];"]
        lines += ["    accel_solve(slope, found, step);"]
        lines += [f"    {all_three}", "        f[i] += step[i];", "}"]
        if steps > 1:
            size = " + ".join(f"ACCEL(fabs)(step[{i}])" for i in range(3))
            lines += [f"lost = lost || !({size} < {_number(LOST)});"]
        return [*lines, all_three, "    output[i] = f[i];"]

    def notes(self, unit: str) -> Iterable[str]:
        """Say what the function takes and gives."""
        calibration, end = self._calibration, self._end
        yield (
            f"accel_calibrate: from a reading in {unit} to the specific force in m/s^2, both in "
            f"the axes {self._frame.description}."
        )
        for name in self.columns:
            if name in self.lags:
                yield (
                    f"{name}: degC. It begins as the temperature; dt seconds later add "
                    f"(temperature - {name}) * (1 - exp(-dt / {self.lags[name]:g}))."
                )
            else:
                yield f"{name}: {ARGUMENTS[name]}."
        for effect in calibration.model.effects:
            if effect.drifts and np.isfinite(end):
                yield f"{effect.name}: stays as it was at the end of the session, {end:.0f} s."
        if self.implicit:
            yield (
                f"The force is solved for in {max(self.steps)} Newton steps. They leave an error "
                f"of less than {BOUND:g} m/s^2 ({BOUND / calibration.gravity / MGON:.2g} mgon) at "
                f"up to {FORCES[-1]:g} g, in the ranges of the calibration. The force is NAN where "
                "none explains the reading."
            )
        yield (
            f"All is in float, with rounding errors below {ROUNDING:g} m/s^2 at 1 g, or in double "
            "if ACCEL_DOUBLE is defined."
        )


def provenance(calibration: SensorCalibration) -> Iterable[str]:
    """Say where a calibration is from."""
    content = calibration.content
    sensor = f" of {content['sensor']}" if content["sensor"] else ""
    yield f"Accelerometer calibration{sensor}, from the campaign {content['campaign']}."
    by = f", by {content['approach']}" if content["approach"] else ""
    count = content["n_positions"]
    at = f", {count} positions" if count else ""
    yield f"Model {content['model']}{by}{at}, g = {calibration.gravity:.6g} m/s^2."
    if state := content["quality"]["state"]:
        yield f"Verdict: {state}."
    if (content["mended"] or {}).get("matrix") is not None:
        yield f"It mends the readings, too: {content['mended']['reason']}."
    yield f"Written by accelstudy {__version__}."


def _parameters(calibration: SensorCalibration) -> Iterable[str]:
    """Parameters in SI, in the axes of the model."""
    yield f"Parameters with sigmas, in the axes {FRD.description}:"
    variances = np.diag(calibration.covariance)
    for parameter, value, variance in zip(
        calibration.model.parameters, calibration.parameters, variances, strict=True
    ):
        sigma = "" if np.isnan(variance) else f" +- {np.sqrt(variance):.2g}"
        yield f"  {parameter.name} = {value:.9g}{sigma} {parameter.unit}".removesuffix(" 1")


@cache
def _printer() -> Any:
    """Print numbers and functions in the precision for which the header is compiled."""
    from sympy.printing.c import C99CodePrinter

    class Printer(C99CodePrinter):  # type: ignore[misc]  # SymPy is untyped
        def _print_Float(self, expr: Any) -> str:
            return _number(float(expr))

        _print_Rational = _print_NumberSymbol = _print_Float

        def parenthesize(self, item: Any, level: int, strict: bool = False) -> str:
            if item.is_Symbol or (item.is_nonnegative and item.is_Number):
                return str(self._print(item))
            return str(super().parenthesize(item, level, strict))

        def _print_Pow(self, expr: Any) -> str:
            base, power = expr.base, expr.exp
            if power == sp.Rational(1, 2):
                return f"ACCEL(sqrt)({self._print(base)})"
            if power.is_Integer and 1 < power < 5:
                return f"({'*'.join([self.parenthesize(base, LOOSEST)] * int(power))})"
            if power.is_negative:
                return f"({_number(1.0)}/{self.parenthesize(base**-power, LOOSEST)})"
            return f"ACCEL(pow)({self._print(base)}, {self._print(power)})"

    names = {"Abs": "fabs", "Max": "fmax", "Min": "fmin", "atan2": "atan2"}
    names |= {name: name for name in ("sin", "cos", "tan", "exp")}
    return Printer({"user_functions": {name: f"ACCEL({c})" for name, c in names.items()}})


def _number(value: float) -> str:
    text = f"{value:.12g}"
    return f"ACCEL({text if set('.e') & set(text) else f'{text}.0'})"


def _c(expression: Any) -> str:
    return str(_printer().doprint(sp.sympify(expression)))


def _force() -> tuple[Any, ...]:
    return symbols(*(f"f_{axis}" for axis in AXES))


def _named(name: str, values: Iterable[Any]) -> dict[str, Any]:
    return {f"{name}[{i}]": value for i, value in enumerate(values)}


def _matrix(values: ArrayLike) -> Any:
    """Matrix of numbers for symbols, in which what is zero or one stays so."""
    exact = {0.0: sp.S.Zero, 1.0: sp.S.One, -1.0: -sp.S.One}
    rows = np.asarray(values, dtype=float).reshape(3, -1).tolist()
    return sp.Matrix([[exact.get(value, sp.Float(value)) for value in row] for row in rows])


def _assigned(values: Mapping[str, Any], sign: str = "=") -> list[str]:
    """Give names values, with what the values share calculated once."""
    if not values:
        return []
    shared, results = sp.cse(list(values.values()), list=True)
    lines = [f"const accel_real {name} = {_c(value)};" for name, value in shared]
    return lines + [f"{n} {sign} {_c(v)};" for n, v in zip(values, results, strict=True)]


def _function(name: str, arguments: str, lines: Iterable[str]) -> str:
    body = "\n".join(f"    {line}" for text in lines for line in text.splitlines())
    return f"static inline void {name}({arguments})\n{{\n{body}\n}}"
