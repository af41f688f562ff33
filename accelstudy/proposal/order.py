"""The order of positions: short ways, and a drift that no parameter can imitate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.design.optimal.criteria import RIDGE
from accelstudy.design.optimal.information import information, position_rows
from accelstudy.design.optimal.task import Task
from accelstudy.positions.choice import first_best
from accelstudy.sensors.models import compose
from accelstudy.simulation.hold_plan import HoldPlan

Array = NDArray[np.float64]
Order = NDArray[np.int_]

TOURS = 12
LONGER = 1.15
"""Length, relative to the shortest tour found, up to which a tour that separates drifts better is
taken."""


def field_order(task: Task, directions: Array, groups: Order | None = None) -> Order:
    """Order positions (n, 3) for the field.

    The order is a round trip of small turns. The last position is near the first, so a steady
    change with time is not mistaken for an effect of the attitude. Several round trips are tried,
    each with several first positions. The one is taken in which a linear drift of the biases can be
    told best from the parameters of the model.

    Parameters
    ----------
    task : Task
    directions : (n, 3) array of unit vectors
    groups : (n,) array, optional
        Positions of one group (mounting) stay together.
    """
    groups = np.zeros(len(directions), dtype=int) if groups is None else groups
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    members = [np.flatnonzero(groups == g) for g in np.unique(groups)]
    rng = np.random.default_rng(np.random.SeedSequence(len(directions)))
    tours: list[tuple[float, Order]] = []
    for _ in range(TOURS):
        parts = [_round_trip(angles, rng.permutation(own)) for own in members]
        tours.append((sum(_length(angles, part) for part in parts), np.concatenate(parts)))
        if len(members) == 1:
            turned = [np.roll(tours[-1][1], shift) for shift in range(1, len(directions))]
            tours += [(tours[-1][0], tour) for tour in turned]
    shortest = min(length for length, _ in tours)
    near = [tour for length, tour in tours if length <= LONGER * shortest + 1e-9]
    shown = [_drift_shown(task, directions[tour]) for tour in near]
    best = max(shown)
    return next(tour for tour, value in zip(near, shown, strict=True) if value > best - 1e-9)


def _length(angles: Array, tour: Order) -> float:
    return float(angles[tour, np.roll(tour, -1)].sum())


def _round_trip(angles: Array, tour: Order) -> Order:
    """Shorten a round trip by reversing parts of it until no reversal shortens it (2-opt)."""
    n, shorter = len(tour), True
    while shorter and n > 3:
        shorter = False
        for i in range(n - 1):
            ahead = np.roll(tour, -1)
            j = np.arange(i + 1, n)
            gain = (
                angles[tour[i], ahead[i]]
                + angles[tour[j], ahead[j]]
                - angles[tour[i], tour[j]]
                - angles[ahead[i], ahead[j]]
            )
            best = first_best(-gain)
            if gain[best] > 1e-9:
                tour = tour.copy()
                tour[i + 1 : j[best] + 1] = tour[i + 1 : j[best] + 1][::-1]
                shorter = True
    return tour


def _drift_shown(task: Task, directions: Array) -> float:
    """Share of a drift of the biases that the parameters cannot imitate; the smallest axis."""
    effects = [effect.spec for effect in task.model.effects]
    model = compose("drifting", (*effects, "bias_drift"))
    n, u = len(directions), task.model.n_parameters
    hold = replace(HoldPlan().hold(n), time=np.linspace(-1.0, 1.0, n))
    known = replace(task.noise, sigma_gravity=0.0)
    rows = position_rows(model, task.approach, known, directions, None, task.gravity, hold)
    normal = information(rows).sum(axis=0)
    normal = normal / np.sqrt(np.outer(np.diag(normal), np.diag(normal)))
    own, cross = normal[u:, u:], normal[:u, u:]
    inside = np.linalg.solve(normal[:u, :u] + RIDGE * np.eye(u), cross)
    return float(np.diag(own - cross.T @ inside).min())
