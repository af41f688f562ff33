"""When to stop: what the variance of unit weight is taken for when the accuracy is judged.

The positions are chosen by the design, which hardly depends on the readings. So with a **known**
noise the time of stopping is no matter of chance, and the accuracy then is what the covariance
says.

With an **unknown** noise it is one. The recursive residuals, by whose squares Ω grows from
position to position, are independent N(0, σ0²), and independent of the estimate (Brown, Durbin &
Evans 1975, J. R. Stat. Soc. B 37, 149-192). So stopping by them does not bias the estimate, but
it does bias Ω/r: who looks after each position and stops when the accuracy seems good stops when
Ω/r happens to be small. What is used here is an upper confidence bound of the variance, from some
redundancy on. As it is looked at again and again, its level is higher than that of the promise.
By simulation the promise then holds in about 95 % of the sessions or more, whatever is promised
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
"""Of the upper confidence bound of the variance at each look; so that 0.95 holds for all looks."""
LEAST_REDUNDANCY = 5
"""From which on residuals are believed to tell the noise at all."""


def known(omega: ArrayLike, redundancy: int) -> Array:
    """Variance of unit weight where the noise is known: 1."""
    return np.ones(np.shape(omega))


def bound(omega: ArrayLike, redundancy: int) -> Array:
    """Upper confidence bound of the variance of unit weight; infinite with too few residuals."""
    if redundancy < LEAST_REDUNDANCY:
        return np.full(np.shape(omega), np.inf)
    return np.asarray(omega) / special.chdtri(redundancy, LEVEL)


def plain(omega: ArrayLike, redundancy: int) -> Array:
    """Ω/r, with which nobody should stop: here to show what comes of it."""
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
