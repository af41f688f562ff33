"""Conversion of a sensor's raw numbers to SI, and back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import SENSOR_UNITS, STANDARD_GRAVITY, UNITS

MAX_VALUE = 1e15
"""No acceleration or time is larger, and squares of larger numbers overflow."""


@dataclass(frozen=True)
class Conversion:
    """Scale and offset of raw numbers: SI = (raw − offset) · scale.

    Attributes
    ----------
    scale : (3,) array, one for each axis, or (1,), SI per unit of the raw numbers; not zero
    offset : array of the same shape, raw number that means zero
    unit : str, of the raw numbers, for messages
    """

    scale: Array
    offset: Array
    unit: str = "m/s^2"

    def axis(self, axis: int) -> Conversion:
        """Conversion of the numbers of one axis alone."""
        scale, offset = (np.broadcast_to(each, 3)[[axis]] for each in (self.scale, self.offset))
        return Conversion(scale, offset)

    def to_si(self, raw: Array) -> Array:
        """Convert raw numbers, (..., axes), to SI."""
        return (raw - self.offset) * self.scale

    def from_si(self, values: Array) -> Array:
        """Convert SI, (..., axes), to raw numbers."""
        return values / self.scale + self.offset


def conversion_of(
    unit: str, scale: ArrayLike | None = None, offset: ArrayLike | None = None
) -> Conversion:
    """Conversion of specific forces to m/s².

    Parameters
    ----------
    unit : "m/s^2", "g", "mg" or "counts"
    scale : number or (3,), m/s² per count; only with counts, which need it
    offset : number or (3,), counts at 0 m/s²; only with counts, 0 if omitted

    Raises
    ------
    InputError
        If the unit is unknown, or scale and offset do not fit it.
    """
    if unit == "counts":
        if scale is None:
            raise InputError(
                "unit counts needs a nominal scale (`scale`), in m/s² per count: "
                f"{STANDARD_GRAVITY / 16384:.6g} where 1 g is 16384 counts"
            )
        factor = _triple(scale, "scale")
        if not np.all((np.abs(factor) > 0) & (np.abs(factor) <= MAX_VALUE)):
            raise InputError("scale: must not be 0, and must be finite")
        zero = _triple(0.0 if offset is None else offset, "offset")
        if not np.all(np.abs(zero) <= MAX_VALUE):
            raise InputError("offset: must be finite")
        return Conversion(factor, zero, unit)
    if scale is not None or offset is not None:
        raise InputError(f"a nominal scale or offset goes with unit counts, not {unit}")
    sizes = {name: UNITS["m/s^2"][name] for name in SENSOR_UNITS}
    if unit not in sizes:
        raise UnknownNameError("unit of a log", unit, (*sizes, "counts"))
    return Conversion(np.full(3, sizes[unit]), np.zeros(3), unit)


def _triple(value: ArrayLike, name: str) -> Array:
    values = np.atleast_1d(np.asarray(value, dtype=float))
    if values.shape not in ((1,), (3,)):
        raise InputError(f"{name}: one number or three, not {values.size}")
    return np.array(np.broadcast_to(values, 3))
