"""Row order: two holds were exchanged."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Self

import numpy as np

from accelstudy.campaign.format import Campaign
from accelstudy.errors import InputError
from accelstudy.gross_errors.base import GrossError, register
from accelstudy.registry import Hyper

APART = 1.0
"""m/s², by which the forces of positions differ that are drawn to be exchanged."""


@register
class RowOrder(GrossError):
    """The readings of the sensor in two positions are exchanged; all else stays where it was.

    Both positions are drawn if neither is given.
    """

    name = "row_order"
    hypers = (Hyper("first", "1", math.nan), Hyper("second", "1", math.nan))
    equation = "f_j ↔ f_k"

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
        """Exchange the rows of the forces and of their sds."""
        rows = [self.row(campaign, "first"), self.row(campaign, "second")]
        order = np.arange(campaign.n_positions)
        order[rows] = rows[::-1]
        sd = None if campaign.sd is None else campaign.sd[order]
        return replace(campaign, forces=campaign.forces[order], sd=sd)
