"""A parameter of a type of sensors, from sensor to sensor."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from accelstudy.adjustment.random_effects import RandomEffects
from accelstudy.basics.arrays import Array
from accelstudy.basics.units import shown_unit, to_display
from accelstudy.campaign.calibration.figures import SUSPECT
from accelstudy.drawing.style import INK, MISSING, group_colour, group_of, symbol


@dataclass(frozen=True, eq=False)
class TypeParameter:
    """A parameter over the sensors of a lot.

    Attributes
    ----------
    name, unit : str, SI
    stays : bool, whether it belongs to the sensor, and not to its mounting
    values, sigmas : (n,) arrays, of the sensors; NaN where a campaign cannot show it
    usual, has : (n,) bool arrays, whether a sensor is not odd, and whether it has the parameter
    """

    name: str
    unit: str
    stays: bool
    values: Array
    sigmas: Array
    usual: NDArray[np.bool_]
    has: NDArray[np.bool_]

    @cached_property
    def informative(self) -> NDArray[np.bool_]:
        """Usual sensors that have it, of those whose campaigns show it, (n,); all if none has."""
        shown = self.usual & np.isfinite(self.values) & np.isfinite(self.sigmas)
        return shown & self.has if (shown & self.has).any() else shown

    @cached_property
    def of_type(self) -> RandomEffects:
        """Mean and scatter over these sensors; those of one that is not known if there are none."""
        values, sigmas = self.values[self.informative], self.sigmas[self.informative]
        if not len(values):
            values, sigmas = np.full((2, 1), np.nan)
        return RandomEffects(values, sigmas**2, np.ones((len(values), 1)))

    @property
    def mean(self) -> float:
        """Mean of the type."""
        return float(self.of_type.estimates[0])

    @property
    def sigma(self) -> float:
        """Sigma of the mean."""
        return float(np.sqrt(self.of_type.covariance[0, 0]))

    @property
    def scatter(self) -> float:
        """Scatter from sensor to sensor, an sd."""
        return self.of_type.scatter

    @property
    def scatter_ci95(self) -> tuple[float, float]:
        """Interval that holds the scatter with a probability of 95 %; that of one has no end."""
        return self.of_type.scatter_interval(0.95) if self.of_type.dof else (0.0, np.inf)

    @property
    def scatter_below(self) -> float:
        """Bound below which the scatter is with a probability of 90 %; 0 if one sensor tells it."""
        return self.of_type.scatter_below(0.9) if self.of_type.dof else 0.0

    @property
    def in_all(self) -> bool:
        """Whether the next sensor has it, too: all that are usual and calibrated have it."""
        calibrated = self.usual & np.isfinite(self.values)
        n = np.count_nonzero(self.informative & self.has)
        return self.stays and 1 < n == np.count_nonzero(calibrated)

    def draw(self, ax: Axes) -> None:
        """Draw it for each sensor with its interval, the type as a band, and odd sensors."""
        name, unit, strange = self.name, self.unit, ~self.usual
        places = np.arange(1, len(self.values) + 1)
        colour = group_colour(group_of(name))
        each, sigma = (to_display(x, unit) for x in (self.values, self.sigmas))
        mean, scatter = (float(to_display(x, unit)) for x in (self.mean, self.scatter))
        ax.axhspan(mean - 2 * scatter, mean + 2 * scatter, color=MISSING)
        ax.axhline(mean, color=colour, linewidth=0.8)
        ax.axhline(0, color=INK, linewidth=0.8)
        ax.errorbar(places, each, 1.96 * sigma, fmt="o", color=colour, capsize=2)
        ax.plot(places[strange], each[strange], "o", markersize=9, markerfacecolor="none",
                color=SUSPECT)  # fmt: skip
        ax.set_ylabel(f"{symbol(name)} / ({shown_unit(unit)})")
