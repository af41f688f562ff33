"""Moving of positions along the sphere until no small move of one makes the criterion better.

All positions move on grids, and a move must gain more than rounding can. So no last digit decides
where the search ends, as it would where a minimum is flat and derivatives are followed: of many
positions there are often endless choices that are equally good.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.criteria import Criterion
from accelstudy.design.spaces import TOLERANCE, Constraints, Space
from accelstudy.design.task import Task
from accelstudy.positions.choice import first_best

Array = NDArray[np.float64]

STEPS = tuple(0.081 / 3.0**k for k in range(5))
"""rad, widths of the grids; from half the distance of the candidates to 0.06 gon."""
FIRST_STEPS = STEPS[:2]
"""They take a fifth of the time, and leave standard deviations that are 0.2 to 0.8 % too large."""
GAIN = 0.1
"""Smallest gain of a move, of the square of the step."""
SWEEPS = 60
"""Most sweeps through all positions on one grid."""
FURTHER = np.array([1.0, 2.0, 4.0, 8.0, 16.0])
"""Times that the moves of two sweeps are repeated at once by all positions, if that is better."""


def refine(
    task: Task,
    criterion: Criterion,
    space: Space,
    constraints: Constraints,
    start: Array,
    steps: Sequence[float] = STEPS,
) -> Array:
    """Improve positions by small moves.

    Parameters
    ----------
    task : Task
    criterion : Criterion
    space : Space, which says how positions can move
    constraints : Constraints, which `start` meets
    start : (n, 3) array of unit vectors
    steps : rad, widths of the grids, one after the other

    Returns
    -------
    (n, 3) array of unit vectors that meets all constraints, no worse than `start`
    """
    if not space.tangents(start).shape[2]:
        return start
    directions = start
    for step in steps:
        directions = _Grid(task, criterion, space, constraints, directions, step).settled()
    return directions


class _Grid:
    """Positions as functions of whole numbers: steps along the tangents at a start."""

    def __init__(
        self,
        task: Task,
        criterion: Criterion,
        space: Space,
        constraints: Constraints,
        start: Array,
        step: float,
    ) -> None:
        self.task, self.criterion, self.constraints = task, criterion, constraints
        self.start, self.tangents = start, step * space.tangents(start)
        self.moves = np.array(list(product((0.0, -1.0, 1.0), repeat=self.tangents.shape[2])))
        self.gain = GAIN * step**2

    def directions(self, t: Array) -> Array:
        """Positions (..., n, 3) after whole steps (..., n, d)."""
        moved = self.start + np.sum(self.tangents * t[..., None, :], axis=-1)
        return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))

    def settled(self) -> Array:
        """Positions of which none gains by a move."""
        t = np.zeros((len(self.start), self.moves.shape[1]))
        before = t
        for _ in range(SWEEPS):
            moved = self._sweep(t)
            if not moved.any():
                break
            t, before = self._further(t + moved, t + moved - before), t + moved
        return self.directions(t)

    def _sweep(self, t: Array) -> Array:
        """Move each position in turn to the best place beside it; the moves, (n, d)."""
        around = self.directions(t + self.moves[:, None, :])
        m, n = around.shape[:2]
        flat = around.reshape(-1, 3)
        informations = self.task.informations(flat).reshape(m, n, *self.task.prior.shape)
        inside = np.all(self.constraints.margins(flat) >= -TOLERANCE, axis=1).reshape(m, n)
        changes = informations - informations[0]
        flat_changes = changes.reshape(m, n, -1)
        normal = self.task.prior + informations[0].sum(axis=0)
        value = float(self.criterion.value(normal))
        taken = np.zeros(n, dtype=int)

        slope = self.criterion.gradient(normal).ravel()
        for i in range(n):
            # A convex criterion cannot fall by more than its derivative says.
            tried = np.flatnonzero(inside[:, i] & (flat_changes[:, i] @ slope < -self.gain))
            if len(tried) and self.constraints.pair is not None:
                others = np.delete(around[taken, np.arange(n)], i, axis=0)
                tried = tried[self.constraints.pair.apart(around[tried, i], others).all(axis=1)]
            if not len(tried):
                continue
            values = self.criterion.value(normal + changes[tried, i])
            best = first_best(values)
            if values[best] < value - self.gain:
                taken[i], value = tried[best], float(values[best])
                normal = normal + changes[taken[i], i]
                slope = self.criterion.gradient(normal).ravel()
        return self.moves[taken]

    def _further(self, t: Array, moved: Array) -> Array:
        """Repeat the last moves of all positions as often as is best."""
        tried = t + np.concatenate([[0.0], FURTHER])[:, None, None] * moved
        directions = self.directions(tried)
        each = self.task.informations(directions.reshape(-1, 3)).reshape(*directions.shape[:2], -1)
        normals = self.task.prior + each.sum(axis=1).reshape(-1, *self.task.prior.shape)
        values = self.criterion.value(normals)
        values[[not self.constraints.kept(u) for u in directions]] = np.inf
        best = first_best(values)
        return np.asarray(tried[best if values[best] < values[0] - self.gain else 0])
