"""The samples of one static hold, kept as sums, so that its length does not matter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.holds.allan import AllanMoments

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Moments:
    """Number, mean, and products of deviations from the mean of rows of c numbers.

    Attributes
    ----------
    n : int
    mean : (c,) array
    products : (c, c) array, sums over the rows
    """

    n: int
    mean: Array
    products: Array

    @classmethod
    def of(cls, rows: Array) -> Moments:
        """Moments of rows (n, c), n > 0."""
        mean = rows.mean(axis=0)
        centred = rows - mean
        return cls(len(rows), mean, centred.T @ centred)

    def __add__(self, other: Moments) -> Moments:
        """Both parts together (Chan, Golub and LeVeque 1979)."""
        n = self.n + other.n
        step = other.mean - self.mean
        return Moments(
            n,
            self.mean + step * other.n / n,
            self.products + other.products + np.outer(step, step) * self.n * other.n / n,
        )


@dataclass(frozen=True)
class Segment:
    """The samples of one hold.

    Attributes
    ----------
    start, end : int, first sample, and the one after the last
    t0, t1 : float, s, times of the first and of the last sample
    moments : Moments, of time and forces, c = 4, s and m/s²
    conditions : (3, k) array, number, sum and sum of squares of what else was measured
    noise, wobble : tuples of AllanMoments, of the forces, and of their residuals about a straight
        line in time; one for each uninterrupted part
    """

    start: int
    end: int
    t0: float
    t1: float
    moments: Moments
    conditions: Array
    noise: tuple[AllanMoments, ...]
    wobble: tuple[AllanMoments, ...]

    @property
    def n(self) -> int:
        """Number of samples."""
        return self.moments.n

    @property
    def mean(self) -> Array:
        """Mean specific force, (3,), m/s²."""
        return self.moments.mean[1:]

    @property
    def covariance(self) -> Array:
        """Covariance of the samples of the axes, (3, 3), (m/s²)²."""
        return self.moments.products[1:, 1:] / (self.n - 1)

    @property
    def slope(self) -> Array:
        """Slope of the forces over time by least squares, (3,), m/s²/s."""
        return self.moments.products[0, 1:] / self.moments.products[0, 0]

    @property
    def variance(self) -> float:
        """Norm of the variances of the axes, the measure of the detector, (m/s²)²."""
        return float(np.linalg.norm(np.diag(self.covariance)))

    def __add__(self, later: Segment) -> Segment:
        """Both holds as one, without the samples between them."""
        return Segment(
            self.start,
            later.end,
            self.t0,
            later.t1,
            self.moments + later.moments,
            self.conditions + later.conditions,
            self.noise + later.noise,
            self.wobble + later.wobble,
        )
