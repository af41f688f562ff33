"""Statistics of replicates, with linear theory of the same noise as control variate.

Of linear theory any statistic T is known exactly. So that of simulated calibrations is corrected by
how far linear theory of the same noise is from what is known of it (Owen, *Monte Carlo theory,
methods and examples*, ch. 8),

    T(x) − β (T(y) − known T).

What a single replicate does to a statistic is its influence ψ (Hampel 1974, *J. Am. Stat. Assoc.*
69, 383): β is the regression of ψ(x) on ψ(y), and the standard error is the scatter of
ψ(x) − β ψ(y) over √R. Where calibrations fail, x is that of the others and y that of all: T(x) is
then a ratio, and a failed replicate has the influence 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MIN_REPLICATES = 20
"""Replicates from which on a coefficient is estimated; fewer are only averaged."""
MAX_INFLUENCES = 10_000
"""Replicates, the first ones, whose influences tell β and the standard error: to one percent."""
HIGHEST_LEVERAGE = 0.9
ROUNDING = 1e-12
"""Standard errors below this share of those of plain statistics are rounding."""


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
