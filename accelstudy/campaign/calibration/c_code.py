"""A calibration as a function in C, for effects that no matrix can hold."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.effects import Effect
from accelstudy.effects.base import expressions
from accelstudy.effects.components import AXES
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import symbols

Array = NDArray[np.float64]

ROUNDS = 60
"""How often the force is improved at most; large effects need some dozen rounds."""
SETTLED = 1e-12
"""m/s², change of the force at which it is taken."""

NAME = "accelerometer_calibrate"


def c_function(
    effects: Sequence[tuple[Effect, Sequence[float]]],
    gravity: float,
    linear: Array,
    frame: Array,
) -> tuple[tuple[str, ...], str]:
    """Write the function that turns raw readings into calibrated forces.

    Parameters
    ----------
    effects : of the sensor, each with its parameters, SI
    gravity : float, m/s²
    linear : (3, 4) array, f_s = linear · (raw, 1) in frd, m/s²
    frame : (3, 3) array, from the axes of the readings to frd

    Returns
    -------
    columns, text : what the function takes beside the readings, in order, and its text
    """
    axes, added, last = sp.eye(3), [sp.S.Zero] * 3, [sp.S.Zero] * 3
    (g,) = symbols("g")
    for effect, parameters in effects:
        p = symbols(*(parameter.name for parameter in effect.parameters))
        numbers = {g: gravity, **dict(zip(p, map(sp.Float, parameters), strict=True))}
        output, matrix, _ = expressions(effect)
        axes += sp.Matrix(matrix).xreplace(numbers)
        into = last if effect.last else added
        for i, part in enumerate(output):
            into[i] += sp.sympify(part).xreplace(numbers)
    force = symbols(*(f"f_{axis}" for axis in AXES))
    used = set().union(*(sp.sympify(part).free_symbols for part in (*added, *last)))
    columns = tuple(sorted(str(symbol) for symbol in used - set(force)))
    body = frame.T @ np.array(axes.tolist(), dtype=float)
    end = "h" if any(last) else "o"
    arguments = "".join(f", double {name}" for name in columns)
    return columns, "\n".join(
        [
            f"static void {NAME}(const double raw[3]{arguments}, double force[3])",
            "{",
            f"    static const double reading[3][4] = {{\n{_rows(linear)}\n    }};",
            f"    static const double body[3][3] = {{\n{_rows(body)}\n    }};",
            f"    double l[3], f[3], o[3], {'h[3], ' if any(last) else ''}change = 1;",
            "    int i, round;",
            "    for (i = 0; i < 3; i++)",
            "        f[i] = l[i] = reading[i][0] * raw[0] + reading[i][1] * raw[1]"
            " + reading[i][2] * raw[2] + reading[i][3];",
            f"    for (round = 0; round < {ROUNDS} && change > {SETTLED:g}; round++) {{",
            *_block(added, "f", "o"),
            *(_block(last, "o", "h") if any(last) else ()),
            "        change = 0;",
            "        for (i = 0; i < 3; i++) {",
            f"            change = fmax(change, fabs(l[i] - {end}[i]));",
            f"            f[i] += l[i] - {end}[i];",
            "        }",
            "    }",
            "    for (i = 0; i < 3; i++)",
            "        force[i] = body[i][0] * f[0] + body[i][1] * f[1] + body[i][2] * f[2];",
            "}",
        ]
    )


def _block(added: Sequence[Any], of: str, to: str) -> list[str]:
    """Lines that add something to a force, in a scope of their own."""
    shared, results = sp.cse(added, symbols=sp.numbered_symbols("x"), list=True)
    lines = ["        {"]
    names = [f"f_{axis}" for axis in AXES]
    free = set().union(*(e.free_symbols for _, e in shared), *(e.free_symbols for e in results))
    lines += [
        f"            const double {name} = {of}[{i}];"
        for i, name in enumerate(names)
        if name in {str(symbol) for symbol in free}
    ]
    lines += [f"            const double {name} = {sp.ccode(e)};" for name, e in shared]
    lines += [f"            {to}[{i}] = {of}[{i}] + {sp.ccode(e)};" for i, e in enumerate(results)]
    return [*lines, "        }"]


def _rows(matrix: ArrayLike) -> str:
    rows = ("{" + ", ".join(f"{value:.17g}" for value in row) + "}" for row in np.asarray(matrix))
    return ",\n".join(f"        {row}" for row in rows)
