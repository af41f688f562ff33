"""Defaults for an effect that states neither its equation nor its typical sizes."""

from __future__ import annotations

import re
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects.components import AXES, Matrix
from accelstudy.effects.hold_conditions import HoldConditions
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import symbolic, symbols

if TYPE_CHECKING:
    from accelstudy.effects.base import Effect

USUAL = (1e-4, 1e-3)
"""Parts of g by which an effect of typical size changes a reading."""

Texts = list[str]


def formulas(effect: Effect) -> dict[str, Texts | list[Texts]]:
    """Write what an effect adds as text that a program can evaluate, its settings as numbers.

    Returns
    -------
    dict
        "output" (3), "axes" (3 × 3) and "reading" (2), as far as they are not zero, of f_x, f_y,
        f_z (m/s², along the sensitive axes), g, the parameters and the columns of `HoldConditions`.
    """
    output, axes, reading = _expressions(effect)
    found: dict[str, Texts | list[Texts]] = {}
    if any(part != 0 for part in output):
        found["output"] = [_text(part) for part in output]
    if any(part != 0 for row in axes for part in row):
        found["axes"] = [[_text(part) for part in row] for row in axes]
    if any(part != 0 for part in reading):
        found["reading"] = [_text(part) for part in reading]
    return found


def equation_of(effect: Effect) -> str:
    """Write what an effect adds, for people: one formula if all axes have the same."""
    output, axes, reading = _expressions(effect)
    texts = [_text(part) for part in (*output, *(a for row in axes for a in row), *reading) if part]
    if len(texts) == len(AXES):
        alike = {re.sub(rf"_{i}\b", "_i", text) for i, text in zip(AXES, texts, strict=True)}
        texts = list(alike) if len(alike) == 1 else texts
    return ", ".join(t.replace("**2", "²").replace("**3", "³").replace("*", " ") for t in texts)


def typical_of(effect: Effect) -> tuple[float, float]:
    """Return sizes of a parameter with which an effect changes readings by `USUAL`, SI."""
    g, some = STANDARD_GRAVITY, 0.5
    forces = g * np.array([d for d in product((-1.0, 0.0, 0.1, 1.0), repeat=3) if any(d)])
    f, n = tuple(forces.T), np.ones(len(forces))
    hold = HoldConditions(
        temperature=30.0 * n, time=600.0 * n, vibration=n,
        roll=some * n, pitch=some * n, yaw=some * n, step_x=g * n, step_y=g * n, step_z=g * n,
        order=600.0 * n,
    )  # fmt: skip
    reach = 0.0
    for p in np.eye(len(effect.parameters)):
        added = [
            *effect.output(f, tuple(p), g, hold, np),
            *np.asarray(effect.axes(tuple(p), np), dtype=float) @ forces.T,
            *(g * np.asarray(e) for e in effect.reading((some * n, some * n), tuple(p), hold, np)),
        ]
        reach = max(reach, *(float(np.max(np.abs(part))) for part in added))
    low, high = (part * g / reach if 0 < reach < np.inf else part for part in USUAL)
    return low, high


def _expressions(effect: Effect) -> tuple[tuple[Any, ...], Matrix, tuple[Any, Any]]:
    """Evaluate an effect with symbols for all but its settings, which stay numbers."""
    numbered = type(effect)()
    numbered.settings = {
        name: sp.Integer(int(value)) if float(value).is_integer() else sp.Float(value)
        for name, value in effect.settings.items()
    }
    p = symbols(*(parameter.name for parameter in effect.parameters))
    f, (g,) = symbols(*(f"f_{axis}" for axis in AXES)), symbols("g")
    known = HoldSymbols()
    return (
        numbered.output(f, p, g, known, symbolic),
        numbered.axes(p, symbolic),
        numbered.reading((known.roll, known.pitch), p, known, symbolic),
    )


def _text(expression: Any) -> str:
    return sp.sstr(sp.sympify(expression), full_prec=False)
