"""Row order: holds were exchanged."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Setting
from accelstudy.campaign.gross_errors.base import (
    SINGLE,
    Array,
    GrossError,
    Mending,
    register,
    with_readings,
)
from accelstudy.campaign.gross_errors.real_sensor import CLEARLY, LOST, RealSensor
from accelstudy.campaign.session import Campaign

APART = 1.0
"""m/s², smallest difference between the forces of two positions that are drawn to be exchanged."""
LEAST = 0.005
"""Share of gravity by which an exchange of rows must improve the fit."""
SHOWN = 20
"""Largest number of exchanged positions that a message names."""
EXCHANGED = 1000
"""Largest number of rows that are reordered; if more do not fit, their order is not the cause."""


@register
class RowOrder(GrossError):
    """The readings of the sensor in two positions are exchanged; all other columns stay.

    Both positions are drawn if neither is given.
    """

    name = "row_order"
    takes = (Setting("first", "1", math.nan), Setting("second", "1", math.nan))
    equation = "f_j ↔ f_k"
    rank = SINGLE[0]

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw two positions in different attitudes."""
        if not self.is_open("first", "second"):
            if self.is_open("first") or self.is_open("second"):
                raise InputError(f"gross error {self.name!r}: give first and second, or neither")
            return self
        for first in rng.permutation(campaign.n_positions):
            distance = np.linalg.norm(campaign.forces - campaign.forces[first], axis=1)
            others = np.flatnonzero(distance > APART)
            if len(others):
                low, high = sorted(campaign.positions[[first, rng.choice(others)]].tolist())
                return type(self)(first=low, second=high)
        raise InputError(f"gross error {self.name!r}: all positions are in the same attitude")

    def act(self, campaign: Campaign) -> Campaign:
        """Exchange the rows of what the sensor reads."""
        rows = [self.row(campaign, "first"), self.row(campaign, "second")]
        order = np.arange(campaign.n_positions)
        order[rows] = rows[::-1]
        return _ordered(campaign, order)

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Move each row that does not fit to the position where it fits; any number of rows."""
        if sensor.expected is None or not sensor.tells:
            return
        lost = sensor.usual > LOST * sensor.gravity
        wrong = np.flatnonzero(sensor.wrong | lost)
        if not 1 < len(wrong) <= EXCHANGED:
            return
        # Rows in the same attitude could be exchanged at will, so an exchange must gain something.
        least = min(CLEARLY * sensor.usual, LEAST * sensor.gravity)
        cost = campaign.forces[wrong][:, None] - sensor.expected[wrong][None]
        order = np.arange(campaign.n_positions)
        order[wrong] = wrong[_places(np.linalg.norm(cost, axis=2), least)]
        moved = order != np.arange(len(order))
        if moved.any():
            shown = [str(position) for position in campaign.positions[moved][:SHOWN]]
            more = int(moved.sum()) - len(shown)
            positions = ", ".join(shown) + (f" and {more} more" if more else "")
            reason = f"the forces of positions {positions} are exchanged"
            yield Mending(reason, _ordered(campaign, order), changed=moved)


def _ordered(campaign: Campaign, order: NDArray[np.int_]) -> Campaign:
    """Return the campaign with the readings in another order."""
    n_samples = None if campaign.n_samples is None else campaign.n_samples[order]
    return replace(with_readings(campaign, lambda values: values[order]), n_samples=n_samples)


def _places(cost: Array, least: float) -> NDArray[np.int_]:
    """Return the row for each position, (s,): those that fit best, where they do so clearly.

    Parameters
    ----------
    cost : (s, s) array, distance of each row (first index) from what each position should read
    least : float, that an exchange must gain
    """
    stay = np.arange(len(cost))
    total = cost**2 + least**2 * (1 - np.eye(len(cost)))
    if np.array_equal(np.argmin(total, axis=1), stay):
        return stay
    from scipy.optimize import linear_sum_assignment  # slow to import, and seldom needed

    places = linear_sum_assignment(total.T)[1]
    for cycle in _cycles(places):
        after = np.linalg.norm(cost[places[cycle], cycle])
        if np.linalg.norm(cost[cycle, cycle]) < CLEARLY * after:
            places[cycle] = cycle
    return places


def _cycles(places: NDArray[np.int_]) -> list[NDArray[np.int_]]:
    """Positions that exchange their rows among each other."""
    left, cycles = set(range(len(places))), []
    while left:
        cycle = [left.pop()]
        while (following := int(places[cycle[-1]])) in left:
            left.remove(following)
            cycle.append(following)
        cycles.append(np.array(cycle))
    return cycles
