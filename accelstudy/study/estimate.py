"""Statistics of replicates, with linear theory of the same noise as control variate.

Of linear theory any statistic T is known exactly. So that of simulated calibrations is corrected by
how far linear theory of the same noise is from what is known of it (Owen, *Monte Carlo theory,
methods and examples*, ch. 8),

    T(x) − β (T(y) − known T).

What a single replicate does to a statistic is its influence ψ (Hampel 1974, *J. Am. Stat. Assoc.*
69, 383): β is the regression of ψ(x) on ψ(y), and the standard error is the scatter of
ψ(x) − β ψ(y) over √R. Where calibrations fail, x is that of the others and y that of all: T(x) is
then a ratio, and a failed replicate has the influence 0.

The quantile of the same replicates by linear theory is off its known value by nearly as much as
that of the replicates themselves (Hesterberg & Nelson 1998, *Management Science* 44, 1295). A
quantile has no smooth influence; so β and the standard error follow from the share of replicates
that only one of the two has below its quantile, which is told by how far they are apart near it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MIN_REPLICATES = 20
"""Replicates from which on a coefficient is estimated; fewer are only averaged."""
MAX_INFLUENCES = 10_000
"""Replicates, the first ones, whose influences tell β and the standard error: to one percent."""
HIGHEST_LEVERAGE = 0.9
ROUNDING = 1e-12
"""Standard errors below this share of those of plain statistics are rounding."""

LOWER = (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.025, 0.05, 0.25)
PROBABILITIES = np.array([*LOWER, 0.5, *(1 - p for p in reversed(LOWER))])
"""Probabilities of the quantiles of a study."""
MEAN_OF_NORMAL = float(np.sqrt(2 / np.pi))
"""Mean absolute value of a standard normal variable."""
MIN_DIFFERENCES = 10
"""Differences from which an sd is taken."""
DIFFERENCE_REPLICATES = 100_000
"""Replicates, the first ones, whose differences tell how far the two are apart."""


@dataclass(frozen=True)
class Estimates:
    """Estimated numbers.

    Attributes
    ----------
    value : array, the estimates
    error : array, their standard errors by the number of replicates
    gain : array, variance of plain statistics over that of the estimates; 1 without a control
    plain : array, plain statistics of the replicates
    """

    value: Array
    error: Array
    gain: Array
    plain: Array

    def __getitem__(self, chosen: Any) -> Estimates:
        each = (self.value, self.error, self.gain, self.plain)
        return Estimates(*(values[chosen] for values in each))

    def scaled(self, factor: Array | float) -> Estimates:
        """The numbers times known positive factors, of as many as there are factors."""
        value, error, plain = (each * factor for each in (self.value, self.error, self.plain))
        return Estimates(value, error, np.broadcast_to(self.gain, value.shape), plain)


UNKNOWN = Estimates(*np.full(4, np.nan))
"""What nothing is known of; scaling it makes arrays of it."""


@dataclass(frozen=True)
class Sample:
    """Numbers of replicates: their moments, and the first ones themselves.

    Attributes
    ----------
    count : int
    mean : (k,) array
    products : (k, k) array, sums of products of deviations from the mean
    first : (k, r) array, at most `MAX_INFLUENCES`
    """

    count: int
    mean: Array
    products: Array
    first: Array

    @classmethod
    def of(cls, x: Array) -> Sample:
        """Take the moments of numbers (k, R)."""
        mean = x.mean(axis=1) if x.size else np.zeros(len(x))
        apart = x - mean[:, None]
        return cls(x.shape[1], mean, apart @ apart.T, x[:, :MAX_INFLUENCES])

    def __getitem__(self, rows: slice) -> Sample:
        return Sample(self.count, self.mean[rows], self.products[rows, rows], self.first[rows])

    def __add__(self, more: Sample) -> Sample:
        """Join with a sample that follows (Chan, Golub & LeVeque 1983, *Am. Stat.* 37, 242)."""
        count, step = self.count + more.count, more.mean - self.mean
        share = more.count / max(count, 1)
        products = self.products + more.products + self.count * share * np.outer(step, step)
        return Sample(count, self.mean + share * step, products, self.first)

    @property
    def sd(self) -> Array:
        """Standard deviations, (k,)."""
        return np.sqrt(np.diagonal(self.products) / np.float64(self.count - 1))


class Statistic(NamedTuple):
    """A statistic of numbers of replicates.

    Attributes
    ----------
    value : function of the sample; the statistics, (m,)
    influence : function of numbers (R, k) and the statistics; the influences, (R, m)
    """

    value: Callable[[Sample], Array]
    influence: Callable[[Array, Array], Array]


def _sd_influence(x: Array, sd: Array) -> Array:
    return np.asarray(((x - x.mean(axis=0)) ** 2 / sd**2 - 1) * sd / 2)


def _correlation(sample: Sample) -> Array:
    scale = np.sqrt(np.diagonal(sample.products))
    return (sample.products / np.outer(scale, scale))[np.tril_indices(len(scale), -1)]


def _correlation_influence(x: Array, correlation: Array) -> Array:
    i, j = np.tril_indices(x.shape[1], -1)
    z = (x - x.mean(axis=0)) / x.std(axis=0)
    return np.asarray(z[:, i] * z[:, j] - correlation * (z[:, i] ** 2 + z[:, j] ** 2) / 2)


def _ratio(sample: Sample) -> Array:
    sigma, _ = np.split(sample.mean, 2)
    return np.asarray(sigma / np.split(sample.sd, 2)[1])


def _ratio_influence(x: Array, ratio: Array) -> Array:
    sigma, error = np.hsplit(x, 2)
    sd = Sample.of(error.T).sd
    return np.asarray(ratio * (sigma / sigma.mean(axis=0) - 1 - _sd_influence(error, sd) / sd))


MEAN = Statistic(lambda sample: sample.mean, lambda x, mean: np.asarray(x - mean))
SD = Statistic(lambda sample: sample.sd, _sd_influence)
ROOT_MEAN = Statistic(
    lambda sample: np.sqrt(sample.mean), lambda x, root: np.asarray((x - root**2) / (2 * root))
)
"""Root of the mean; the numbers are squares."""
CORRELATION = Statistic(_correlation, _correlation_influence)
"""Correlations below the diagonal, in the order of `numpy.tril_indices`."""
RATIO = Statistic(_ratio, _ratio_influence)
"""Mean of the first half of the columns over the standard deviation of the second."""


def controlled(
    statistic: Statistic,
    own: Sample,
    theory: Sample | None = None,
    known: Array | float = np.nan,
    converged: NDArray[np.bool_] | None = None,
) -> Estimates:
    """Estimate a statistic of replicates, corrected by that of linear theory of the same noise.

    Parameters
    ----------
    statistic : Statistic
    own : Sample, numbers of the calibrations that converged
    theory : Sample, numbers of linear theory of all R replicates; None without any
    known : (m,) array, the statistics by linear theory; NaN where it does not know them
    converged : (R,) bool array, with as many true as converged; by default all are

    Returns
    -------
    Estimates, (m,)
    """
    n = own.count if converged is None else len(converged)
    some = np.ones(own.first.shape[1], bool) if converged is None else converged[:MAX_INFLUENCES]
    with np.errstate(divide="ignore", invalid="ignore"):
        plain = statistic.value(own)
        x = np.zeros((len(some), len(plain)))
        x[some] = statistic.influence(own.first[:, : some.sum()].T, plain) / some.mean()
        alone = Sample.of(x.T).sd / np.sqrt(n)
        if theory is None or n < MIN_REPLICATES:
            return Estimates(plain, alone, np.ones_like(plain), plain)
        expected = statistic.value(theory)
        y = statistic.influence(theory.first.T, expected)
        x, y = x - x.mean(axis=0), y - y.mean(axis=0)
        spread = (y * y).sum(axis=0)
        used = np.isfinite(np.broadcast_to(known, spread.shape)) & (spread > 0)
        slope = np.where(used, (x * y).sum(axis=0) / spread, 0.0)
        # Each replicate is off a regression without it by more than off that with it.
        leverage = np.minimum(1 / len(y) + y * y / spread, HIGHEST_LEVERAGE)
        left = Sample.of(((x - slope * y) / (1 - leverage)).T).sd / np.sqrt(n)
        error = np.maximum(np.where(used, left, alone), ROUNDING * alone)
        value = plain - np.where(used, slope * (expected - known), 0.0)
        return Estimates(value, error, np.where(used, (alone / error) ** 2, 1.0), plain)


# --- quantiles ------------------------------------------------------------------------------------


def usual_levels(count: int) -> Array:
    """Select the `PROBABILITIES` whose quantiles so many replicates have."""
    tail = np.minimum(PROBABILITIES, 1 - PROBABILITIES)
    return PROBABILITIES[(tail >= 0.0249) | (count * tail >= 0.999)]


def controlled_quantiles(
    levels: Array,
    own: Array,
    theory: Array | None = None,
    known: Array | None = None,
    converged: NDArray[np.bool_] | None = None,
    known_error: ArrayLike = 0.0,
) -> Estimates:
    """Estimate quantiles of a number of each replicate.

    Parameters
    ----------
    levels : (k,) array, probabilities
    own : (c,) array, the number in the calibrations that converged
    theory : (R,) array, the number in linear theory of all R replicates; None without any
    known : (k,) array, its quantiles; NaN where they are not known
    converged : (R,) bool array, with c true; by default all are
    known_error : (k,) array, relative errors of `known`

    Returns
    -------
    Estimates, (k,)
    """
    p, count = levels, len(own)
    wide = np.minimum(p, 1 - p) / 2
    plain, low, high = _quantiles(own, p, wide)
    slope = (high - low) / (2 * wide)
    # Too few values have no density: their error is unknown.
    variance = p * (1 - p) / count * (slope**2 if count >= MIN_REPLICATES else np.nan)
    if count < MIN_REPLICATES or theory is None or known is None or not np.isfinite(known).all():
        return Estimates(plain, np.sqrt(variance), np.ones(len(p)), plain)
    failed = len(theory) - count
    paired = theory[converged] if failed else theory
    linear, low, high = _quantiles(theory, p, wide)
    some = slice(DIFFERENCE_REPLICATES)
    sd = _sd_near(own[some] - paired[some], paired[some], p, wide)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Share of the replicates that only one of the two has below its quantile.
        apart = MEAN_OF_NORMAL * sd / slope + failed / len(theory)
        agreement = np.nan_to_num(np.clip(1 - apart / (2 * p * (1 - p)), 0.0, 1.0))
        scale = np.where(agreement > 0, slope * 2 * wide / (high - low), 0.0)
        corrected = plain - agreement * scale * (linear - known)
        left = variance * (1 - agreement**2)
        if not failed:  # no more than the difference of one replicate
            left = np.minimum(left, sd**2)
        left = left + (np.asarray(known_error) * known * agreement * scale) ** 2
        better = left < variance
        left = np.where(better, left, variance)
        value = np.where(better, corrected, plain)
        return Estimates(value, np.sqrt(left), variance / left, plain)


def _quantiles(x: Array, p: Array, wide: Array) -> Array:
    """Quantiles at p, p − wide and p + wide, (3, k); a sort is faster than `numpy.quantile`."""
    ordered, place = np.sort(x), (len(x) - 1) * np.array([p, p - wide, p + wide])
    below = place.astype(int)
    low, high = ordered[below], ordered[np.minimum(below + 1, len(x) - 1)]
    return np.asarray(low + (place - below) * (high - low))


def _sd_near(differences: Array, theory: Array, p: Array, wide: Array) -> Array:
    """Sd of the differences from linear theory near its quantiles, (k,)."""
    n = len(theory)
    ordered = (differences - differences.mean())[np.argsort(theory)]
    sums = np.vstack([np.zeros(2), np.cumsum([ordered, ordered**2], axis=1).T])
    half = np.maximum(wide * n, MIN_DIFFERENCES / 2)
    first = np.clip(np.floor(p * n - half), 0, n - MIN_DIFFERENCES).astype(int)
    last = np.clip(np.ceil(p * n + half), first + MIN_DIFFERENCES, n).astype(int)
    total, square = (sums[last] - sums[first]).T
    count = last - first
    return np.sqrt(np.maximum(square - total**2 / count, 0.0) / (count - 1))
