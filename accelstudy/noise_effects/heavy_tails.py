"""Heavy tails: large errors are more frequent than in a normal distribution."""

from __future__ import annotations

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.basics.registry import Setting
from accelstudy.effects import HoldConditions
from accelstudy.noise_effects.base import NoiseEffect, register


@register
class HeavyTails(NoiseEffect):
    """Student's t distribution with ν degrees of freedom, scaled so that the variance stays σ².

    A t variable is a normal one divided by √(χ²_ν/ν). Its variance ν/(ν − 2) is divided out. Every
    component of every hold has its own divisor.
    """

    name = "heavy_tails"
    takes = (Setting("nu", "1", 4.0, above=2),)
    equation = "v ~ σ √((ν − 2)/ν) t_ν"
    typical = (3.0, 10.0)

    def disturb(
        self, noise: Array, sigma: float, hold: HoldConditions, rng: np.random.Generator
    ) -> Array:
        """Return v √((ν − 2) / χ²_ν)."""
        nu = self.settings["nu"]
        return noise * np.sqrt((nu - 2) / rng.chisquare(nu, noise.shape))
