"""Weighted squares whose variances were estimated, each with its own degrees of freedom.

How the true variances compare is not known: the problem of Behrens & Fisher. An estimate that is
small by chance makes the squares large, and its own share in them small; degrees of freedom by
estimated shares (Welch & Satterthwaite) then promise certainty where there is none. So the true
variances are taken as r/χ²(r) times the estimated ones (the generalized p-value of Gamage, Mathew &
Weerahandi 2004, J. Multivar. Anal. 88, 177). The level of a test is kept, or not reached, whatever
the variances are.

The squares are zᵀ P z with a projector P = Σ Aₖ of the rank f, in which Aₖ has the variance k. With
true variances, tₖ times the estimated ones, they are zᵀ (Σ tₖ Aₖ) z. That is taken as a scaled χ²
variable of the same mean and variance, for many t.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy import optimize, special, stats
from scipy.stats import qmc

from accelstudy.basics.arrays import Array

POINTS = 10
"""Binary logarithm of the number of variances that are tried for each estimated one."""
LIMIT_TOLERANCE = 1e-9
"""Relative error of the quantile from which ν follows."""
MANY = 1e9
"""Degrees of freedom from which on they are infinite."""


def true_variances(dof: ArrayLike) -> Array:
    """Variances (n, k) over the estimated ones, evenly in their distributions; 1 where known.

    Parameters
    ----------
    dof : (k,) array, degrees of freedom r of the variances; inf if one was stated
    """
    return _ratios(tuple(map(float, np.ravel(dof))))


@cache
def _ratios(dof: tuple[float, ...]) -> Array:
    """Variances over the estimated ones, (2**POINTS, k); (1, k) if all are known."""
    if np.isinf(dof).all():
        return np.ones((1, len(dof)))
    points = qmc.Sobol(len(dof), scramble=False).random_base2(POINTS) + 0.5 / 2**POINTS
    ratios = np.ones_like(points)
    for k, r in enumerate(dof):
        if np.isfinite(r):
            ratios[:, k] = r / stats.chi2.ppf(points[:, k], r)
    return ratios


def _scaled(true: Array, means: Array, products: Array) -> tuple[Array, Array]:
    """Scale (n,) of χ² and half its degrees of freedom (n,), for true variances (n, k)."""
    mean = true @ means
    scale = np.sum(true @ products * true, axis=1) / mean
    return scale, mean / scale / 2


def _tail(limit: float, scale: Array, half: Array) -> float:
    """Probability that squares are larger than a limit, by what `_scaled` returns."""
    return float(np.mean(special.gammaincc(half, limit / scale / 2)))


def probability_beyond(limit: float, true: Array, means: Array, products: Array) -> float:
    """Probability that squares are larger than a limit.

    Parameters
    ----------
    limit : float
    true : (n, k) array, true variances over the estimated ones
    means : (k,) array, traces of Aₖ
    products : (k, k) array, traces of Aₖ Aₗ
    """
    return _tail(limit, *_scaled(true, means, products))


def dof_of_squares(means: Array, products: Array, dof: Array, level: float) -> float:
    """Degrees of freedom ν of F, where squares have variances that were estimated.

    Parameters
    ----------
    means, products : as of `probability_beyond`
    dof : as of `true_variances`
    level : float, of the quantile that the squares have in common with f times F(f, ν)
    """
    if np.isinf(dof).all():
        return np.inf
    f, true = float(np.sum(means)), true_variances(dof)
    scale, half = _scaled(true, means, products)
    quantiles = 2 * scale * special.gammainccinv(half, level)
    limit = optimize.brentq(
        lambda limit: _tail(limit, scale, half) - level,
        float(quantiles.min()),
        float(quantiles.max()),
        rtol=LIMIT_TOLERANCE,
    )
    nu = float(special.fdtridfd(f, 1 - level, limit / f))
    return nu if nu < MANY else np.inf
