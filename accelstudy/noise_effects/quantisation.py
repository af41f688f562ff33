"""Quantisation: readings are multiples of the least significant bit."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.registry import Setting
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.noise_effects.base import NoiseEffect, register


@register
class Quantisation(NoiseEffect):
    """The position means are rounded to multiples of the LSB, after all noise.

    This happens where means are recorded in counts, or where the noise of the samples is far below
    the LSB. With more noise, averaging removes the rounding of the samples.
    """

    name = "quantisation"
    takes = (Setting("lsb", "m/s^2", STANDARD_GRAVITY / 2048, above=0),)
    equation = "LSB · round(f / LSB)"
    typical = (STANDARD_GRAVITY / 16384, STANDARD_GRAVITY / 2048)

    def read(self, forces: Array) -> Array:
        """Return the nearest multiples of the LSB."""
        return np.asarray(self.settings["lsb"] * np.round(forces / self.settings["lsb"]))
