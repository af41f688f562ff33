"""The evidence for effects whose parameters physics bounds: a saturation loses gain, and wins none.

The prior of the parameters p is Zellner's, truncated to their bounds B (`accelstudy.effects.base`).
So the density of residuals with the effect changes by the factor

    P(p in B | residuals) / P(p in B),

both under normal distributions. With g the size over the noise that the residuals show, p is
distributed about its least-squares estimate times g/(1 + g) with g/(1 + g) of its covariance C
afterwards, and about zero with g C before.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from accelstudy.diagnosis.evidence.size import SIZES, Evidence
from accelstudy.diagnosis.space.hypotheses import Hypothesis

Array = NDArray[np.float64]

NODES = 6
"""Nodes of the integration over each parameter but the last one."""
MIN_PROBABILITY = 1e-300
"""Least probability that is told from none."""


def within_bounds(
    one: Hypothesis, z: Array, evidence: Evidence, beside: Array | None = None
) -> float:
    """Log of the factor by which the bounds of an effect change the density of residuals z (m,).

    It is 0 for an effect without bounds.

    Parameters
    ----------
    one : Hypothesis
    z : (m,) array
    evidence : Evidence
    beside : (m, k) array, orthonormal basis of what is beside it
    """
    if one.estimates is None:
        return 0.0
    others = z[:, None][:, :0] if beside is None else beside
    # What is left of it, and of the residuals, beside the others.
    cross, along = one.basis.T @ others, others.T @ z
    covariance = np.linalg.inv(np.eye(one.dim) - cross @ cross.T)
    seen = one.basis.T @ z - cross @ along
    part = float(along @ along + seen @ covariance @ seen)
    variance = evidence.variance(float(z @ z) - part)
    mean = one.estimates @ covariance @ seen
    covariance = variance * one.estimates @ covariance @ one.estimates.T
    size = max(part / variance, SIZES[0]) / (one.dim + len(along))
    less, bounds = size / (1 + size), one.effect.bounds
    after = box_probability(less * mean, less * covariance, *bounds)
    before = box_probability(0 * mean, size * covariance, *bounds)
    return float(np.log(max(after, MIN_PROBABILITY)) - np.log(max(before, MIN_PROBABILITY)))


def box_probability(mean: Array, covariance: Array, low: float, high: float) -> float:
    """Probability that normal numbers, of mean (d,) and covariance (d, d), are between two bounds.

    One after the other is integrated over, given those before it (Genz 1992, J. Comput. Graph.
    Stat. 1, 141), by Gauss's rule.
    """
    lower, d = np.linalg.cholesky(covariance), len(mean)
    grid, weights = _rule(d - 1)
    share, drawn = np.ones(len(grid)), np.zeros((len(grid), d))
    for i in range(d):
        given = mean[i] + drawn[:, :i] @ lower[i, :i]
        a, b = ((bound - given) / lower[i, i] for bound in (low, high))
        # In the upper tail probabilities are differences of numbers near 1: take the lower one.
        sign = np.where(a > 0, -1.0, 1.0)
        a, b = np.minimum(sign * a, sign * b), np.maximum(sign * a, sign * b)
        below = ndtr(a)
        between = ndtr(b) - below
        share *= between
        if i < d - 1:
            at = np.clip(below + grid[:, i] * between, MIN_PROBABILITY, 1 - 1e-16)
            drawn[:, i] = sign * ndtri(at)
    return float(share @ weights)


@lru_cache
def _rule(d: int) -> tuple[Array, Array]:
    """Gauss's rule for d numbers between 0 and 1: nodes (q, d) and their weights (q,)."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    nodes = np.array([*product((x + 1) / 2, repeat=d)])
    return nodes, np.prod([*product(w / 2, repeat=d)], axis=1)
