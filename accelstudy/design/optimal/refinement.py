"""Moving of positions along the sphere until the criterion is stationary."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.optimal.constraints import Constraints
from accelstudy.design.optimal.criteria import Criterion
from accelstudy.design.optimal.spaces import Space
from accelstudy.design.optimal.task import Task

Array = NDArray[np.float64]

STEP = 1e-4
"""rad, of the difference quotients; their error is of the order of its square."""
ROUNDS = 6
"""Number of rounds; each starts from new tangents at the positions."""
ITERATIONS = 60
NEAR = 0.35
"""rad, of which a position moves at most half along each tangent in one round."""


def refine(
    task: Task, criterion: Criterion, space: Space, constraints: Constraints, start: Array
) -> Array:
    """Improve positions by their derivatives.

    Parameters
    ----------
    task : Task
    criterion : Criterion
    space : Space, which says how positions can move
    constraints : Constraints, which `start` meets
    start : (n, 3) array of unit vectors

    Returns
    -------
    (n, 3) array of unit vectors that meets all constraints, no worse than `start`
    """
    best, smallest = start, float(criterion.value(task.normal(start)))
    if not space.tangents(start).shape[2]:
        return start
    for _ in range(ROUNDS):
        found = _round(_Chart(task, criterion, space, best), constraints)
        value = float(criterion.value(task.normal(found)))
        if not constraints.kept(found) or not value < smallest - 1e-10:
            break
        best, smallest = found, value
    return best


class _Chart:
    """Positions as functions of free coordinates: distances along the tangents at a start."""

    def __init__(self, task: Task, criterion: Criterion, space: Space, start: Array) -> None:
        self.task, self.criterion, self.start = task, criterion, start
        self.tangents = space.tangents(start)
        self.shape = self.tangents.shape[::2]

    def directions(self, t: Array) -> Array:
        """Positions (n, 3) at coordinates (n d,)."""
        moved = self.start + np.einsum("nkd,nd->nk", self.tangents, t.reshape(self.shape))
        return np.asarray(moved / np.linalg.norm(moved, axis=1, keepdims=True))

    def around(self, t: Array) -> Array:
        """Positions one step forward and one back in each coordinate, (2, d, n, 3)."""
        d = self.shape[1]
        steps = STEP * np.eye(d)[None, :, None, :] * np.array([-1.0, 1.0])[:, None, None, None]
        return np.array(
            [[self.directions((t.reshape(self.shape) + s).ravel()) for s in side] for side in steps]
        )

    def value_and_gradient(self, t: Array) -> tuple[float, Array]:
        """Criterion and its derivative by the coordinates."""
        n, d = self.shape
        points = np.concatenate([self.directions(t)[None], self.around(t).reshape(2 * d, n, 3)])
        informations = self.task.informations(points.reshape(-1, 3))
        normal = self.task.prior + informations[:n].sum(axis=0)
        by_normal = self.criterion.gradient(normal)
        each = np.einsum("kuw,uw->k", informations[n:], by_normal).reshape(2, d, n)
        return float(self.criterion.value(normal)), ((each[1] - each[0]) / (2 * STEP)).T.ravel()


def _round(chart: _Chart, constraints: Constraints) -> Array:
    from scipy.optimize import minimize  # slow to import

    t = np.zeros(np.prod(chart.shape))
    if not constraints.texts:
        options = {"maxiter": ITERATIONS}
        found = minimize(chart.value_and_gradient, t, jac=True, method="L-BFGS-B", options=options)
        return chart.directions(found.x)
    kept = {
        "type": "ineq",
        "fun": lambda t: _margins(chart, constraints, t),
        "jac": lambda t: _margins_by_coordinates(chart, constraints, t),
    }
    found = minimize(
        chart.value_and_gradient,
        t,
        jac=True,
        method="SLSQP",
        bounds=[(-NEAR / 2, NEAR / 2)] * len(t),
        constraints=[kept],
        options={"maxiter": ITERATIONS},
    )
    return chart.directions(found.x)


def _pairs(chart: _Chart, constraints: Constraints) -> tuple[NDArray[np.int_], ...]:
    """Pairs of positions that may come too near."""
    if constraints.pair is None:
        return (np.zeros(0, dtype=int),) * 2
    cosines = chart.start @ chart.start.T
    return np.nonzero(np.triu(cosines > np.cos(min(constraints.pair.angle + 3 * NEAR, np.pi)), 1))


def _margins(chart: _Chart, constraints: Constraints, t: Array) -> Array:
    """Margins of all constraints, first those of single attitudes."""
    u = chart.directions(t)
    i, j = _pairs(chart, constraints)
    pairs = np.zeros(0)
    if constraints.pair is not None:
        pairs = np.cos(constraints.pair.angle) - np.sum(u[i] * u[j], axis=1)
    return np.concatenate([constraints.margins(u).ravel(), pairs])


def _margins_by_coordinates(chart: _Chart, constraints: Constraints, t: Array) -> Array:
    n, d = chart.shape
    u, (before, behind) = chart.directions(t), chart.around(t)
    slopes = [
        (constraints.margins(b) - constraints.margins(a)) / (2 * STEP)
        for a, b in zip(before, behind, strict=True)
    ]
    single = np.zeros((n, slopes[0].shape[1], n, d))
    for k, slope in enumerate(slopes):
        single[np.arange(n), :, np.arange(n), k] = slope
    i, j = _pairs(chart, constraints)
    pairs = np.zeros((len(i), n, d))
    for k in range(d):
        moved = (behind[k] - before[k]) / (2 * STEP)
        pairs[np.arange(len(i)), i, k] -= np.sum(moved[i] * u[j], axis=1)
        pairs[np.arange(len(i)), j, k] -= np.sum(moved[j] * u[i], axis=1)
    return np.concatenate([single.reshape(-1, n * d), pairs.reshape(-1, n * d)])
