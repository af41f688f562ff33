"""When to stop: what the variance of unit weight is taken for when the accuracy is judged.

The positions are chosen by the design, which hardly depends on the readings. So with a **known**
noise the time of stopping is not random, and the accuracy is the one that the covariance states.

With an **unknown** noise the time of stopping is random. Ω grows from position to position by the
squares of the recursive residuals. These are independent N(0, σ0²), and independent of the estimate
(Brown, Durbin & Evans 1975, J. R. Stat. Soc. B 37, 149-192). So stopping by them does not bias the
estimate, but it does bias Ω/r: a person who stops when the accuracy seems good stops when Ω/r
happens to be small. Here an upper confidence bound of the variance is used, from a least redundancy
on. It is looked at again and again, so its level is higher than that of the promise. In simulations
the promise then holds in about 95 % of the sessions or more, whatever is promised
(docs/guides/sequential.md).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import special

from accelstudy.basics.errors import UnknownNameError

Array = NDArray[np.float64]

LEVEL = 0.975
"""Level of the upper confidence bound of the variance at each look, for 0.95 over all looks."""
LEAST_REDUNDANCY = 5
"""Least redundancy with which the residuals may state the noise."""


def known(omega: ArrayLike, redundancy: int) -> Array:
    """Variance of unit weight where the noise is known: 1."""
    return np.ones(np.shape(omega))


def bound(omega: ArrayLike, redundancy: int) -> Array:
    """Upper confidence bound of the variance of unit weight; infinite with too few residuals."""
    if redundancy < LEAST_REDUNDANCY:
        return np.full(np.shape(omega), np.inf)
    return np.asarray(omega) / special.chdtri(redundancy, LEVEL)


def plain(omega: ArrayLike, redundancy: int) -> Array:
    """Ω/r. Nobody should stop by it; it is here to show the consequences."""
    if redundancy < 1:
        return np.full(np.shape(omega), np.inf)
    return np.asarray(omega) / redundancy


RULES: dict[str, Callable[[ArrayLike, int], Array]] = {
    "known": known,
    "bound": bound,
    "plain": plain,
}
"""What the variance of unit weight is taken for, by name."""


def get_rule(name: str) -> Callable[[ArrayLike, int], Array]:
    """Return a rule by its name.

    Raises
    ------
    UnknownNameError
        If there is no such rule.
    """
    if name not in RULES:
        raise UnknownNameError("rule", name, RULES)
    return RULES[name]
