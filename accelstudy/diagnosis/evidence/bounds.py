"""The evidence for effects whose parameters physics bounds: a saturation loses gain, and wins none.

The prior of the parameters p is Zellner's, truncated to their bounds B (`accelstudy.effects.base`).
So the density of residuals with the effect changes by the factor

    P(p in B | residuals) / P(p in B),

both under normal distributions. With g the size over the noise that the residuals show, p is
distributed about its least-squares estimate times g/(1 + g) with g/(1 + g) of its covariance C
afterwards, and about zero with g C before.
"""

from __future__ import annotations

from collections.abc import Sequence
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
    hypotheses: Sequence[Hypothesis],
    z: Array,
    evidence: Evidence,
    others: Sequence[Array] = (),
) -> Array:
    """Log of the factor by which bounds change the density of residuals z (m,), (s,).

    Parameters
    ----------
    hypotheses : of effects; 0 for those that have no bounds
    z : (m,) array
    evidence : Evidence
    others : (m, k) arrays, orthonormal bases of what is beside each of them, if anything is
    """
    logs, squares = np.zeros(len(hypotheses)), float(z @ z)
    dims = np.array([0 if one.estimates is None else one.dim for one in hypotheses])
    for d in np.unique(dims[dims > 0]):
        alike = np.flatnonzero(dims == d)
        means, covariances, sizes = (np.zeros((len(alike), *[d] * n)) for n in (1, 2, 0))
        for row, i in enumerate(alike.tolist()):
            one = hypotheses[i]
            assert one.estimates is not None
            information, seen, part, dim = np.eye(d), one.basis.T @ z, 0.0, d
            if others:
                # What is left of it, and of the residuals, beside the other one.
                cross, along = one.basis.T @ others[i], others[i].T @ z
                information -= cross @ cross.T
                seen, part, dim = seen - cross @ along, float(along @ along), d + len(along)
            covariance = np.linalg.inv(information)
            part += float(seen @ covariance @ seen)
            variance = evidence.variance(squares - part)
            means[row] = one.estimates @ covariance @ seen
            covariances[row] = variance * one.estimates @ covariance @ one.estimates.T
            sizes[row] = max(part / variance, SIZES[0]) / dim
        first = hypotheses[int(alike[0])].effect
        assert first is not None
        bounds = first.bounds
        less = sizes / (1 + sizes)
        after = box_probability(less[:, None] * means, less[:, None, None] * covariances, *bounds)
        before = box_probability(0 * means, sizes[:, None, None] * covariances, *bounds)
        logs[alike] = np.log(np.maximum(after, MIN_PROBABILITY)) - np.log(
            np.maximum(before, MIN_PROBABILITY)
        )
    return logs


def box_probability(mean: Array, covariance: Array, low: float, high: float) -> Array:
    """Probability that normal numbers are all between two bounds, (s,).

    One after the other is integrated over, given those before it (Genz 1992, J. Comput. Graph.
    Stat. 1, 141), by Gauss's rule.

    Parameters
    ----------
    mean : (s, d) array
    covariance : (s, d, d) array
    low, high : float
    """
    lower, d = np.linalg.cholesky(covariance), mean.shape[1]
    x, w = np.polynomial.legendre.leggauss(NODES)
    grid = np.array([*product((x + 1) / 2, repeat=d - 1)])
    weights = np.prod([*product(w / 2, repeat=d - 1)], axis=1)
    share, drawn = np.ones((len(mean), len(grid))), np.zeros((len(mean), len(grid), d))
    for i in range(d):
        given = mean[:, i, None] + np.einsum("sqj,sj->sq", drawn[..., :i], lower[:, i, :i])
        a, b = ((bound - given) / lower[:, i, i, None] for bound in (low, high))
        # In the upper tail probabilities are differences of numbers near 1: take the lower one.
        sign = np.where(a > 0, -1.0, 1.0)
        a, b = np.minimum(sign * a, sign * b), np.maximum(sign * a, sign * b)
        below = ndtr(a)
        between = ndtr(b) - below
        share *= between
        if i < d - 1:
            at = np.clip(below + grid[:, i] * between, MIN_PROBABILITY, 1 - 1e-16)
            drawn[..., i] = sign * ndtri(at)
    return np.asarray(share @ weights)
