"""The budget of a pole: contribution of each source to the error of its foot, by linear theory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from accelstudy.basics.units import GON
from accelstudy.pole.geometry import Situation
from accelstudy.pole.sensor import CalibratedSensor
from accelstudy.pole.setup import Setup
from accelstudy.pole.sources import Source, sources

Array = NDArray[np.float64]

DIRECTIONS = 16
"""Directions into which the pole leans, spread evenly."""
TOTAL = "total"
"""Name of all sources together."""
NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
WIDTH = 9.0
"""Standard deviations beyond which the density is neglected."""
HALVINGS = 40
FLAT = 1e-6
"""No standard deviation is smaller than this part of the larger one, or of the mean error."""


@dataclass(frozen=True)
class Contribution:
    """Errors of the foot in k attitudes, by one source or by all.

    Attributes
    ----------
    covariance : (..., 3, 3) array, m², of north, east and down
    shift : (..., 3) array, m, mean of the error
    """

    covariance: Array
    shift: Array

    @property
    def squares(self) -> Array:
        """Mean squares of the three components, (..., 3), m²."""
        return np.diagonal(self.covariance, axis1=-2, axis2=-1) + self.shift**2

    @property
    def horizontal(self) -> Array:
        """Rms of the horizontal error, m: of north and east together."""
        return np.sqrt(np.sum(self.squares[..., :2], axis=-1))

    @property
    def vertical(self) -> Array:
        """Rms of the vertical error, m."""
        return np.sqrt(self.squares[..., 2])

    @property
    def radius(self) -> Array:
        """Radius that holds the horizontal error with 95 %, m."""
        return radius(self.covariance[..., :2, :2], self.shift[..., :2])


def contribution(source: Source, situation: Situation) -> Contribution:
    """Contribution of a source in the attitudes of a situation."""
    errors = source.errors(situation)
    slope = situation.slope(errors.inputs)
    covariance = slope @ errors.covariance @ np.swapaxes(slope, -2, -1)
    return Contribution(covariance, np.einsum("kim,km->ki", slope, errors.shift))


def together(parts: Sequence[Contribution]) -> Contribution:
    """Sum of independent contributions."""
    return Contribution(
        np.sum([part.covariance for part in parts], axis=0),
        np.sum([part.shift for part in parts], axis=0),
    )


def situation_at(setup: Setup, sensor: CalibratedSensor, tilts: Array) -> Situation:
    """All tilts (rad) in all directions of leaning; the direction varies fastest."""
    around = np.arange(DIRECTIONS) * 2 * np.pi / DIRECTIONS
    return Situation(setup, sensor, np.repeat(tilts, DIRECTIONS), np.tile(around, len(tilts)))


@dataclass(frozen=True)
class Budget:
    """Contributions over tilts and directions of leaning.

    Attributes
    ----------
    setup : Setup
    sensor : CalibratedSensor
    tilts : (t,) array, rad
    directions : (d,) array, rad
    parts : mapping of the name of a source, or `TOTAL`, to its Contribution (t, d)
    """

    setup: Setup
    sensor: CalibratedSensor
    tilts: Array
    directions: Array
    parts: dict[str, Contribution]

    @property
    def total(self) -> Contribution:
        """All sources together."""
        return self.parts[TOTAL]

    def horizontal(self, name: str = TOTAL) -> Array:
        """Rms of the horizontal error over the directions of leaning, (t,), m."""
        return np.sqrt(np.mean(self.parts[name].horizontal ** 2, axis=-1))

    def vertical(self, name: str = TOTAL) -> Array:
        """Rms of the vertical error over the directions of leaning, (t,), m."""
        return np.sqrt(np.mean(self.parts[name].vertical ** 2, axis=-1))

    def table(self) -> pd.DataFrame:
        """One row per tilt, direction and source, in SI; angles are in gon.

        `share` is the part of the mean square of the total horizontal error. The total error lies
        within `radius_95_m` in 95 of 100 cases.
        """
        tilts, directions = np.meshgrid(self.tilts / GON, self.directions / GON, indexing="ij")
        whole = np.maximum(self.total.horizontal**2, np.finfo(float).tiny)
        tables = [
            pd.DataFrame(
                {
                    "tilt_gon": tilts.ravel(),
                    "direction_gon": directions.ravel(),
                    "source": name,
                    "horizontal_m": part.horizontal.ravel(),
                    "vertical_m": part.vertical.ravel(),
                    "share": (part.horizontal**2 / whole).ravel(),
                    "radius_95_m": (self.total.radius if name == TOTAL else np.nan * tilts).ravel(),
                }
            )
            for name, part in self.parts.items()
        ]
        return pd.concat(tables, ignore_index=True)


def budget(setup: Setup, sensor: CalibratedSensor, tilts: Array) -> Budget:
    """Budget of a pole at tilts (t,), rad."""
    situation = situation_at(setup, sensor, tilts)
    parts = {each.name: contribution(each, situation) for each in sources()}
    parts[TOTAL] = together(list(parts.values()))
    shape = (len(tilts), DIRECTIONS)
    return Budget(
        setup,
        sensor,
        tilts,
        situation.direction[:DIRECTIONS],
        {
            name: Contribution(part.covariance.reshape(*shape, 3, 3), part.shift.reshape(*shape, 3))
            for name, part in parts.items()
        },
    )


def radius(covariance: ArrayLike, shift: ArrayLike, probability: float = 0.95) -> Array:
    """Radius of the circle about zero that contains a normal error with a probability.

    Parameters
    ----------
    covariance : (..., 2, 2) array, m²
    shift : (..., 2) array, m, mean of the error
    probability : float

    Returns
    -------
    (...) array, m, to about a millionth
    """
    covariance, shift = np.asarray(covariance, dtype=float), np.asarray(shift, dtype=float)
    variance, axes = np.linalg.eigh(covariance)
    mean = np.einsum("...ji,...j->...i", axes, shift)
    sigma = np.sqrt(np.maximum(variance, 0.0))
    tiny = np.finfo(float).tiny ** 0.25
    major = np.maximum(sigma[..., 1], FLAT * np.linalg.norm(shift, axis=-1) + tiny)
    sigma = np.stack([np.maximum(sigma[..., 0], FLAT * major), major], axis=-1)
    low = np.zeros(shift.shape[:-1])
    high = np.linalg.norm(mean, axis=-1) + WIDTH * np.hypot(sigma[..., 0], sigma[..., 1])
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        inside = _probability(middle, mean, sigma) < probability
        low, high = np.where(inside, middle, low), np.where(inside, high, middle)
    return (low + high) / 2


def _probability(r: Array, mean: Array, sigma: Array) -> Array:
    """Probability of a circle of radius r (...), with the errors along the axes of the ellipse."""
    (mean_1, mean_2), (sigma_1, sigma_2) = np.moveaxis(mean, -1, 0), np.moveaxis(sigma, -1, 0)
    # The larger component is integrated over the angle, which has no singular ends.
    start = np.arcsin(np.clip((mean_2 - WIDTH * sigma_2) / r, -1, 1))
    end = np.arcsin(np.clip((mean_2 + WIDTH * sigma_2) / r, -1, 1))
    angle = ((end + start)[..., None] + (end - start)[..., None] * NODES) / 2
    place, half = r[..., None] * np.sin(angle), r[..., None] * np.cos(angle)
    z = (place - mean_2[..., None]) / sigma_2[..., None]
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi) / sigma_2[..., None] * half
    across = ndtr((half - mean_1[..., None]) / sigma_1[..., None])
    across -= ndtr((-half - mean_1[..., None]) / sigma_1[..., None])
    return np.sum(WEIGHTS * density * across, axis=-1) * (end - start) / 2
