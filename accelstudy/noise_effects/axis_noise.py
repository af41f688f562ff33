"""Axis noise: the three axes are not equally noisy."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.registry import Setting
from accelstudy.effects import HoldConditions
from accelstudy.noise_effects.base import NoiseEffect, register


@register
class AxisNoise(NoiseEffect):
    """The noise of axis i has κ_i times the stated variance.

    By default z has 1.5 times the sd of the others: the axis out of the plane of a MEMS chip is
    usually noisier.
    """

    name = "axis_noise"
    takes = (
        Setting("kappa_x", "1", 1.0, above=0),
        Setting("kappa_y", "1", 1.0, above=0),
        Setting("kappa_z", "1", 2.25, above=0),
    )
    equation = "Var v_i = κ_i σ²"
    typical = (2.25, 4.0)

    def disturb(
        self, noise: Array, sigma: float, hold: HoldConditions, rng: np.random.Generator
    ) -> Array:
        """Return √κ_i v_i."""
        return self.within_hold * noise

    @property
    def within_hold(self) -> Array:
        """The samples have the factor √κ_i as well."""
        return np.sqrt([self.settings[f"kappa_{i}"] for i in "xyz"])
