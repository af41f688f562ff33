"""Choices that rounding does not make: what is equal but for the last digits keeps its order."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

CRITERION_TOLERANCE = 1e-9
"""Difference up to which two values are equal, of criteria that are logarithms."""


def first_best(values: ArrayLike, tied: float = CRITERION_TOLERANCE) -> int:
    """Index of the first value that is as small as the smallest one; NaN is no value.

    On another processor the last digits of a number differ. Of candidates that are equally good,
    as those of a symmetric set are, the smallest value would then be another one.
    """
    values = np.asarray(values)
    return int(np.flatnonzero(values <= np.fmin.reduce(values) + tied)[0])


def stable_order(values: ArrayLike, tied: float = CRITERION_TOLERANCE) -> NDArray[np.int_]:
    """Indices from the smallest value to the largest; those of equal values as they stand."""
    values = np.asarray(values)
    order = np.argsort(values, kind="stable")
    ascending = values[order]
    larger = ascending[1:] > ascending[:-1] + tied
    return order[np.lexsort((order, np.concatenate([[0], np.cumsum(larger)])))]
