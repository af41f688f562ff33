"""Saturation: beyond a knee the output grows less than the input."""

import numpy as np

from accelstudy.basics.registry import Setting
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects.base import Effect, per_axis, register
from accelstudy.effects.components import Number
from accelstudy.effects.hold_conditions import HoldConditions

MIN_KNEE_SHARE = 0.25
"""Part of a stated range up to which a sensor certainly does not saturate."""
ROUND_WIDTH = 0.005
"""m/s² on either side of the knee over which it is round, as the noise of its samples makes that of
a mean. At a sharp corner an adjustment may not settle."""


@register
class Saturation(Effect):
    """Loss of gain beyond a knee, −k_i sign(f_i) max(0, |f_i| − c); k = 1 is hard clipping.

    A sensor clips what it would read, with bias and scale and all else: here f is that output. Gain
    is only lost, 0 ≤ k ≤ 1. The knee c, in m/s², is searched for, within the range of the sensor if
    that is stated.
    """

    name = "saturation"
    family = "odd nonlinearity"
    parameters = per_axis("k_sat", "1", "k_{s%}")
    takes = (Setting("knee", "m/s^2", 0.95 * STANDARD_GRAVITY, above=0, smooth=True),)
    equation = "−k_i sign(f_i) max(0, |f_i| − c)"
    typical = (0.02, 0.5)
    last = True
    bounds = (0.0, 1.0)

    def output(self, f, p, g, hold, xp):
        """Return −k sign(f) max(0, |f| − c), the corner rounded."""

        def excess(f_i: Number) -> Number:
            e = xp.abs(f_i) - self.settings["knee"]
            # Exactly zero below the knee, or an axis that never reaches it would seem to.
            begun = (e + ROUND_WIDTH + xp.abs(e + ROUND_WIDTH)) / 2
            near = (begun + 2 * ROUND_WIDTH - xp.abs(begun - 2 * ROUND_WIDTH)) / 2
            return near**2 / (4 * ROUND_WIDTH) + (e - ROUND_WIDTH + xp.abs(e - ROUND_WIDTH)) / 2

        return tuple(-k * xp.sign(f_i) * excess(f_i) for k, f_i in zip(p, f, strict=True))

    def candidates(self, hold, f, g):
        """Return knees that some, but not most, of the forces exceed, within a stated range."""
        parts = (*np.arange(0.5, 0.96, 0.05), 0.97, 0.98, 0.99)
        knees = (float(f"{part * g:.4g}") for part in parts)
        tried = (Saturation(knee=knee) for knee in knees)
        return tuple(effect for effect in tried if effect.possible(hold))

    def possible(self, hold: HoldConditions) -> bool:
        """Return whether the knee is within a stated range, and not far within it."""
        full, knee = hold.full_range, self.settings["knee"]
        return full is None or MIN_KNEE_SHARE * full <= knee <= full
