"""Distribution of the tilt error that calibrations leave, where their errors are normal."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from accelstudy.leveling.error import TiltError

Array = NDArray[np.float64]

DIRECTIONS = 4096
"""Directions over which a share is averaged."""
FROM = (0.9, 0.5, 0.2, 0.02, 0.0)
INEXACT = {True: (1.5e-4, 1.2e-3, 2e-3, 6.5e-3, 0.03), False: (2e-3, 5e-3, 0.01, 0.1, 0.1)}
"""Relative errors of quantiles by their number (rms over the set-ups of the paper's study), from
probabilities of `FROM` on: of the larger of roll and pitch, and of any where there is an offset."""
NEGLIGIBLE = 1e-4
"""Share of the mean square that neglected dimensions have together."""
NODES = 28
"""Nodes of the inverse Laplace transform; its error is below 1e-9."""
CENTRAL = 1e-6
"""Offsets below this share of the mean square count as none."""
STEPS = 40
"""Most steps of the secant method for a quantile."""
LEAST_STEP = 1e-6
"""Shorter ones, of the logarithm of a quantile, do not tell a slope."""
LAST_STEP = 1e-7
"""After a step that is shorter for all quantiles, they are found."""
LENGTHS = 40_001
"""Lengths of which shares are tabulated; between them, shares are right to 1e-8."""


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

    def of(self, cause: str) -> Tilt:
        """Return the tilt that one cause leaves by itself."""
        own = [i for i, each in enumerate(self.causes) if each == cause]
        return Tilt(self.form[:, own][:, :, own], (cause,) * len(own))

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
        """Factor and degrees of freedom, (2,)."""
        return scaled_chi_squared(self.rms**2, 2 * np.sum(self.form**2, axis=(1, 2)))

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


def scaled_chi_squared(mean: Array, variance: Array) -> tuple[Array, Array]:
    """Factor and degrees of freedom of the scaled χ² with a mean and a variance."""
    return variance / (2 * mean), 2 * mean**2 / variance


@dataclass(frozen=True)
class TiltDistribution:
    """The rms over attitudes of the errors of roll and of pitch, and the larger of the two.

    Of normal errors the squares are quadratic forms in u standard normals y. In a fixed direction
    of y, its length has a χ distribution, so that the share below a bound is known; the mean over
    directions that are spread evenly is the share. Where the forms have no offset, the shares of
    roll and pitch by themselves are computed to nine digits by the inverse of a Laplace transform
    (fixed Talbot method; Abate & Valkó 2004), and correct the share of the larger.

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
        """Quantiles of roll, of pitch and of the larger, (3, k), rad.

        They are solved for from those of the scaled χ² of equal mean and variance.
        """
        wanted = scipy.special.ndtri(np.asarray(probabilities, dtype=float))
        forms, linear = self._forms
        variance = 2 * np.einsum("aij,aij->a", forms, forms) + 4 * (linear**2).sum(axis=1)
        factor, freedom = scaled_chi_squared(self.mean_squares[:, None], variance[:, None])
        start = np.sqrt(scipy.special.chdtri(freedom, scipy.special.ndtr(-wanted)) * factor)
        start = np.log(np.vstack([start, start.max(axis=0)]))
        return np.exp(_solved(self._scores, start, wanted))

    def relative_error(self, probabilities: ArrayLike) -> Array:
        """Relative errors of quantiles as of `quantile` by the directions, (3, k)."""
        p = np.asarray(probabilities, dtype=float)
        each = np.select([p >= least for least in FROM], INEXACT[self._central])
        single = np.zeros_like(each) if self._central else each
        return np.stack([single, single, each])

    def _scores(self, at: Array) -> Array:
        """Normal scores of the shares below bounds exp(at) of roll, of pitch and of the larger."""
        roll, pitch, both = np.exp(at)
        if self._central:
            shares = [self._exact(0, roll), self._exact(1, pitch), self._share_of_both(both)]
            return np.asarray(scipy.special.ndtri(shares))
        near, far = self._ends(both)
        larger = np.stack([near.max(axis=0), far.min(axis=0)])
        ends = np.stack([self._ends(roll)[:, 0], self._ends(pitch)[:, 1], larger], axis=1)
        below = self._length(ends[1]) - self._length(ends[0])
        return np.asarray(scipy.special.ndtri(np.maximum(below, 0.0).mean(axis=2)))

    def _share_of_both(self, bounds: Array) -> Array:
        """Share of the larger error that is below bounds (k,), without offset.

        By directions, corrected by what they miss of the shares of roll and pitch by themselves.
        """
        single = self._length(self._ends(bounds)[1])
        both, mean = single.min(axis=0), single.mean(axis=2)
        missed, larger = [self._exact(a, bounds) for a in (0, 1)] - mean, both.mean(axis=1)
        for i, each in enumerate(both):
            apart = single[:, i] - mean[:, i, None]
            slope = np.linalg.lstsq(apart @ apart.T, apart @ (each - larger[i]), rcond=1e-9)[0]
            larger[i] += slope @ missed[:, i]
        return np.clip(larger, 0.0, 1.0)

    def _ends(self, bounds: Array) -> Array:
        """Lengths of y from and to which errors are below bounds (k,): (2, angle, k, direction)."""
        constant, linear, square = (each[:, None] for each in self._along[:3])
        root = linear**2 - square * (constant[..., None] - bounds[:, None] ** 2)
        half = np.sqrt(np.maximum(root, 0.0))
        far = np.where(root > 0, np.maximum((half - linear) / square, 0.0), 0.0)
        return np.stack([np.maximum((-linear - half) / square, 0.0), far])

    @cached_property
    def _forms(self) -> tuple[Array, Array]:
        """H (2, u, u) and g (2, u) of the squared errors constant + 2 g y + y H y."""
        scale = np.sqrt(np.diagonal(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / scale[:, None] / scale)
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        return root.T @ self.tilt.quadratic @ root, self.tilt.linear @ root

    @cached_property
    def _central(self) -> bool:
        """Whether the squared errors have no offset."""
        offset = self.tilt.constant + np.abs(self._forms[1]).sum(axis=1) ** 2 / self.mean_squares
        return bool(np.all(offset < CENTRAL * self.mean_squares))

    @cached_property
    def _along(self) -> tuple[Array, Array, Array, int]:
        """Constant (2,), linear and square (2, d) of the squared error over the length of y, and u.

        Without offset, y has only the dimensions that matter; the others count by their mean.
        """
        forms, linear = self._forms
        if not self._central:
            along = _directions(len(linear[0]))
            return self.tilt.constant, linear @ along.T, _squares(forms, along), len(linear[0])
        both = forms / np.trace(forms, axis1=1, axis2=2)[:, None, None]
        sizes, vectors = np.linalg.eigh(both.sum(axis=0))
        kept = np.cumsum(sizes) > NEGLIGIBLE * sizes.sum()
        rotated = vectors.T @ forms @ vectors
        rest = np.diagonal(rotated, axis1=1, axis2=2)[:, ~kept].sum(axis=1)
        count = int(kept.sum())
        squares = _squares(rotated[:, kept][:, :, kept], _directions(count))
        return rest, np.zeros_like(squares), squares, count

    @property
    def _length(self) -> Callable[[Array], Array]:
        """Share of the lengths of y that are below given ones."""
        return _lengths(self._along[3])

    def _exact(self, angle: int, bounds: Array) -> Array:
        """Share below bounds (k,) of the error of one angle without offset."""
        sizes = np.linalg.eigvalsh(self._forms[0][angle])
        nodes, weights = _talbot()
        p = nodes[:, None] / bounds**2
        transform = 1 / p
        for size in sizes[sizes > np.finfo(float).eps * sizes[-1]]:
            transform /= np.sqrt(1 + 2 * size * p)
        return np.clip((weights @ transform).real / bounds**2, 0.0, 1.0)


def _solved(scores: Callable[[Array], Array], start: Array, wanted: Array) -> Array:
    """Arguments of wanted normal scores.

    By the secant method. A step that leaves the bounds seen so far ends half way between them.
    """
    before, at = start - 0.1, start
    below, slope = scores(before), np.ones_like(start)
    low = np.where(below < wanted, before, -np.inf)
    high = np.where(below > wanted, before, np.inf)
    with np.errstate(invalid="ignore", divide="ignore"):
        for _ in range(STEPS):
            here = scores(at)
            low = np.where(here < wanted, np.maximum(low, at), low)
            high = np.where(here > wanted, np.minimum(high, at), high)
            found = (here - below) / (at - before)
            known = np.isfinite(found) & (found > 0) & (np.abs(at - before) > LEAST_STEP)
            slope = np.where(known, found, slope)
            # Where a share is 0 or 1, the quantile is some way further.
            step = np.where(np.isfinite(here), (wanted - here) / slope, -0.5 * np.sign(here))
            to = at + np.clip(step, -1.0, 1.0)
            half = (low + high) / 2
            to = np.where(((to < low) | (to > high)) & np.isfinite(half), half, to)
            before, below, at = at, here, to
            if np.all(np.abs(at - before) < LAST_STEP):
                break
    return at


def _squares(forms: Array, along: Array) -> Array:
    """Values (2, d) of quadratic forms (2, u, u) in directions (d, u)."""
    values = np.stack([np.einsum("du,du->d", along @ form, along) for form in forms])
    return np.asarray(np.maximum(values, np.finfo(float).tiny))


@cache
def _directions(u: int) -> Array:
    """Directions in u dimensions, (d, u), from points that fill the unit cube evenly.

    They are the points of Roberts' sequence: multiples, modulo 1, of powers of 1/φ, where φ solves
    φ^(u+1) = φ + 1.
    """
    phi = 2.0
    for _ in range(60):
        phi = (1 + phi) ** (1 / (u + 1))
    points = (0.5 + np.outer(np.arange(1, DIRECTIONS + 1), phi ** -np.arange(1.0, u + 1))) % 1
    normal = scipy.special.ndtri(points)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


@cache
def _lengths(u: int) -> Callable[[Array], Array]:
    """The share of standard normals in u dimensions whose length is below given ones."""
    length, step = np.linspace(0.0, np.sqrt(u) + 9.0, LENGTHS, retstep=True)
    below = scipy.special.gammainc(u / 2, length**2 / 2)
    slope = np.append(np.diff(below), 0.0)

    def share(at: Array) -> Array:
        at = np.minimum(at * (1 / step), LENGTHS - 1)
        place = at.astype(np.intp)
        return np.asarray(below[place] + (at - place) * slope[place])

    return share


@cache
def _talbot() -> tuple[Array, Array]:
    """Nodes and weights: f(t) is the real part of Σ weight F(node / t) / t."""
    angle = np.arange(1, NODES) * np.pi / NODES
    cot = 1 / np.tan(angle)
    nodes = 2 * NODES / 5 * np.concatenate([[1.0], angle * (cot + 1j)])
    weights = np.exp(nodes) * np.concatenate([[0.5], 1 + 1j * angle * (1 + cot**2) - 1j * cot])
    return nodes, 2 / 5 * weights
