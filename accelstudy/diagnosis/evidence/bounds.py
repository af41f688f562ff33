"""The evidence for effects whose parameters physics bounds: a saturation loses gain, and wins none.

The prior of the parameters p is Zellner's, truncated to their bounds B (`accelstudy.effects.base`).
So the density of residuals with the effect changes by the factor

    P(p in B | residuals) / P(p in B),

both under normal distributions. With g the size over the noise that the residuals show, p is
distributed about its least-squares estimate times g/(1 + g) with g/(1 + g) of its covariance C
afterwards, and about zero with g C before.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtr

from accelstudy.basics.arrays import Array
from accelstudy.diagnosis.evidence.size import SIZES, Evidence
from accelstudy.diagnosis.space.hypotheses import Hypothesis

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

    They count as independent: each parameter acts on an axis of its own.
    """
    sigma = np.sqrt(np.diag(covariance))
    a, b = (low - mean) / sigma, (high - mean) / sigma
    # In the upper tail probabilities are differences of numbers near 1: take the lower one.
    sign = np.where(a > 0, -1.0, 1.0)
    return float(np.prod(np.abs(ndtr(sign * b) - ndtr(sign * a))))
