"""What an effect is, and the registry of effects.

The sensor turns the specific force f_b (body frame) into its output f_s in three steps,

    f_a = T⁻¹ f_b,        T = I + Σ axes(p),
    f_o = f_a + Σ output(f_a, p),
    f_s = f_o + Σ output(f_o, p) of the effects that act last,

and a robot that carries it reads the angles (φ, θ) + Σ reading(φ, θ, p). Each effect says what it
adds to one of these sums; what it does not override is zero. The formulas are written in
components with ordinary arithmetic and functions of the namespace `xp`, so that one definition
serves NumPy arrays, symbols to differentiate, and generated code.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any, ClassVar, Literal

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, check_name
from accelstudy.basics.plugins import cached_lookup
from accelstudy.basics.registry import RegistryWithSettings, WithSettings
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects.components import (
    ANGLES,
    AXES,
    ZERO_MATRIX,
    ZERO_VECTOR,
    Matrix,
    Number,
    Vector,
)
from accelstudy.effects.hold_conditions import HoldConditions
from accelstudy.effects.hold_symbols import HoldSymbols
from accelstudy.symbolic.algebra import sp
from accelstudy.symbolic.tracing import symbolic, symbols

COURSES = ("slow change in time", "temperature")
"""Families of effects that change with time or temperature."""
USUAL_SHARES = (1e-4, 1e-3)
"""Parts of g by which an effect of typical size changes a reading."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: its name, its SI unit and its symbol in figures (mathtext)."""

    name: str
    unit: str
    symbol: str


def per_axis(
    name: str, unit: str, symbol: str, axes: Iterable[str] = AXES
) -> tuple[Parameter, ...]:
    """Make a parameter of an effect for each axis, pair of axes or angle, `%` in the symbol."""
    return tuple(
        Parameter(f"{name}_{i}", unit, f"${symbol.replace('%', ANGLES.get(i, i))}$") for i in axes
    )


class Effect(WithSettings):
    """One systematic effect; subclasses set the class attributes and override what they add.

    In the methods `p` is the tuple of the effect's own parameters, in which all formulas are
    linear, `f` the specific force in sensor axes (f_a), `g` the local gravity, `hold` the
    `HoldConditions`, whose columns are numbers, arrays or symbols, and `xp` the namespace of
    functions (``np`` or a symbolic twin with the same names).

    Attributes
    ----------
    name : str, canonical
    family : str, what it has in common with effects that are easily mistaken for it
    parameters : tuple of Parameter
    takes : tuple of Setting, the settings that it takes
    equation : str, what is added, for people; by default written from the methods
    typical : (float, float), usual size of a parameter from good to cheap equipment, SI; by default
        a size that changes a reading by 0.1 to 1 thousandth of g
    part : what causes the effect, the "sensor" or the "rig" that turns it
    last : bool, whether it acts on the output that all other effects leave
    bounds : (float, float), between which physics has its parameters, SI
    partial : bool, whether some of its parameters are left out
    drifts : bool, whether it grows in proportion to time, and is known within its session only
    informed : bool, whether something is known of its parameters a priori, see `deviations`
    sudden : bool, whether it happens once, at a time that no other session has
    """

    kind = "effect"
    parameters: ClassVar[tuple[Parameter, ...]]
    part: ClassVar[Literal["sensor", "rig"]] = "sensor"
    drifts: ClassVar[bool] = False
    last: ClassVar[bool] = False
    bounds: ClassVar[tuple[float, float]] = (-np.inf, np.inf)
    partial: ClassVar[bool] = False
    informed: ClassVar[bool] = False
    sudden: ClassVar[bool] = False

    @property
    def is_course(self) -> bool:
        """Whether the effect changes with time or temperature, in any attitude."""
        return self.part == "sensor" and (self.family in COURSES or self.sudden)

    @property
    def unit(self) -> str:
        """SI unit of the parameters, and so of `typical`."""
        return self.parameters[0].unit

    @property
    def equation(self) -> str:
        """Formula of the effect, for people."""
        output, axes, reading = expressions(self)
        parts = (*output, *(part for row in axes for part in row), *reading)
        texts = [_text(part) for part in parts if part]
        if len(texts) == len(AXES):  # one formula if all axes have the same
            alike = {re.sub(rf"_{i}\b", "_i", text) for i, text in zip(AXES, texts, strict=True)}
            texts = list(alike) if len(alike) == 1 else texts
        return ", ".join(t.replace("**2", "²").replace("**3", "³").replace("*", " ") for t in texts)

    @property
    def deviations(self) -> Array:
        """Standard deviations of the parameters a priori, (k,), SI; infinite if unknown."""
        return np.full(len(self.parameters), np.inf)

    @property
    def typical(self) -> tuple[float, float]:
        """Usual size of a parameter from good to cheap equipment, SI."""
        g, some = STANDARD_GRAVITY, 0.5
        forces = g * np.array([d for d in product((-1.0, 0.0, 0.1, 1.0), repeat=3) if any(d)])
        f, n = tuple(forces.T), np.ones(len(forces))
        hold = HoldConditions(
            temperature=30.0 * n, time=600.0 * n, vibration=n,
            roll=some * n, pitch=some * n, yaw=some * n, step_x=g * n, step_y=g * n, step_z=g * n,
            order=600.0 * n,
        )  # fmt: skip
        reach = 0.0
        for p in np.eye(len(self.parameters)):
            added = [
                *self.output(f, tuple(p), g, hold, np),
                *np.asarray(self.axes(tuple(p), np), dtype=float) @ forces.T,
                *(
                    g * np.asarray(e)
                    for e in self.reading((some * n, some * n), tuple(p), hold, np)
                ),
            ]
            reach = max(reach, *(float(np.max(np.abs(part))) for part in added))
        low, high = (part * g / reach if 0 < reach < np.inf else part for part in USUAL_SHARES)
        return low, high

    @property
    def spec(self) -> str:
        """Name with its settings and, if some parameters are left out, with those that it has."""
        names = f"[{', '.join(p.name for p in self.parameters)}]" if self.partial else ""
        return super().spec + names

    def candidates(self, hold: HoldConditions, f: Array, g: float) -> Sequence[Effect]:
        """Shapes of the effect, that is, settings to try, for given holds with forces f (n, 3)."""
        return (self,)

    def possible(self, hold: HoldConditions) -> bool:
        """Whether the settings of the effect are possible in given holds."""
        return True

    def between(self, other: Effect, hold: HoldConditions) -> Sequence[Effect]:
        """Shapes between two candidates, which were skipped because there are many positions."""
        return ()

    def with_parameters(self, indices: tuple[int, ...]) -> Effect:
        """Return the effect with some of its parameters; the others are zero."""
        return _part(type(self), indices)(**self.settings)  # type: ignore[arg-type]

    def axes(self, p: tuple[Number, ...], xp: Any) -> Matrix:
        """Add to the matrix T of the sensitive axes."""
        return ZERO_MATRIX

    def output(self, f: Vector, p: tuple[Number, ...], g: Number, hold: Any, xp: Any) -> Vector:
        """Add to the output f_s, in m/s²."""
        return ZERO_VECTOR

    def reading(
        self, angles: tuple[Number, Number], p: tuple[Number, ...], hold: Any, xp: Any
    ) -> tuple[Number, Number]:
        """Add to the robot's reading of roll and pitch, in rad."""
        return (0, 0)


@cache
def _part(kind: type[Effect], indices: tuple[int, ...]) -> type[Effect]:
    """Kind of effect with some of its parameters."""
    if indices == tuple(range(len(kind.parameters))):
        return kind

    def full(p: tuple[Number, ...]) -> tuple[Number, ...]:
        values = dict(zip(indices, p, strict=True))
        return tuple(values.get(i, 0) for i in range(len(kind.parameters)))

    content = {
        "__doc__": kind.__doc__,
        "partial": True,
        "parameters": tuple(kind.parameters[i] for i in indices),
        "axes": lambda self, p, xp: kind.axes(self, full(p), xp),
        "output": lambda self, f, p, g, hold, xp: kind.output(self, f, full(p), g, hold, xp),
        "reading": lambda self, angles, p, hold, xp: kind.reading(self, angles, full(p), hold, xp),
    }
    return type(kind.__name__, (kind,), content)


def _check(effect: Effect) -> None:
    """Check an effect of a plug-in as far as its formula tells, as tests do with all others.

    Raises
    ------
    InputError
        If it has a parameter of another effect, a wrong number of components, or a formula that is
        not linear in its parameters.
    """
    for other in map(get_effect, effect_names()):
        shared = {p.name for p in effect.parameters} & {p.name for p in other.parameters}
        if shared and other.name != effect.name:
            raise InputError(f"{min(shared)} is a parameter of {other.name!r} already")
    output, axes, reading = expressions(effect)
    entries = [entry for row in axes for entry in row]
    components = {"output": (output, 3), "axes": (entries, 9), "reading": (reading, 2)}
    for method, (parts, number) in components.items():
        if len(parts) != number:
            raise InputError(f"{method} has {len(parts)} components, not {number}")
    own = symbols(*(parameter.name for parameter in effect.parameters))
    zero = dict.fromkeys(own, 0)
    for part in map(sp.sympify, (*output, *entries, *reading)):
        if part.xreplace(zero) != 0 or any(part.diff(p).free_symbols & {*own} for p in own):
            raise InputError(f"{_text(part)} is not linear in {', '.join(map(str, own))}")


_registry: RegistryWithSettings[Effect] = RegistryWithSettings("effect", "effects", _check)
effect_names = _registry.names
register = _registry.register
unlisted = _registry.unlisted
effects_without = _registry.without


def is_effect(name: str) -> bool:
    """Whether there is an effect of that name, listed or not."""
    return name in _registry


@cached_lookup
def get_effect(spec: str) -> Effect:
    """Return an effect by its name, or by its name and settings: ``warm_up(tau=300)``.

    The names of some of its parameters in brackets leave out the others, which are zero:
    ``saturation(knee=9.5)[k_sat_z]``.

    Raises
    ------
    UnknownNameError
        If there is no such effect, setting or parameter.
    InputError
        If the settings cannot be read.
    """
    match = re.fullmatch(r"([^\[\]]*)\[([^\[\]]*)\]\s*", str(spec))
    if match is None:
        return _registry.get(spec)
    effect = _registry.get(match[1].strip())
    names = [parameter.name for parameter in effect.parameters]
    wanted = [name.strip() for name in match[2].split(",")]
    for name in wanted:
        check_name(f"parameter of the effect {effect.name!r}", name, names)
    return effect.with_parameters(tuple(i for i, name in enumerate(names) if name in wanted))


def expressions(effect: Effect) -> tuple[tuple[Any, ...], Matrix, tuple[Any, Any]]:
    """Evaluate an effect with symbols for all but its settings, which stay numbers."""
    numbered = type(effect)()
    numbered.settings = {
        name: sp.Integer(int(value)) if float(value).is_integer() else sp.Float(value)
        for name, value in effect.settings.items()
    }
    p = symbols(*(parameter.name for parameter in effect.parameters))
    f, (g,), hold = symbols(*(f"f_{axis}" for axis in AXES)), symbols("g"), HoldSymbols()
    return (
        numbered.output(f, p, g, hold, symbolic),
        numbered.axes(p, symbolic),
        numbered.reading((hold.roll, hold.pitch), p, hold, symbolic),
    )


def _text(expression: Any) -> str:
    return sp.sstr(sp.sympify(expression), full_prec=False)
