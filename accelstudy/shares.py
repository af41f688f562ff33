"""Intervals of shares that were counted."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

Array = NDArray[np.float64]


def clopper_pearson(count: ArrayLike, n: ArrayLike, level: float = 0.95) -> tuple[Array, Array]:
    """Exact interval of shares, low (...) and high (...), of counts (...) in n (...).

    Where n is 0 nothing is known: from 0 to 1.
    """
    count, n = np.asarray(count, dtype=float), np.asarray(n, dtype=float)
    tail = (1 - level) / 2
    low = special.betaincinv(np.maximum(count, 1), n - count + 1, tail)
    high = special.betainccinv(count + 1, np.maximum(n - count, 1), tail)
    return np.where(count > 0, low, 0.0), np.where(count < n, high, 1.0)
