"""Quantiles of replicates, corrected by those of linear theory of the same noise.

The quantile of the same replicates by linear theory is off its known value by nearly as much as
that of the replicates themselves (Hesterberg & Nelson 1998, *Management Science* 44, 1295). A
quantile has no smooth influence; so β and the standard error follow from the share of replicates
that only one of the two has below its quantile, which is told by how far they are apart near it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.study.estimate import MIN_REPLICATES, Estimates

Array = NDArray[np.float64]

LOWER = (1e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.025, 0.05, 0.25)
PROBABILITIES = np.array([*LOWER, 0.5, *(1 - p for p in reversed(LOWER))])
"""Probabilities of the quantiles of a study."""
MEAN_OF_NORMAL = float(np.sqrt(2 / np.pi))
"""Mean absolute value of a standard normal variable."""
MIN_DIFFERENCES = 10
"""Differences from which an sd is taken."""
DIFFERENCE_REPLICATES = 100_000
"""Replicates, the first ones, whose differences tell how far the two are apart."""


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
