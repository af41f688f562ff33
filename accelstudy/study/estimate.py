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

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array

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
MANY, BINS = 10_000, 4096
"""Numbers from which on they are counted by bins before they are sorted, and these."""
MIN_DIFFERENCES = 10
"""Differences from which an sd is taken."""
DIFFERENCE_REPLICATES = 50_000
"""Replicates, the first ones, whose differences tell how far the two are apart, and whose
quantiles how dense they are."""


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


# --- statistics of numbers (k, R) of R replicates -------------------------------------------------

Value = tuple[Array, Array]
"""Statistics (m,) of replicates, and the influences (m, r) on them of the first r replicates, at
most `MAX_INFLUENCES`."""


def mean(x: Array) -> Value:
    """Mean of each number."""
    value = x.mean(axis=1)
    return value, x[:, :MAX_INFLUENCES] - value[:, None]


@np.errstate(divide="ignore", invalid="ignore")
def sd(x: Array) -> Value:
    """Standard deviation of each number; NaN of a single replicate."""
    value, first = _sd(x), x[:, :MAX_INFLUENCES]
    z = (first - first.mean(axis=1, keepdims=True)) / value[:, None]
    return value, value[:, None] / 2 * (z**2 - 1)


def rms(x: Array) -> Value:
    """Root of the mean square of each number."""
    square, influence = mean(x**2)
    value = np.sqrt(square)
    return value, influence / (2 * value[:, None])


@np.errstate(divide="ignore", invalid="ignore")
def ratio(above: Value, below: Value) -> Value:
    """Ratio of statistics of the same replicates."""
    (above_value, of_above), (below_value, of_below) = above, below
    value = above_value / below_value
    relative = of_above / above_value[:, None] - of_below / below_value[:, None]
    return value, value[:, None] * relative


@np.errstate(divide="ignore", invalid="ignore")
def correlation(x: Array) -> Value:
    """Correlations below the diagonal, in the order of `numpy.tril_indices`."""
    i, j = np.tril_indices(len(x), -1)
    apart = x - x.mean(axis=1, keepdims=True)
    covariance = apart @ apart.T / x.shape[1]
    scale = np.sqrt(np.diagonal(covariance))
    value = covariance[i, j] / (scale[i] * scale[j])
    first = apart[:, :MAX_INFLUENCES] / scale[:, None]
    squares = first[i] ** 2 + first[j] ** 2
    return value, first[i] * first[j] - value[:, None] / 2 * squares


def _sd(x: Array) -> Array:
    """Standard deviation of each row; NaN of a single number."""
    squares = [apart @ apart for apart in (row - row.mean() for row in x)]
    return np.sqrt(np.array(squares) / np.float64(x.shape[1] - 1))


def controlled(
    converged: NDArray[np.bool_], known: Array | float, own: Value, theory: Value | None = None
) -> Estimates:
    """Estimate statistics of replicates, corrected by those of linear theory of the same noise.

    Parameters
    ----------
    converged : (R,) bool array, of which c are true
    known : (m,) array, what linear theory knows the statistics to be; NaN what it does not know
    own : Value, of the calibrations that converged
    theory : Value, of linear theory of all replicates; None without any

    Returns
    -------
    Estimates, (m,)
    """
    n, some = len(converged), converged[:MAX_INFLUENCES]
    with np.errstate(divide="ignore", invalid="ignore"):
        plain, influence = own
        x = np.zeros((len(plain), len(some)))
        x[:, some] = influence[:, : some.sum()] / some.mean()
        alone = _sd(x) / np.sqrt(n)
        if theory is None or n < MIN_REPLICATES:
            return Estimates(plain, alone, np.ones_like(plain), plain)
        expected, y = theory
        x, y = (each - each.mean(axis=1, keepdims=True) for each in (x, y))
        spread = (y * y).sum(axis=1)
        used = np.isfinite(np.broadcast_to(known, spread.shape)) & (spread > 0)
        slope = np.where(used, (x * y).sum(axis=1) / spread, 0.0)
        # Each replicate is off a regression without it by more than off that with it.
        leverage = np.minimum(1 / len(some) + y * y / spread[:, None], HIGHEST_LEVERAGE)
        left = _sd((x - slope[:, None] * y) / (1 - leverage)) / np.sqrt(n)
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
    converged: NDArray[np.bool_],
    known: ArrayLike,
    known_error: ArrayLike,
    own: Array,
    theory: Array | None = None,
) -> Estimates:
    """Estimate quantiles of numbers of replicates.

    Parameters
    ----------
    levels : (k,) array, probabilities
    converged : (R,) bool array, of which c are true
    known : (m, k) array, the quantiles by linear theory; NaN where it does not know them
    known_error : (m, k) array, relative errors of `known`
    own : (m, c) array, numbers of the calibrations that converged
    theory : (m, R) array, the same of linear theory of all replicates; None without any

    Returns
    -------
    Estimates, (m, k)
    """
    p, count, some = levels, own.shape[1], slice(DIFFERENCE_REPLICATES)
    wide = np.minimum(p, 1 - p) / 2
    plain, slope = _quantiles(own, p), _slopes(own[:, some], p, wide)
    # Too few values have no density: their error is unknown.
    variance = p * (1 - p) / count * np.where(count >= MIN_REPLICATES, slope**2, np.nan)
    if count < MIN_REPLICATES or theory is None:
        return Estimates(plain, np.sqrt(variance), np.ones_like(plain), plain)
    failed, linear = len(converged) - count, _quantiles(theory, p)
    paired = theory[:, converged][:, some] if failed else theory[:, some]
    sd = _sd_near(own[:, some] - paired, paired, p, wide)
    with np.errstate(divide="ignore", invalid="ignore"):
        # Share of the replicates that only one of the two has below its quantile.
        apart = MEAN_OF_NORMAL * sd / slope + failed / len(converged)
        agreement = np.nan_to_num(np.clip(1 - apart / (2 * p * (1 - p)), 0.0, 1.0))
        scale = np.where(agreement > 0, slope / _slopes(theory[:, some], p, wide), 0.0)
        corrected = plain - agreement * scale * (linear - np.asarray(known))
        left = variance * (1 - agreement**2)
        if not failed:  # no more than the difference of one replicate
            left = np.minimum(left, sd**2)
        left = left + (np.multiply(known_error, known) * agreement * scale) ** 2
        better = left < variance
        left = np.where(better, left, variance)
        value = np.where(better, corrected, plain)
        return Estimates(value, np.sqrt(left), np.where(better, variance / left, 1.0), plain)


def _quantiles(x: Array, p: Array) -> Array:
    """Quantiles (m, k) of numbers (m, n), as of the slower `numpy.quantile`."""
    place = (x.shape[1] - 1) * p
    below = place.astype(np.intp)
    ends, at = np.unique([below, np.minimum(below + 1, x.shape[1] - 1)], return_inverse=True)
    low, high = np.array([_ordered(row, ends)[at] for row in x]).swapaxes(0, 1)
    return np.asarray(low + (place - below) * (high - low))


def _ordered(x: Array, places: NDArray[np.intp]) -> Array:
    """Numbers (n,) in order, at some places.

    Many numbers are counted by bins, and only those of the bins that have a place are sorted.
    """
    if len(x) < MANY:
        return np.asarray(np.partition(x, places)[places])
    least = x.min()
    bins = ((x - least) * (BINS / ((x.max() - least) or 1.0))).astype(np.int32)
    counts = np.bincount(bins, minlength=BINS + 1)
    at = np.searchsorted(np.cumsum(counts), places, side="right")
    near = np.zeros(BINS + 1, bool)
    near[at] = True
    return np.asarray(np.sort(x[near[bins]])[places - np.cumsum(np.where(near, 0, counts))[at]])


def _slopes(x: Array, p: Array, wide: Array) -> Array:
    """Derivatives (m, k) of the quantiles of numbers (m, n)."""
    low, high = np.split(_quantiles(x, np.concatenate([p - wide, p + wide])), 2, axis=1)
    return (high - low) / (2 * wide)


def _sd_near(differences: Array, theory: Array, p: Array, wide: Array) -> Array:
    """Sd of the differences (m, n) from linear theory near its quantiles, (m, k)."""
    n = theory.shape[1]
    centred = differences - differences.mean(axis=1, keepdims=True)
    ordered = np.take_along_axis(centred, np.argsort(theory), axis=1)
    half = np.maximum(wide * n, MIN_DIFFERENCES / 2)
    first = np.clip(np.floor(p * n - half), 0, n - MIN_DIFFERENCES).astype(int)
    last = np.clip(np.ceil(p * n + half), first + MIN_DIFFERENCES, n).astype(int)
    count = last - first

    def total(numbers: Array) -> Array:
        sums = np.pad(np.cumsum(numbers, axis=1), ((0, 0), (1, 0)))
        return np.asarray(sums[:, last] - sums[:, first])

    squares = total(ordered**2) - total(ordered) ** 2 / count
    return np.sqrt(np.maximum(squares, 0.0) / (count - 1))
