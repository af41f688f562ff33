"""Noise level: sigma is misspecified."""

from __future__ import annotations

import math

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.registry import Setting
from accelstudy.effects import HoldConditions
from accelstudy.noise_effects.base import NoiseEffect, register


@register
class NoiseLevel(NoiseEffect):
    """All noise has κ times the stated variance."""

    name = "noise_level"
    takes = (Setting("kappa", "1", 2.25, above=0),)
    equation = "Var v = κ σ²"
    typical = (0.6, 4.0)

    def disturb(
        self, noise: Array, sigma: float, hold: HoldConditions, rng: np.random.Generator
    ) -> Array:
        """Return √κ v."""
        return math.sqrt(self.settings["kappa"]) * noise

    @property
    def within_hold(self) -> Array:
        """The samples have the factor √κ as well."""
        return np.full(3, math.sqrt(self.settings["kappa"]))
