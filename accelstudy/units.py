"""Units at the border: everything below works in SI, people read and write gon, ppm and mm/s².

This is the only place where conversion factors stand.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.errors import UnknownNameError

GON = np.pi / 200.0
"""One gon in rad."""
MGON = 1e-3 * GON
"""One milligon in rad."""
STANDARD_GRAVITY = 9.80665
"""m/s²"""

UNITS: dict[str, dict[str, float]] = {
    "rad": {
        "mgon": MGON,
        "gon": GON,
        "rad": 1.0,
        "mrad": 1e-3,
        "deg": np.pi / 180.0,
        "arcsec": np.pi / 648000.0,
    },
    "1": {"ppm": 1e-6, "%": 1e-2, "1": 1.0},
    "m/s^2": {
        "mm/s^2": 1e-3,
        "m/s^2": 1.0,
        "mg": 1e-3 * STANDARD_GRAVITY,
        "ug": 1e-6 * STANDARD_GRAVITY,
        "g": STANDARD_GRAVITY,
    },
    "m/s^2/K": {
        "mm/s^2/K": 1e-3,
        "m/s^2/K": 1.0,
        "mg/K": 1e-3 * STANDARD_GRAVITY,
    },
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
}
"""SI unit -> {unit that people use: its size in the SI unit}; the first is the one we show."""


def display_unit(unit: str) -> str:
    """Unit in which a quantity of the SI `unit` is shown; the SI unit itself if none is better."""
    return next(iter(UNITS.get(unit, {unit: 1.0})))


def to_display(value: ArrayLike, unit: str) -> NDArray[np.float64]:
    """Convert `value` from the SI `unit` into the unit shown to people."""
    return np.asarray(value, dtype=float) / UNITS.get(unit, {}).get(display_unit(unit), 1.0)


def to_si(value: ArrayLike, given: str, unit: str) -> NDArray[np.float64]:
    """Convert `value` from the unit `given` into the SI `unit`.

    Raises
    ------
    UnknownNameError
        If `given` is no unit of that quantity.
    """
    known = UNITS.get(unit, {unit: 1.0})
    if given not in known:
        raise UnknownNameError(f"unit of a quantity in {unit}", given, known)
    return np.asarray(value, dtype=float) * known[given]
