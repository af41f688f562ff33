"""The order in which to take positions in the field."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.design.task import Task
from accelstudy.positions.choice import first_best

Order = NDArray[np.int_]

TOURS = 12
MAX_TOUR_RATIO = 1.15
"""Length, relative to the shortest tour found, up to which a tour that separates drifts better is
taken."""


def field_order(task: Task, directions: Array) -> Order:
    """Order positions (n, 3) for the field.

    The order is a round trip of small turns. The last position is near the first, so a steady
    change with time is not mistaken for an effect of the attitude. Several round trips are tried,
    each with several first positions. The one is taken in which a linear drift of the biases can be
    told best from the parameters of the model.

    Parameters
    ----------
    task : Task
    directions : (n, 3) array of unit vectors
    """
    angles = np.arccos(np.clip(directions @ directions.T, -1, 1))
    rng = np.random.default_rng(np.random.SeedSequence(len(directions)))
    trips = [_round_trip(angles, rng.permutation(len(directions))) for _ in range(TOURS)]
    lengths = np.array([angles[trip, np.roll(trip, -1)].sum() for trip in trips])
    near = np.flatnonzero(lengths <= MAX_TOUR_RATIO * lengths.min() + 1e-9)
    turns = range(len(directions))
    orders = [np.array([np.roll(trips[i], turn) for turn in turns]) for i in near]
    # Tour by tour, so that memory does not follow their number.
    shown = np.concatenate([_drift_shown(task, directions[of_tour]) for of_tour in orders])
    return np.concatenate(orders)[first_best(-shown)]


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


def _drift_shown(task: Task, directions: Array) -> Array:
    """Share of a drift of the biases that the parameters cannot imitate; the smallest axis.

    directions : (k, n, 3) array, of k orders. Returns (k,).
    """
    (k, n), u = directions.shape[:2], len(task.names)
    rows = task.rows(directions.reshape(-1, 3)).reshape(k, n, -1, u)
    effects = [effect.name for effect in task.model.effects for _ in effect.parameters]
    biases = np.flatnonzero(np.array(effects) == "bias")
    drifts = np.linspace(-1.0, 1.0, n)[:, None, None] * rows[..., biases]
    extended = np.concatenate([rows, drifts], axis=-1).reshape(k, -1, u + len(biases))
    extended = extended / np.linalg.norm(extended, axis=1, keepdims=True)
    # The last block of R is what orthogonalisation to the parameters leaves of the drift.
    left = np.linalg.qr(extended).R[:, u:, u:]
    return np.asarray(np.sum(left**2, axis=1).min(axis=1, initial=1.0))
