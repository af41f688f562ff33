"""Small moves of positions, all at once, until none makes a criterion better: Newton's method.

The information Iᵢ of a position is a smooth function of its roll and pitch, so that its derivatives
are differences over a few attitudes around it. With G = ∂φ/∂N those of a criterion φ are

    ∂φ/∂tᵢ = tr(G ∂Iᵢ),   ∂²φ/∂tᵢ∂tⱼ = tr((∂G along ∂Iᵢ) ∂Iⱼ), and tr(G ∂²Iᵢ) more where i = j.

Steps take the eigenvalues of the second derivatives by their size, so that they lead away from
saddles (Dauphin et al. 2014), and none as smaller than a share of the largest. So rounding, which
is all that pulls along equally good sets, does not grow: on each processor the search ends in the
same place, to some 10 digits.

Limits of roll and pitch hold a position that would leave them.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from accelstudy.basics.arrays import Array
from accelstudy.design.spaces import Attitudes, angles_to, directions_at
from accelstudy.design.task import Task
from accelstudy.positions.choice import first_best

WIDTH = 1e-2
"""rad, of the differences."""
AROUND = np.array([(i, j) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)])
NEAR_POLE = 0.05
"""Least cosine of the pitch by which a step across gravity becomes one of the roll."""
MIN_CURVATURE = 1e-2
"""Share of the largest eigenvalue below which none is taken."""
LONGEST = 0.2
"""rad, of a step of one position."""
TRIED = 4.0 ** np.arange(1.0, -5.0, -1.0)
"""Parts of a step that are tried."""
MIN_GAIN = 1e-6
"""Gain of the criterion, a logarithm, below which a step is the last."""
MOST_STEPS = 60


class Objective(Protocol):
    """A function of scaled normal matrices (..., u, u)."""

    def value(self, normal: Array) -> Array:
        """Values, (...)."""

    def gradient(self, normal: Array) -> Array:
        """Derivatives by these matrices, (..., u, u), symmetric."""


def settle(task: Task, objective: Objective, allowed: Attitudes, start: Array) -> Array:
    """Positions (n, 3) near given ones of which no small move makes an objective smaller.

    Those of a finite set stay where they are.
    """
    if allowed.points is not None:
        return start
    low, high = allowed.limits
    n, u = len(start), len(task.names)

    def values(angles: Array) -> Array:
        directions = directions_at(angles)
        each = task.informations(directions.reshape(-1, 3)).reshape(*directions.shape[:2], -1)
        return objective.value(task.prior + each.sum(axis=1).reshape(-1, u, u))

    angles = np.clip(angles_to(start), low, high)
    value = float(values(angles[None])[0])
    for _ in range(MOST_STEPS):
        across = np.ones((n, 2))
        across[:, 0] = 1 / np.maximum(np.abs(np.cos(angles[:, 1])), NEAR_POLE)
        around = directions_at(angles + WIDTH * across * AROUND[:, None])
        slope, curvature = _derivatives(task, objective, around)
        held = (angles <= low) & (slope.reshape(n, 2) > 0)
        held |= (angles >= high) & (slope.reshape(n, 2) < 0)
        free = np.flatnonzero(~held)
        sizes, along = np.linalg.eigh(curvature[np.ix_(free, free)])
        floor = MIN_CURVATURE * np.abs(np.linalg.eigvalsh(curvature)).max()
        step = np.zeros(2 * n)
        step[free] = -along @ (along.T @ slope[free] / np.maximum(np.abs(sizes), floor))
        longest = np.linalg.norm(step.reshape(n, 2), axis=1).max()
        step = step.reshape(n, 2) * across * min(1.0, LONGEST / max(longest, WIDTH))
        tried = np.clip(angles + TRIED[:, None, None] * step, low, high)
        each = values(tried)
        best = first_best(each)
        if not each[best] < value - MIN_GAIN:
            break
        angles, value = tried[best], float(each[best])
    return directions_at(angles)


def _derivatives(task: Task, objective: Objective, around: Array) -> tuple[Array, Array]:
    """Derivatives, (2n,) and (2n, 2n), from directions `AROUND` positions, (9, n, 3)."""
    n, u = around.shape[1], len(task.names)
    each = task.informations(around.reshape(-1, 3)).reshape(3, 3, n, u * u)
    changes = np.stack([each[2, 1] - each[0, 1], each[1, 2] - each[1, 0]], axis=1) / 2
    changes = changes.reshape(2 * n, u, u)
    normal = task.prior + each[1, 1].sum(axis=0).reshape(u, u)
    gradient = objective.gradient(normal)
    ahead, behind = (objective.gradient(normal + sign * changes) for sign in (1, -1))
    flat = changes.reshape(2 * n, -1)
    curvature = (ahead - behind).reshape(2 * n, -1) @ flat.T / 2
    f = each @ gradient.ravel()
    mixed = (f[2, 2] - f[2, 0] - f[0, 2] + f[0, 0]) / 4
    by_roll, by_pitch = f[2, 1] + f[0, 1] - 2 * f[1, 1], f[1, 2] + f[1, 0] - 2 * f[1, 1]
    of_one = np.arange(n)
    curvature.reshape(n, 2, n, 2)[of_one, :, of_one] += np.moveaxis(
        np.array([[by_roll, mixed], [mixed, by_pitch]]), -1, 0
    )
    return flat @ gradient.ravel() / WIDTH, (curvature + curvature.T) / 2 / WIDTH**2
