"""A lower bound of a criterion, from designs with shares instead of whole positions.

A convex criterion is also a convex function of the shares w. So its derivatives at any w give a
lower bound for all shares, and for all sets of whole positions. The general equivalence theorem of
Kiefer & Wolfowitz (1960) and Whittle (1973) is the case in which the bound is reached:

    φ(w*) ≥ φ(w) + n (min gⱼ − Σ wᵢ gᵢ),  gⱼ = tr(∂φ/∂N · Iⱼ).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.criteria import Criterion
from accelstudy.design.spaces import Constraints, Space
from accelstudy.design.task import Task

Array = NDArray[np.float64]

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
    """The optimal shares.

    Attributes
    ----------
    directions : (k, 3) array, attitudes with a share
    shares : (k,) array, of sum 1
    value : float, criterion of n positions with these shares
    bound : float, lower bound of the criterion for any n positions
    """

    directions: Array
    shares: Array
    value: float
    bound: float


def continuous_optimum(
    task: Task, criterion: Criterion, space: Space, constraints: Constraints, n: int
) -> Continuous:
    """Find the best shares for n positions among the attitudes that are allowed singly.

    Parameters
    ----------
    task : Task
    criterion : Criterion, convex
    space : Space
    constraints : Constraints; least angles and a number of mountings are ignored, so the bound
        holds with and without them
    n : int
    """
    fine = allowed(space, constraints, BOUND_ATTITUDES)
    fine_flat = _flat(task, fine)
    points = (
        fine if len(fine) <= SHARED_ATTITUDES else allowed(space, constraints, SHARED_ATTITUDES)
    )
    flat, shares = _flat(task, points), np.full(len(points), 1 / len(points))
    u = len(task.names)
    best = Continuous(points, shares, np.inf, -np.inf)
    for _ in range(ROUNDS):
        shares = _share(task.prior, criterion, flat, shares, n)
        keep = shares > 1e-7 / len(shares)
        points, flat, shares = points[keep], flat[keep], shares[keep] / shares[keep].sum()
        normal = task.prior + n * (shares @ flat).reshape(u, u)
        value = float(criterion.value(normal))
        slope = criterion.gradient(normal).ravel()
        here, low = flat @ slope, np.argsort(fine_flat @ slope, kind="stable")[:LOWEST]
        lowest, least = _lowest(task, slope.reshape(u, u), space, constraints, fine[low])
        least = min(least, float(here.min()))
        bound = max(best.bound, value + n * (least - float(shares @ here)))
        best = Continuous(points, shares, value, bound)
        if value - bound < MAX_GAP:
            break
        points = np.concatenate([points, lowest])
        flat = np.concatenate([flat, _flat(task, lowest)])
        shares = np.concatenate([0.9 * shares, np.full(len(lowest), 0.1 / len(lowest))])
    return best


def allowed(space: Space, constraints: Constraints, count: int) -> Array:
    """About `count` allowed attitudes, evenly spread; all of a finite set."""
    attitudes = constraints.keep(space.directions(count))
    if 0 < len(attitudes) < count / 2 and space.tangents(attitudes[:1]).shape[2]:
        attitudes = constraints.keep(space.directions(min(9999, count * count // len(attitudes))))
    return attitudes


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


def _lowest(
    task: Task, gradient: Array, space: Space, constraints: Constraints, points: Array
) -> tuple[Array, float]:
    """Attitudes near given ones where derivatives are smallest, and the smallest derivative."""

    def slopes(directions: Array) -> Array:
        return np.einsum("kuw,uw->k", task.informations(directions), gradient)

    step = np.sqrt(4 * np.pi / BOUND_ATTITUDES)
    for _ in range(12):
        tangents = space.tangents(points)
        if not tangents.shape[2]:
            break
        moves = step * np.concatenate([np.zeros_like(tangents[..., :1]), tangents, -tangents], 2)
        around = np.moveaxis(points[..., None] + moves, 2, 1)
        around = around / np.linalg.norm(around, axis=-1, keepdims=True)
        flat = around.reshape(-1, 3)
        values = np.where(constraints.allow(flat), slopes(flat), np.inf)
        best = np.argmin(values.reshape(around.shape[:2]), axis=1)
        points = around[np.arange(len(points)), best]
        step /= 2
    return points, float(slopes(points).min())
