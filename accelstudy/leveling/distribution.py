"""Distribution of the tilt error that calibrations leave, where their errors are normal."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.leveling.error import TiltError

FROM = (0.9, 0.5, 0.2, 0.02, 0.0)
INEXACT = {True: (5e-4, 2e-3, 6e-3, 0.02, 0.08), False: (4e-3, 0.015, 0.02, np.inf, np.inf)}
"""Relative errors of quantiles by their number (rms over the set-ups of the paper's study), from
probabilities of `FROM` on: of the larger of roll and pitch, and of any where there is an offset.
Small errors beside an offset are not known."""
NODES = 28
"""Nodes of the inverse Laplace transform; its error is below 1e-9."""
CENTRAL = 1e-6
"""Offsets below this share of the mean square count as none."""
SQUARES = np.geomspace(1e-7, 60.0, 700)
"""Squares, relative to the mean ones, between which shares are interpolated, to 3e-5."""
ROUNDING = 1e-12
"""Shares that are nearer to 0 or 1 are not told apart."""
NOISE = "noise"
STEPS_OF_BOTH = 17
"""Errors at which the share of calibrations below is computed, to interpolate between."""


@dataclass(frozen=True)
class Tilt:
    """Tilt error that calibrations leave on average, of normal errors about the truth.

    A mean square is a weighted sum of χ² variables, approximated by a scaled χ² of the same mean
    and variance.

    Attributes
    ----------
    form : (2, s, s) array, rad², mean squares over attitudes of the errors of roll and of pitch, as
        quadratic forms of s independent standard normal variables
    causes : tuple of str, of these variables: `NOISE`, or a neglected effect
    """

    form: Array
    causes: tuple[str, ...]

    def with_noise(self, factor: float) -> Tilt:
        """Return the tilt with the noise of all observations multiplied by a factor."""
        factors = np.array([factor if cause == NOISE else 1.0 for cause in self.causes])
        return replace(self, form=self.form * np.outer(factors, factors))

    @cached_property
    def squares(self) -> dict[str, Array]:
        """Mean square of the errors of roll and of pitch, (2,), rad², by each cause."""
        each = np.maximum(np.diagonal(self.form, axis1=1, axis2=2), 0.0)  # rounding of zero
        causes = np.array(self.causes)
        return {c: each[:, causes == c].sum(axis=1) for c in dict.fromkeys(self.causes)}

    @cached_property
    def rms(self) -> Array:
        """Rms over attitudes, calibrations and sensors, (2,), rad."""
        return np.sqrt(np.trace(self.form, axis1=1, axis2=2))

    @cached_property
    def _chi_squared(self) -> tuple[Array, Array]:
        """Factor and degrees of freedom of the scaled χ², (2,)."""
        mean, variance = self.rms**2, 2 * np.sum(self.form**2, axis=(1, 2))
        return variance / (2 * mean), 2 * mean**2 / variance

    def quantile(self, probability: float) -> Array:
        """Error of each angle by itself that this share of the calibrations stays below, (2,)."""
        factor, freedom = self._chi_squared
        return np.sqrt(factor * scipy.special.chdtri(freedom, 1 - probability))

    def quantile_of_both(self, probability: float) -> float:
        """Error that roll and pitch both stay below in this share of the calibrations, rad.

        The mean squares of the two angles are taken to be independent: their correlation is 0.1 at
        most, up to tilts of 80 gon.
        """
        factor, freedom = self._chi_squared
        ends = [self.quantile(p).max() for p in (probability, (1 + probability) / 2)]
        squares = np.linspace(ends[0] ** 2, ends[1] ** 2, STEPS_OF_BOTH)[:, None]
        both = scipy.special.chdtr(freedom, squares / factor).prod(axis=1)
        return float(np.sqrt(np.interp(probability, both, squares[:, 0])))


@dataclass(frozen=True)
class TiltDistribution:
    """The rms over attitudes of the errors of roll and of pitch, and the larger of the two.

    Of normal errors the squares are quadratic forms in standard normals y. Where they have no
    offset, the share below a bound is the inverse of a known Laplace transform (fixed Talbot
    method; Abate & Valkó 2004). An offset makes them narrow, and a χ² of the same mean, variance
    and skewness has that share nearly (Pearson 1959, Biometrika 46, 364). Both angles at once have
    a normal copula, with the correlation of their squares, which is 0.2 at most.

    Parameters
    ----------
    tilt : TiltError, about the mean of the estimates
    covariance : (u, u) array, of the estimates
    """

    tilt: TiltError
    covariance: Array

    @cached_property
    def mean_squares(self) -> Array:
        """Mean of the squared errors of roll and of pitch, (2,), rad²."""
        spread = np.einsum("auw,uw->a", self.tilt.quadratic, self.covariance)
        return self.tilt.constant + spread

    def quantile(self, probabilities: ArrayLike) -> Array:
        """Quantiles of roll, of pitch and of the larger, (3, k), rad."""
        low, high = self.mean_squares.min(), self.mean_squares.max()
        squares = np.unique(np.concatenate([low * SQUARES, high * SQUARES]))
        roll, pitch = (self._share(angle, squares) for angle in (0, 1))
        both = roll * pitch + _dependence(roll, pitch, self._correlation)
        wanted, at = scipy.special.ndtri(np.asarray(probabilities, dtype=float)), np.log(squares)
        scores = scipy.special.ndtri(_increasing([roll, pitch, both]))
        return np.exp([np.interp(wanted, each, at) / 2 for each in scores])

    def relative_error(self, probabilities: ArrayLike) -> Array:
        """Relative errors of quantiles as of `quantile`, (3, k)."""
        p = np.asarray(probabilities, dtype=float)
        each = np.select([p >= least for least in FROM], INEXACT[self._central])
        single = np.zeros_like(each) if self._central else each
        return np.stack([single, single, each])

    def _share(self, angle: int, squares: Array) -> Array:
        """Share of the squared errors of one angle that is below given ones, ascending, (k,)."""
        if self._central:
            return _increasing(_sum_of_squares(np.linalg.eigvalsh(self._forms[0][angle]), squares))
        form, linear = (each[angle] for each in self._forms)
        variance = self._covariances[angle, angle]
        third = 8 * np.trace(form @ form @ form) + 24 * linear @ form @ linear
        freedom = 8 * variance**3 / third**2
        apart = (squares - self.mean_squares[angle]) * np.sqrt(2 * freedom / variance)
        return _increasing(scipy.special.chdtr(freedom, np.maximum(freedom + apart, 0.0)))

    @cached_property
    def _forms(self) -> tuple[Array, Array]:
        """H (2, u, u) and g (2, u) of the squared errors constant + 2 g y + y H y."""
        scale = np.sqrt(np.diagonal(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / scale[:, None] / scale)
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        return root.T @ self.tilt.quadratic @ root, self.tilt.linear @ root

    @cached_property
    def _covariances(self) -> Array:
        """Covariances of the squared errors of roll and of pitch, (2, 2)."""
        forms, linear = self._forms
        return np.asarray(2 * np.einsum("aij,bij->ab", forms, forms) + 4 * linear @ linear.T)

    @property
    def _correlation(self) -> float:
        (roll, across), (_, pitch) = self._covariances
        return float(across / np.sqrt(roll * pitch))

    @cached_property
    def _central(self) -> bool:
        """Whether the squared errors have no offset."""
        offset = self.tilt.constant + np.abs(self._forms[1]).sum(axis=1) ** 2 / self.mean_squares
        return bool(np.all(offset < CENTRAL * self.mean_squares))


def _dependence(roll: Array, pitch: Array, correlation: float) -> Array:
    """By how much the share of both exceeds the product of shares, of a normal copula.

    It is the integral of the normal density over the correlation (Plackett 1954).
    """
    x, y = scipy.special.ndtri(roll), scipy.special.ndtri(pitch)
    nodes, weights = np.polynomial.legendre.leggauss(6)
    r = correlation * (1 + nodes[:, None]) / 2
    density = np.exp(-(x * x - 2 * r * x * y + y * y) / (2 * (1 - r * r))) / np.sqrt(1 - r * r)
    return np.asarray(correlation / 2 * weights @ density / (2 * np.pi))


def _increasing(shares: ArrayLike) -> Array:
    """Shares (..., k) of ascending bounds, free of rounding and of 0 and 1."""
    clipped = np.clip(shares, ROUNDING, 1 - ROUNDING)
    return np.asarray(np.maximum.accumulate(clipped, axis=-1))


def _sum_of_squares(sizes: Array, bounds: Array) -> Array:
    """Share of Σ sizeᵢ yᵢ², of standard normals y, that is below bounds (k,)."""
    angle = np.arange(1, NODES) * np.pi / NODES
    cot = 1 / np.tan(angle)
    nodes = 2 * NODES / 5 * np.concatenate([[1.0], angle * (cot + 1j)])
    weights = np.exp(nodes) * np.concatenate([[0.5], 1 + 1j * angle * (1 + cot**2) - 1j * cot])
    p = nodes[:, None] / bounds
    transform = 1 / p
    for size in sizes[sizes > np.finfo(float).eps * sizes[-1]]:
        transform /= np.sqrt(1 + 2 * size * p)
    return np.asarray(2 / 5 * (weights @ transform).real / bounds)
