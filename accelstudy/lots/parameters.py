"""A parameter over the sensors of a lot: the mean of the type, and the scatter about it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.random_effects import RandomEffects

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TypeParameter:
    """A parameter over the sensors of a lot.

    Attributes
    ----------
    name, unit : str, SI
    values, sigmas : (n,) arrays, of the sensors; NaN where a campaign cannot show it
    usual, has : (n,) bool arrays, whether a sensor is not odd, and whether it has the parameter
    """

    name: str
    unit: str
    values: Array
    sigmas: Array
    usual: NDArray[np.bool_]
    has: NDArray[np.bool_]

    @cached_property
    def of_type(self) -> RandomEffects | None:
        """Mean and scatter over usual sensors that have it; None if no campaign shows it."""
        told = self.usual & self.has & np.isfinite(self.values) & np.isfinite(self.sigmas)
        if not told.any():
            return None
        design = np.ones((np.count_nonzero(told), 1))
        return RandomEffects(self.values[told], self.sigmas[told] ** 2, design)

    @property
    def mean(self) -> float:
        """Mean of the type."""
        return np.nan if self.of_type is None else float(self.of_type.estimates[0])

    @property
    def sigma(self) -> float:
        """Sigma of the mean."""
        return np.nan if self.of_type is None else float(np.sqrt(self.of_type.covariance[0, 0]))

    @property
    def scatter(self) -> float:
        """Scatter from sensor to sensor, an sd."""
        return np.nan if self.of_type is None else self.of_type.scatter

    def scatter_interval(self, probability: float) -> tuple[float, float]:
        """Interval that holds the scatter with a probability; that of one sensor has no end."""
        if self.of_type is None:
            return np.nan, np.nan
        return self.of_type.scatter_interval(probability) if self.of_type.dof else (0.0, np.inf)

    @property
    def scatter_ci95(self) -> tuple[float, float]:
        """Interval that holds the scatter with a probability of 95 %."""
        return self.scatter_interval(0.95)
