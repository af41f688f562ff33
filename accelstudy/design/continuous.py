"""The least value of a criterion, from designs with shares instead of whole positions.

A criterion is also a convex function of the shares w, so that its derivatives at any w bound
it (`criteria`). The better the shares, the closer the bound.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.design.criteria import Criterion
from accelstudy.design.newton import settle
from accelstudy.design.spaces import Attitudes
from accelstudy.design.task import Task

SHARED_ATTITUDES, BOUND_ATTITUDES = 600, 6000
"""Number of attitudes that have shares, and of those on which the bound is evaluated."""
ROUNDS = 8
UPDATES = 2000
"""Number of updates of all shares in a round."""
LOWEST = 60
"""Number of attitudes of a grid near which the smallest derivatives are sought."""
MAX_GAP = 1e-4
"""Relative gap between the criterion and its bound at which the search stops."""


@dataclass(frozen=True)
class Continuous:
    """The optimal shares, and what they bound.

    Attributes
    ----------
    directions : (k, 3) array, attitudes with a share
    shares : (k,) array, of sum 1
    value : float, of the criterion for n positions with these shares
    bound : float, lower bound of the criterion for any n positions
    """

    directions: Array
    shares: Array
    value: float
    bound: float


@dataclass(frozen=True)
class _Slope:
    """A linear function of normal matrices."""

    slope: Array

    def value(self, normal: Array) -> Array:
        return np.sum(normal * self.slope, axis=(-2, -1))

    def gradient(self, normal: Array) -> Array:
        return np.broadcast_to(self.slope, normal.shape)


def continuous_optimum(task: Task, criterion: Criterion, allowed: Attitudes, n: int) -> Continuous:
    """Find the best shares for n positions among the attitudes that are allowed."""
    fine, points = allowed.sample(BOUND_ATTITUDES), allowed.sample(SHARED_ATTITUDES)
    fine_flat, flat = _flat(task, fine), _flat(task, points)
    shares, u = np.full(len(points), 1 / len(points)), len(task.names)
    value, bound = np.inf, -np.inf
    for _ in range(ROUNDS):
        shares = _share(task.prior, criterion, flat, shares, n)
        keep = shares > 1e-7 / len(shares)
        points, flat, shares = points[keep], flat[keep], shares[keep] / shares[keep].sum()
        best, normal = (points, shares), task.prior + n * (shares @ flat).reshape(u, u)
        value, slope = float(criterion.value(normal)), criterion.gradient(normal)
        lowest = fine[np.argsort(fine_flat @ slope.ravel(), kind="stable")[:LOWEST]]
        lowest = settle(task, _Slope(slope), allowed, lowest)
        flat_lowest = _flat(task, lowest)
        least = min(float((each @ slope.ravel()).min()) for each in (flat, flat_lowest))
        bound = max(bound, criterion.bound(task.prior, normal, n, least))
        if value - bound < MAX_GAP:
            break
        points, flat = np.concatenate([points, lowest]), np.concatenate([flat, flat_lowest])
        shares = np.concatenate([0.9 * shares, np.full(len(lowest), 0.1 / len(lowest))])
    return Continuous(*best, value, bound)


def _flat(task: Task, directions: Array) -> Array:
    return task.informations(directions).reshape(len(directions), -1)


def _share(prior: Array, criterion: Criterion, flat: Array, shares: Array, n: int) -> Array:
    """Better shares of given attitudes: each grows by the root of what a larger one would gain.

    The multiplicative algorithm of Silvey, Titterington & Torsney (1978). It takes no decisions
    and so carries rounding on as rounding.
    """
    u = len(prior)
    for _ in range(UPDATES):
        normal = prior + n * (shares @ flat).reshape(u, u)
        gain = -flat @ criterion.gradient(normal).ravel()
        shares = shares * np.sqrt(np.maximum(gain, 0.0) / gain.max())
        shares = shares / shares.sum()
    return shares
