"""Confidence intervals of 95 %: of estimates with their sigmas, and of shares, so many of n.

`scipy.stats` has them too, but every job would take a second longer to import it.
"""

from __future__ import annotations

import math

Z95 = 1.959963984540054
"""Standard deviations on either side that hold 95 % of a normal distribution."""


def sigmas_95(dof: float = math.inf) -> float:
    """Return how many standard deviations on either side hold 95 %.

    A standard deviation with r degrees of freedom is itself uncertain, by 1/√(2r) of it. So it
    takes more of them, by Student's t: 2.13 with r = 15, where 1.96 would hold 93.1 %.

    Parameters
    ----------
    dof : float
        Degrees of freedom of the standard deviation, as the redundancy of the residuals that it was
        estimated from; NaN is returned where there are none. By default it is known.
    """
    if math.isinf(dof):
        return Z95
    from scipy import special  # a job that only draws goes without

    return float(special.stdtrit(dof, 0.975))


def wilson(count: int, n: int) -> tuple[float, float]:
    """Return Wilson's interval of 95 % of a share, low and high, of a count in n."""
    share = count / n
    denominator = 2 * (n + Z95**2)
    middle = (2 * n * share + Z95**2) / denominator
    half = Z95 / denominator * math.sqrt(4 * n * share * (1 - share) + Z95**2)
    return (middle - half if count > 0 else 0.0, middle + half if count < n else 1.0)
