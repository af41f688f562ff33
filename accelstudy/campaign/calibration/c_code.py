"""A calibration as functions in C99, generated from the formulas of its effects.

The force in the sensitive axes is solved for by Newton's method.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from accelstudy import __version__
from accelstudy.basics.arrays import Array
from accelstudy.campaign.calibration.sensor_calibration import SensorCalibration
from accelstudy.effects.components import AXES
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.pages import render_text
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import derivative, symbolic, symbols

MAX_STEPS = 25
"""Newton steps after which there is no solution."""
LAST_STEP = 1e-4
"""m/s², size of the step that is the last one. What it leaves is of the order of its square, and
rounding in single precision is smaller than it."""
MAX_ROUNDING_ERROR = 1e-5
"""m/s², bound of all rounding errors in single precision, at 1 g."""
FORCE = tuple(f"f_{axis}" for axis in AXES)
LAGGED_TEMPERATURE, SESSION_TIME = "temperature_lagged_", "time_kept"
"""Names in C: of a temperature that follows with a lag, before its time constant, and of the time
of drifts, which end with the session."""


def c_header(calibration: SensorCalibration, real: str = "float") -> str:
    """Write a header with a function that turns readings into calibrated forces.

    Its numbers are `real`, float or double.

    Raises
    ------
    InputError
        If an effect depends on what no device knows.
    """
    calibration.check_device()
    model, p, layout = calibration.model, calibration.parameters, calibration.usual_layout
    frame, raw, write = layout.axes, layout.conversion, _Writer(real)
    offset, zero = np.broadcast_to(raw.offset, 3), np.zeros(3)
    linear = calibration.mending @ frame.matrix * raw.scale
    lines, output, columns = list[str](), list[str](), set[str]()
    if affine := model.affine(p):
        k, bias = affine
        k = frame.matrix.T @ k
        force = write.affine("force", k @ linear, "reading", offset, -k @ bias)
    else:
        out, slope = _output(calibration)
        entries = {f"slope[{i}][{j}]": slope[i, j] for i in range(3) for j in range(3)}
        lines = write.assigned(_entries("output", out) | entries)
        columns = {str(symbol) for symbol in out.free_symbols - {*symbols(*FORCE)}}
        body = frame.matrix.T @ model.axes_matrix(p)
        output = write.affine("output", linear, "reading", offset, zero)
        force = write.affine("force", body, "f", zero, zero)
    return render_text(
        "campaign/calibration/calibration.h.j2",
        version=__version__,
        calibration=calibration,
        sigmas=np.sqrt(np.diag(calibration.covariance)),
        layout=layout,
        end=calibration.ranges.get("time_s", (0.0, None))[1],
        steps=MAX_STEPS,
        last_step=LAST_STEP,
        rounding=MAX_ROUNDING_ERROR,
        lines=lines,
        columns=columns,
        output=output,
        force=force,
        real=real,
        suffix="f" if real == "float" else "",
    )


class _DeviceConditions(HoldSymbols):
    """What a device knows besides the reading, by its names in C.

    Attributes
    ----------
    drifts : bool, whether the effect that takes them ends with the calibration session
    """

    drifts = False

    @property
    def time(self) -> sp.Symbol:
        """Time since the start of the session."""
        return symbols(SESSION_TIME)[0] if self.drifts else self.columns["time"]

    def lagged(self, tau: Any) -> sp.Symbol:
        """Temperature behind a lag; with a lag of 0 the temperature itself."""
        name = f"{LAGGED_TEMPERATURE}{float(tau):g}".replace(".", "_")
        return symbols(name)[0] if tau else self.columns["temperature"]


def _output(calibration: SensorCalibration) -> tuple[Any, Any]:
    """Output (3, 1) for a force in the sensitive axes, and its derivative by the force (3, 3)."""
    p, g = tuple(map(sp.Float, calibration.parameters)), sp.Float(calibration.gravity)
    hold = _DeviceConditions()
    output: Any = sp.Matrix(symbols(*FORCE))
    for last in (False, True):  # those that act last take what all others leave
        force = tuple(output)
        for effect, columns in calibration.model.parts:
            if effect.last == last:
                hold.drifts = effect.drifts
                output += sp.Matrix(effect.output(force, p[columns], g, hold, symbolic))
    return output, derivative(output, symbols(*FORCE))


def _entries(name: str, vector: Any) -> dict[str, Any]:
    return {f"{name}[{i}]": value for i, value in enumerate(vector)}


class _Writer:
    """Writes assignments in C, in float or double."""

    def __init__(self, real: str) -> None:
        from sympy.codegen import ast
        from sympy.codegen.rewriting import create_expand_pow_optimization
        from sympy.printing.c import C99CodePrinter

        types = {"float": ast.float32, "double": ast.float64}
        self._printer = C99CodePrinter({"type_aliases": {ast.real: types[real]}})
        self._expand = create_expand_pow_optimization(4, base_req=lambda base: True)
        self._names = {sp.pi: sp.Float(np.pi)} | {
            symbol: sp.Symbol(f"force[{i}]", real=True) for i, symbol in enumerate(symbols(*FORCE))
        }

    def assigned(self, values: Mapping[str, Any]) -> list[str]:
        """Write assignments, with common subexpressions calculated once."""
        shared, results = sp.cse([v.xreplace(self._names) for v in values.values()], list=True)
        lines = [f"const accel_real {name} = {self._text(value)};" for name, value in shared]
        pairs = zip(values, results, strict=True)
        return lines + [f"{name} = {self._text(value)};" for name, value in pairs]

    def affine(
        self, name: str, matrix: Array, of: str, offset: Array, constant: Array
    ) -> list[str]:
        """Write name = matrix (of − offset) + constant, without what is zero.

        Of a large offset, as of counts, what a float holds goes first, which costs no digits.
        """
        lines, near = list[str](), offset.astype(np.float32).astype(float)
        if near.any():
            entries = [self._text(sp.Symbol(f"{of}[{i}]") - near[i]) for i in range(3)]
            of, lines = "centred", [f"const accel_real centred[3] = {{{', '.join(entries)}}};"]
        matrix, constant = (
            sp.Matrix(3, each.size // 3, [int(v) if v in (-1, 0, 1) else v for v in each.ravel()])
            for each in (matrix, constant - matrix @ (offset - near))
        )
        vector = sp.Matrix(symbols(*(f"{of}[{i}]" for i in range(3))))
        return lines + self.assigned(_entries(name, matrix * vector + constant))

    def _text(self, expression: Any) -> str:
        return str(self._printer.doprint(self._expand(expression)))
