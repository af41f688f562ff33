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


class Statistic(NamedTuple):
    """A statistic of numbers (R, k).

    Attributes
    ----------
    value : function of the numbers; the statistics, (m,)
    influence : function of the numbers and the statistics; the influences, (R, m)
    """

    value: Callable[[Array], Array]
    influence: Callable[[Array, Array], Array]


def _sd(x: Array) -> Array:
    return np.sqrt(((x - x.mean(axis=0)) ** 2).sum(axis=0) / np.float64(len(x) - 1))


def _sd_influence(x: Array, sd: Array) -> Array:
    return np.asarray(((x - x.mean(axis=0)) ** 2 / sd**2 - 1) * sd / 2)


def _pairs(x: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    return np.tril_indices(x.shape[1], -1)


def _correlation(x: Array) -> Array:
    z = (x - x.mean(axis=0)) / x.std(axis=0)
    return np.asarray((z.T @ z / len(z))[_pairs(x)])


def _correlation_influence(x: Array, correlation: Array) -> Array:
    i, j = _pairs(x)
    z = (x - x.mean(axis=0)) / x.std(axis=0)
    return np.asarray(z[:, i] * z[:, j] - correlation * (z[:, i] ** 2 + z[:, j] ** 2) / 2)


def _ratio(x: Array) -> Array:
    sigma, error = np.hsplit(x, 2)
    return np.asarray(sigma.mean(axis=0) / _sd(error))


def _ratio_influence(x: Array, ratio: Array) -> Array:
    sigma, error = np.hsplit(x, 2)
    sd = _sd(error)
    return np.asarray(ratio * (sigma / sigma.mean(axis=0) - 1 - _sd_influence(error, sd) / sd))


MEAN = Statistic(lambda x: np.asarray(x.mean(axis=0)), lambda x, mean: np.asarray(x - mean))
SD = Statistic(_sd, _sd_influence)
ROOT_MEAN = Statistic(
    lambda x: np.sqrt(x.mean(axis=0)), lambda x, root: np.asarray((x - root**2) / (2 * root))
)
"""Root of the mean; the numbers are squares."""
CORRELATION = Statistic(_correlation, _correlation_influence)
"""Correlations below the diagonal, in the order of `numpy.tril_indices`."""
RATIO = Statistic(_ratio, _ratio_influence)
"""Mean of the first half of the columns over the standard deviation of the second."""


def controlled(
    statistic: Statistic,
    own: Array,
    theory: Array | None = None,
    known: Array | float = np.nan,
    converged: NDArray[np.bool_] | None = None,
) -> Estimates:
    """Estimate a statistic of replicates, corrected by that of linear theory of the same noise.

    Parameters
    ----------
    statistic : Statistic
    own : (c, k) array, numbers of the calibrations that converged
    theory : (R, k) array, numbers of linear theory of all R replicates; None without any
    known : (m,) array, the statistics by linear theory; NaN where it does not know them
    converged : (R,) bool array, with c true; by default all are

    Returns
    -------
    Estimates, (m,)
    """
    good = np.ones(len(own), bool) if converged is None else converged
    n, some = len(good), good[:MAX_INFLUENCES]
    with np.errstate(divide="ignore", invalid="ignore"):
        plain = statistic.value(own)
        x = np.zeros((len(some), len(plain)))
        x[some] = statistic.influence(own[: some.sum()], plain) / some.mean()
        alone = _sd(x) / np.sqrt(n)
        if theory is None or n < MIN_REPLICATES:
            return Estimates(plain, alone, np.ones_like(plain), plain)
        expected = statistic.value(theory)
        y = statistic.influence(theory[: len(some)], expected)
        x, y = x - x.mean(axis=0), y - y.mean(axis=0)
        spread = (y * y).sum(axis=0)
        used = np.isfinite(np.broadcast_to(known, spread.shape)) & (spread > 0)
        slope = np.where(used, (x * y).sum(axis=0) / spread, 0.0)
        # Each replicate is off a regression without it by more than off that with it.
        leverage = np.minimum(1 / len(y) + y * y / spread, HIGHEST_LEVERAGE)
        left = np.where(used, _sd((x - slope * y) / (1 - leverage)) / np.sqrt(n), alone)
        error = np.maximum(left, ROUNDING * alone)
        value = plain - np.where(used, slope * (expected - known), 0.0)
        return Estimates(value, error, np.where(used, (alone / error) ** 2, 1.0), plain)
