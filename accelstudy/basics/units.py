"""Units at the border: everything below works in SI, people read and write gon, ppm and mm/s².

This is the only place where conversion factors stand.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING

from accelstudy.basics.errors import InputError, UnknownNameError, brief, check_name

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

GON = math.pi / 200.0
"""One gon in rad."""
MGON = 1e-3 * GON
"""One milligon in rad."""
STANDARD_GRAVITY = 9.80665
"""m/s²"""

_FORCES = {
    "mm/s^2": 1e-3,
    "m/s^2": 1.0,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
    "g": STANDARD_GRAVITY,
}


def _per(unit: str, *forces: str) -> dict[str, float]:
    """Sizes of units of a specific force per another unit, which is the SI unit."""
    return {f"{force}/{unit}": _FORCES[force] for force in forces}


UNITS: dict[str, dict[str, float]] = {
    "rad": {
        "mgon": MGON,
        "gon": GON,
        "rad": 1.0,
        "mrad": 1e-3,
        "mdeg": 1e-3 * math.pi / 180.0,
        "deg": math.pi / 180.0,
        "arcsec": math.pi / 648000.0,
    },
    "rad/K": {"mgon/K": MGON, "mdeg/K": 1e-3 * math.pi / 180.0, "rad/K": 1.0},
    "1": {"ppm": 1e-6, "%": 1e-2, "1": 1.0},
    "m": {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    "s": {
        "s": 1.0,
        "ms": 1e-3,
        "us": 1e-6,
        "ns": 1e-9,
        "min": 60.0,
        "h": 3600.0,
        "d": 86400.0,
    },
    "kg": {"kg": 1.0, "g": 1e-3},
    "m/s^2": _FORCES,
    "m/s^2/K": _per("K", "mm/s^2", "m/s^2", "mg", "ug"),
    "m/s^2/K^2": _per("K^2", "mm/s^2", "m/s^2", "mg"),
    "1/K": {"ppm/K": 1e-6, "%/K": 1e-2, "1/K": 1.0},
    "m/s^2/s": {
        "mm/s^2/h": 1e-3 / 3600,
        "m/s^2/s": 1.0,
        "mg/h": 1e-3 * STANDARD_GRAVITY / 3600,
    },
    "s^2/m": {
        "ug/g^2": 1e-6 / STANDARD_GRAVITY,
        "s^2/m": 1.0,
        "mg/g^2": 1e-3 / STANDARD_GRAVITY,
    },
    "m/s^2/sqrt(Hz)": {
        **_per("sqrt(Hz)", "ug", "mg", "mm/s^2", "m/s^2"),
        "m/s/sqrt(h)": 1.0 / 60,
        "mm/s/sqrt(h)": 1e-3 / 60,
    },
    "m/s^2/sqrt(s)": {
        **_per("sqrt(s)", "ug", "mm/s^2", "m/s^2"),
        "mm/s^2/sqrt(h)": 1e-3 / 60,
    },
    "K": {"K": 1.0, "degC": 1.0},
}
"""SI unit -> {unit that people use: its size in the SI unit}; files have the first one."""

SENSOR_UNITS = ("m/s^2", "g", "mg")
"""Units in which sensors give specific forces."""
ROBOT_UNITS = {"gon": "gon", "deg": "degrees", "rad": "radians"}
"""Units in which robots give angles, and their names in a sentence."""
CLOCK_UNITS = ("s", "ms", "us", "ns")
"""Units in which logs give the time."""

ANGLE_UNITS = {"gon": "mgon", "deg": "mdeg"}
"""Units in which angles can be shown: that of an attitude -> that of a small angle."""
ANGLE_UNIT_VARIABLE = "ACCELSTUDY_ANGLE_UNIT"
"""Environment variable by which a user chooses one for commands, workflows and programs."""
_angle_unit: ContextVar[str | None] = ContextVar("angle_unit", default=None)


@contextmanager
def angles_in(unit: str | None) -> Iterator[None]:
    """Show angles in gon or deg within a ``with`` block; None changes nothing.

    Only what people look at changes: files keep their units.

    Raises
    ------
    UnknownNameError
        If `unit` is neither gon nor deg.
    """
    if unit is not None and unit not in ANGLE_UNITS:
        raise UnknownNameError("angle unit", unit, ANGLE_UNITS)
    token = _angle_unit.set(unit or _angle_unit.get())
    try:
        yield
    finally:
        _angle_unit.reset(token)


def attitude_unit() -> str:
    """Unit in which attitudes are shown, gon or deg; small angles have that of `display_unit`.

    It is that of `angles_in`, else the one that the user's environment names, else gon.

    Raises
    ------
    InputError
        If the environment names no such unit.
    """
    unit = _angle_unit.get() or os.environ.get(ANGLE_UNIT_VARIABLE) or "gon"
    if unit not in ANGLE_UNITS:
        known = " or ".join(ANGLE_UNITS)
        raise InputError(f"{ANGLE_UNIT_VARIABLE}: {unit!r} is no unit of angles; choose {known}")
    return unit


def to_attitude(angle: ArrayLike) -> NDArray[np.float64]:
    """Convert an angle from rad into the unit in which attitudes are shown."""
    return _converted(angle, "rad", attitude_unit())


def angle_note() -> str:
    """Explain the unit of angles, for the place where it is first used."""
    if attitude_unit() == "gon":
        return "100 gon = 90°, 1 mgon = 0.0009°"
    return "90° = 100 gon, 1 mdeg = 0.001°"


def recorded_unit(unit: str) -> str:
    """Unit in which files hold a quantity of the SI `unit`; the SI unit if there is no other."""
    return next(iter(UNITS.get(unit, {unit: 1.0})))


def to_recorded(value: ArrayLike, unit: str) -> NDArray[np.float64]:
    """Convert `value` from the SI `unit` into the unit of files."""
    return _converted(value, unit, recorded_unit(unit))


def display_unit(unit: str) -> str:
    """Unit in which people see a quantity of the SI `unit`: that of files, but angles as chosen."""
    angle, of, other = unit.partition("/")
    return ANGLE_UNITS[attitude_unit()] + of + other if angle == "rad" else recorded_unit(unit)


def unit_label(unit: str) -> str:
    """Return a unit as it is printed."""
    return unit.replace("^2", "²").replace("ug", "µg")


def shown_unit(unit: str) -> str:
    """Return `display_unit` as it is printed."""
    return unit_label(display_unit(unit))


def to_display(value: ArrayLike, unit: str) -> NDArray[np.float64]:
    """Convert `value` from the SI `unit` into the unit shown to people."""
    return _converted(value, unit, display_unit(unit))


def _converted(value: ArrayLike, unit: str, wanted: str) -> NDArray[np.float64]:
    return _numbers(value) / UNITS.get(unit, {}).get(wanted, 1.0)


def to_si(value: ArrayLike, unit_of_value: str, unit: str) -> NDArray[np.float64]:
    """Convert `value` from the unit `unit_of_value` into the SI `unit`.

    Raises
    ------
    UnknownNameError
        If `unit_of_value` is no unit of that quantity.
    """
    known = UNITS.get(unit, {unit: 1.0})
    check_name(f"unit of a quantity in {unit}", unit_of_value, known)
    return _numbers(value) * known[unit_of_value]


_SPELLINGS = {"µ": "u", "μ": "u", "²": "^2", "°C": "degC", "°": "deg", "√Hz": "sqrt(Hz)"}
_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(\S*)\s*")


@dataclass(frozen=True)
class InputQuantity:
    """A quantity that the user may give, by an option of a command or a key of a file.

    Attributes
    ----------
    unit : str, SI
    least, most : float, SI, both allowed
    bare : bool, whether a number without a unit is one in SI, also as a text
    """

    unit: str
    least: float = 0.0
    most: float = math.inf
    bare: bool = False

    def read(self, text: str) -> float:
        """Read a number with its unit, as a person writes it: 10mgon, 0.01°, 2 mm/s2, 22.5µg/√Hz.

        Returns
        -------
        float, SI

        Raises
        ------
        InputError
            If it is no such quantity, or out of bounds. Only 0 needs no unit.
        """
        if re.match(r"\s*[+-]?\d*,\d", text):
            raise InputError(f"{brief(text)}: write a decimal point: {text.replace(',', '.', 1)}")
        match = _QUANTITY.fullmatch(text)
        known = UNITS.get(self.unit, {self.unit: 1.0})
        first = next(iter(known))
        if match is None or not (match[2] or self.bare or float(match[1]) == 0):
            number = "a number" if self.bare else "a number with its unit"
            ends = _ends(self.least, self.most)
            like = f", as 2{first}" if self.unit != "1" else ends and f" of{ends}"
            raise InputError(f"expected {number}{like}, not {brief(text)}")
        name = match[2] or (self.unit if self.bare else first)
        for spelling, plain in _SPELLINGS.items():
            name = name.replace(spelling, plain)
        name = re.sub(r"(?<=[a-zA-Z])2", "^2", name)
        if name not in known:
            raise InputError(f"{brief(text)}: the unit must be one of {', '.join(known)}")
        size = known[name]
        value = float(match[1]) * size
        if not self.least <= value <= self.most:
            ends = f"{_ends(self.least / size, self.most / size)} {name}".removesuffix(" 1")
            raise InputError(f"{brief(text)}: must be{ends}")
        if math.isinf(value):
            raise InputError(f"{brief(text)}: must be a finite number")
        return value


def _ends(least: float, most: float) -> str:
    """Limits in words, after a space; empty without any."""
    ends = {"at least": least, "at most": most}
    words = (f" {word} {end:.6g}" for word, end in ends.items() if math.isfinite(end))
    return " and".join(words)


def _numbers(value: ArrayLike) -> NDArray[np.float64]:
    import numpy as np  # half of the time of a command that shows no number, as --help

    return np.asarray(value, dtype=float)
