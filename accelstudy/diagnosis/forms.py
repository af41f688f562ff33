"""Forms that a learned function may have, each as a person would say it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import attitude_unit, to_attitude
from accelstudy.basics.wording import number
from accelstudy.effects import learned
from accelstudy.effects.learned import WAVES

Array = NDArray[np.float64]

MAX_PLACES = 60
"""Places of a step that are tried at most."""
MOST_CYCLES, EACH = 10.0, 3
"""Periods of a sine in the range of its coordinate at most; each needs as many different values."""
DISTINCT_VALUES = 100
"""Parts of its range in which values of a coordinate count as one."""
PERIOD_STEP = 1 / 16
"""Step of the number of periods that are tried."""
TURNS = {1: "once per turn", 2: "twice per turn", 3: "three times per turn",
         4: "four times per turn"}  # fmt: skip
"""Harmonics of an angle."""
POWERS = {1: "in proportion to it", 2: "with its square", 3: "with its cube"}
"""Powers of a coordinate that has a zero."""
POLYNOMIALS = {1: "in a straight line", 2: "as a parabola", 3: "as a cubic"}
"""Of a coordinate that has none."""

PARTS = np.geomspace(0.03, 1.0, 80)
"""Constants of an exponential, and widths of a dead band, in ranges of the coordinate."""

# --- coordinates and targets --------------------------------------------------------------------


@dataclass(frozen=True)
class Coordinate:
    """How people see a coordinate.

    Attributes
    ----------
    words : str
    unit, step : str, of its values and of their differences
    size : float, SI size of that unit
    has_zero : bool, whether its zero means something
    is_course : bool, whether it counts from a start on
    """

    words: str
    unit: str
    step: str
    size: float = 1.0
    has_zero: bool = False
    is_course: bool = False

    def at(self, value: float) -> str:
        """Show a value."""
        return f"{number(value / self.size)} {self.unit}".rstrip()

    def by(self, value: float) -> str:
        """Show a difference of values."""
        return f"{number(value / self.size)} {self.step}"


def coordinate_of(name: str) -> Coordinate:
    """Describe a coordinate of a learned effect."""
    name = WAVES.get(name, name)
    if name in ANGLES:
        unit = attitude_unit()
        return Coordinate(ANGLES[name], unit, unit, float(1 / to_attitude(1.0)))
    return COORDINATES[name]


ANGLES = {"angle": "the angle", "yaw": "the yaw"}
RATE = ("K/min", "K/min", 1 / 60, True)
FORCE = ("m/s²", "m/s²", 1.0, True)
COORDINATES = {
    "force": Coordinate("the force along the same axis", *FORCE),
    "previous": Coordinate("the force in the position before", *FORCE),
    "vibration": Coordinate("the vibration", *FORCE),
    "temperature": Coordinate("the temperature", "°C", "K"),
    "temperature rate": Coordinate("the rate of the temperature", *RATE),
    "time": Coordinate("the time", "min", "min", 60.0, is_course=True),
    "order": Coordinate("the number of the position", "", "positions", is_course=True),
}
"""Coordinates that are no angles."""


@dataclass(frozen=True)
class Target:
    """What depends on a coordinate.

    Attributes
    ----------
    label, words : str, short and in a sentence, with a place for the components
    components : tuple of str
    unit : str, SI
    """

    label: str
    words: str
    components: tuple[str, ...]
    unit: str


WORDS = {
    "bias": ("bias of {}", "the bias of {}"),
    "scale": ("scale of {}", "the scale of {}"),
    "square": ("quadratic scale of {}", "the quadratic scale of {}"),
    "nonorthogonality": ("non-orthogonality {}", "the non-orthogonality {}"),
    "mounting": ("rotation about {}", "the rotation of the sensor on its mounting about {}"),
    "reading": ("reading of {}", "the robot's reading of {}"),
    "tilt": ("tilt {}", "the tilt of the robot's base ({})"),
}
TARGETS = {name: Target(*said, *learned.TARGETS[name]) for name, said in WORDS.items()}


# --- forms --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Form:
    """A form of functions h(c) = Σ_j a_j φ_j(c; s).

    Attributes
    ----------
    words : str, with a place for the setting s if it has one
    basis : callable, φ of s and of c (...), (..., k)
    settings : (t,) array
    shown : callable, shows a setting
    is_sine : bool, of which the amplitude is told; of others it is how much they go up and down
    """

    words: str
    basis: Callable[[float, Array], Array]
    settings: Array = field(default_factory=lambda: np.zeros(1))
    shown: Callable[[float], str] = str
    is_sine: bool = False

    def said(self, setting: float) -> str:
        """Say it with a setting."""
        return self.words.format(self.shown(setting))


def forms(coordinate: str, c: Array) -> list[Form]:
    """Forms that a function of a coordinate with the values c (n, a) may have."""
    of, values = coordinate_of(coordinate), distinct(c)
    low, high = values[0], values[-1]
    found = []
    if len(values) > EACH:  # otherwise a line or a parabola is all that shows
        found = [_step(of, c)]
        if coordinate in ANGLES:
            found += [
                Form(words, _sine, np.array([float(k)]), is_sine=True) for k, words in TURNS.items()
            ]
        else:
            found += _of_a_range(of, values)
        if of.has_zero:
            found += [Form(words, partial(_power, p)) for p, words in POWERS.items()]
            if low < 0 < high:
                widths = PARTS * np.abs(values).max()
                found += [
                    Form("with its absolute value", lambda _, x: np.abs(x)[..., None]),
                    Form("by its sign alone", lambda _, x: np.sign(x)[..., None]),
                    Form("beyond ±{} only", _beyond, widths, of.at),
                ]
            return found
    degrees = {p: words for p, words in POLYNOMIALS.items() if p < len(values)}
    return [
        *found,
        *(Form(words, partial(_polynomial, p, low, high)) for p, words in degrees.items()),
    ]


def distinct(c: Array) -> Array:
    """Values of a coordinate that differ by more than a small part of its range."""
    values = np.unique(c)
    part = np.floor((values - values[0]) / np.ptp(values) * DISTINCT_VALUES * (1 - 1e-9))
    chosen = values[np.diff(part, prepend=-1) > 0]
    chosen[-1] = values[-1]
    return chosen


def _of_a_range(of: Coordinate, values: Array) -> list[Form]:
    """A sine in the range of some values (n,) and, of a course, a decay from its start on."""
    low, length = values[0], np.ptp(values)
    cycles = np.arange(1.0, min(MOST_CYCLES, (len(values) - 1) / EACH) + 0.1, PERIOD_STEP)
    found = []
    if len(cycles):
        words, turns = "as a sine with a period of {}", 2 * np.pi * cycles / length
        found = [Form(words, _sine, turns, lambda turn: of.by(2 * np.pi / turn), is_sine=True)]
    if of.is_course:
        words = "decaying with a time constant of {}"
        found.append(Form(words, partial(_decay, low), length * PARTS, of.by))
    return found


def _step(of: Coordinate, c: Array) -> Form:
    """A step between any two values of a coordinate."""
    values = np.unique(c)
    between = (values[1:] + values[:-1]) / 2
    some = np.unique(np.linspace(0, len(between) - 1, MAX_PLACES).round().astype(int))

    def gap(place: float) -> str:
        after = int(np.searchsorted(values, place))
        return f"{of.at(values[after - 1])} and {of.at(values[after])}"

    return Form("in a step between {}", _beyond_place, between[some], gap)


def _beyond_place(place: float, x: Array) -> Array:
    return np.asarray(x > place, dtype=float)[..., None]


def _power(p: int, _: float, x: Array) -> Array:
    return np.asarray(x[..., None] ** p)


def _polynomial(p: int, low: float, high: float, _: float, x: Array) -> Array:
    return np.asarray(((2 * x[..., None] - low - high) / (high - low)) ** np.arange(1, p + 1))


def _decay(start: float, constant: float, x: Array) -> Array:
    return np.exp((start - x[..., None]) / constant)


def _beyond(width: float, x: Array) -> Array:
    """What is beyond a dead band."""
    return (np.sign(x) * np.maximum(np.abs(x) - width, 0))[..., None]


def _sine(turn: float, x: Array) -> Array:
    return np.stack([np.sin(turn * x), np.cos(turn * x)], axis=-1)
