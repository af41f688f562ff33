"""A calibration as functions in C99, generated from the formulas of its effects.

The output of a sensor is evaluated in stages: most effects act on the force in the sensitive axes,
and those that act last on the output that all others leave. Each stage is solved by Newton's
method, with as many steps as it takes wherever the calibration holds.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy import __version__
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.campaign.calibration.sensor_calibration import (
    RANGE_MARGIN,
    SensorCalibration,
    affine_form,
)
from accelstudy.effects import HoldConditions, get_effect
from accelstudy.effects.base import expressions
from accelstudy.effects.components import AXES
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.pages import render_text
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import compose
from accelstudy.sensors.sensor import SensorModel
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import derivative, symbols

Array = NDArray[np.float64]

MAX_SOLUTION_ERROR = 1e-6
"""m/s², largest error of a solution by Newton steps."""
MAX_STEPS = 25
"""Newton steps after which there is no solution."""
FORCES = (0.5, 1.0, 1.5)
"""Parts of g at which the steps are counted."""
DIRECTIONS = 60
"""Directions in which they are counted."""
MAX_ROUNDING_ERROR = 1e-5
"""m/s², bound of all rounding errors in single precision, at 1 g."""
FORCE = tuple(f"f_{axis}" for axis in AXES)
LAGGED_TEMPERATURE, SESSION_TIME = "temperature_lagged_", "time_kept"
"""Names in C: of a temperature that follows with a lag, before its time constant, and of the time
of drifts, which end with the session."""


def c_header(calibration: SensorCalibration) -> str:
    """Write a header with a function that turns readings into calibrated forces.

    Raises
    ------
    InputError
        If an effect depends on what no device knows, or no force explains a reading.
    """
    calibration.check_device()
    model, p, raw = calibration.model, calibration.parameters, calibration.conversion
    frame = calibration.usual_layout.axes
    # Counts lose no digits of a float if their offset is a whole number of them.
    offset = np.broadcast_to(raw.offset, 3)
    whole = np.round(offset)
    linear = calibration.mending @ frame.matrix * raw.scale
    constant = linear @ (whole - offset)
    if affine := affine_form(model, p):
        stages, (k, bias) = [], affine
        k = frame.matrix.T @ k
        output = []
        force = _affine("force", k @ linear, "reading", whole, k @ (constant - bias))
    else:
        stages, body = _stages(calibration), frame.matrix.T @ model.axes_matrix(p)
        output = _affine("output", linear, "reading", whole, constant)
        force = _affine("force", body, "output", np.zeros(3), np.zeros(3))
    end = calibration.ranges.get("time_s", (0.0, None))[1]
    return render_text(
        "campaign/calibration/calibration.h.j2",
        version=__version__,
        calibration=calibration,
        sigmas=np.sqrt(np.diag(calibration.covariance)),
        layout=calibration.usual_layout,
        end=end,
        end_in_c=None if end is None else _number(end),
        bound=MAX_SOLUTION_ERROR,
        bound_mgon=MAX_SOLUTION_ERROR / calibration.gravity / MGON,
        largest=FORCES[-1],
        rounding=MAX_ROUNDING_ERROR,
        stages=stages,
        columns={column for stage in stages for column in stage.columns},
        steps=max((stage.steps for stage in stages), default=1),
        output=output,
        force=force,
    )


class _Stage(NamedTuple):
    """Effects that act on the same force.

    Attributes
    ----------
    name : str, of the function in C
    effects : mapping of each effect's spec to its lines of C
    columns : set of names of what they need besides the force
    steps : int, Newton steps that solve for the force
    """

    name: str
    effects: Mapping[str, list[str]]
    columns: set[str]
    steps: int


def _stages(calibration: SensorCalibration) -> list[_Stage]:
    """Stages of the output; the first is of the force in the sensitive axes."""
    model, g = calibration.model, calibration.gravity
    sizes = np.concatenate([part * g * evenly_spread(DIRECTIONS) for part in FORCES])
    force, hold = calibration.with_conditions(sizes, model.hold_columns, RANGE_MARGIN)
    stages = []
    for name, last in (("accel_output", False), ("accel_last", True)):
        specs = tuple(effect.spec for effect in model.effects if effect.last == last)
        own = [effect.last == last for effect in model.effects for _ in effect.parameters]
        if specs:
            part, p = compose(model.name, specs), calibration.parameters[own]
            numbers = {**dict(zip(part.parameter_names, p, strict=True)), "g": g}
            effects = {spec: _lines(spec, numbers) for spec in specs}
            columns = {str(symbol) for spec in specs for symbol in _formulas(spec)[0].free_symbols}
            linear = not any(_formulas(s)[1].free_symbols & {*symbols(*FORCE)} for s in specs)
            force = part.sense(force, p, g, hold)
            steps = _steps(part, p, force, g, hold)
            stages.append(
                _Stage(name, effects, columns - {*FORCE, *numbers}, 1 if linear else steps)
            )
    return stages


def _steps(model: SensorModel, p: Array, output: Array, g: float, hold: HoldConditions) -> int:
    """Count the steps to an output (n, 3) until the last is below the bound.

    Outputs that no force explains do not count.
    """
    sizes: list[Array] = []
    with np.errstate(all="ignore"):
        for _, step in islice(model.newton(output, p, g, hold), MAX_STEPS):
            sizes.append(np.abs(step).sum(axis=1))
            if np.all(sizes[-1] < MAX_SOLUTION_ERROR):
                break
    solved = sizes[-1] < MAX_SOLUTION_ERROR
    if not solved.any():
        raise InputError(f"the model {model.name!r} with these parameters has no inverse")
    return 1 + int(np.argmax((np.array(sizes)[:, solved] < MAX_SOLUTION_ERROR).all(axis=1)))


@cache
def _formulas(spec: str) -> tuple[Any, Any]:
    """What an effect adds to the output, (3, 1), and its derivative by the force, (3, 3)."""
    effect, hold = get_effect(spec), HoldSymbols()
    output, _, _ = expressions(effect, hold)
    lags = [f"{LAGGED_TEMPERATURE}{float(tau):g}".replace(".", "_") for tau in hold.lagged_by]
    names = dict(zip(hold.lagged_by.values(), symbols(*lags), strict=True))
    if effect.drifts:
        names[hold.time] = symbols(SESSION_TIME)[0]
    added = sp.Matrix(output).xreplace(names)
    return added, derivative(added, symbols(*FORCE))


def _lines(spec: str, numbers: Mapping[str, float]) -> list[str]:
    """Write an effect in C: lines that add it to an output and its slope."""
    added, slope = _formulas(spec)
    used = {str(symbol) for symbol in added.free_symbols}
    values = _entries("output", added)
    values |= {f"slope[{i}][{j}]": slope[i, j] for i in range(3) for j in range(3)}
    known = {name: _number(value) for name, value in numbers.items()}
    known |= {name: f"force[{i}]" for i, name in enumerate(FORCE)}
    return [
        *(f"const accel_real {name} = {value};" for name, value in known.items() if name in used),
        *_assigned({name: value for name, value in values.items() if value != 0}, "+="),
    ]


def _affine(name: str, matrix: Array, of: str, offset: Array, constant: Array) -> list[str]:
    """Write name = matrix (of − offset) + constant, without what is zero."""
    matrix, offset, constant = (
        sp.Matrix(3, values.size // 3, [int(v) if v in (-1, 0, 1) else v for v in values.ravel()])
        for values in (matrix, offset, constant)
    )
    vector = sp.Matrix(symbols(*(f"{of}[{i}]" for i in range(3))))
    return _assigned(_entries(name, matrix * (vector - offset) + constant), "=")


def _entries(name: str, vector: Any) -> dict[str, Any]:
    return {f"{name}[{i}]": value for i, value in enumerate(vector)}


def _assigned(values: Mapping[str, Any], sign: str) -> list[str]:
    """Write assignments in C, with common subexpressions calculated once."""
    shared, results = sp.cse(list(values.values()), list=True)
    lines = [f"const accel_real {name} = {_c(value)};" for name, value in shared]
    return lines + [f"{n} {sign} {_c(v)};" for n, v in zip(values, results, strict=True)]


def _c(expression: Any) -> str:
    """Write an expression in C."""
    fractions = {number: sp.Float(number) for number in expression.atoms(sp.Rational)}
    fractions = {number: real for number, real in fractions.items() if not number.is_Integer}
    printer, powers = _printer()
    return str(printer.doprint(powers(expression.xreplace(fractions))))


@cache
def _printer() -> tuple[Any, Any]:
    """Printer of what the header makes float or double, and a function: powers as products."""
    from sympy.codegen.ast import float32, real
    from sympy.codegen.rewriting import create_expand_pow_optimization
    from sympy.printing.c import C99CodePrinter

    class Printer(C99CodePrinter):  # type: ignore[misc]  # SymPy is untyped
        _ns = "ACCEL("
        _prec_funcs = tuple(f"ACCEL({name}" for name in C99CodePrinter._prec_funcs)

        def _print_Float(self, number: Any) -> str:
            return _number(float(number))

        _print_NumberSymbol = _print_Float

    settings = {"type_aliases": {real: float32}, "type_func_suffixes": {float32: ")"}}
    return Printer(settings), create_expand_pow_optimization(4, base_req=lambda base: True)


def _number(value: float) -> str:
    digits = f"{value:.12g}"
    return f"ACCEL({digits if set('.e') & set(digits) else f'{digits}.0'})"
