"""Outlier: one hold was bumped, or the sensor had not come to rest."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Self

import numpy as np

from accelstudy.campaign.format import Campaign
from accelstudy.gross_errors.base import GrossError, register
from accelstudy.registry import Hyper

SIZE = 0.1
"""m/s², of an error that is drawn."""


@register
class OutlierPosition(GrossError):
    """The mean of one position is wrong by a vector e.

    The position is drawn if it is not given, and so is the direction of e, of `SIZE`, if none of
    its components is; those that are missing beside others are zero.
    """

    name = "outlier_position"
    hypers = (
        Hyper("position", "1", math.nan),
        *(Hyper(axis, "m/s^2", math.nan) for axis in "xyz"),
    )
    equation = "f + e in one position"

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw the position, and the direction of e."""
        position = self.shape["position"]
        if self.is_open("position"):
            position = float(rng.choice(campaign.positions))
        if self.is_open(*"xyz"):
            direction = rng.standard_normal(3)
            e = SIZE * direction / np.linalg.norm(direction)
        else:
            e = np.nan_to_num([self.shape[axis] for axis in "xyz"])
        return type(self)(position=position, **dict(zip("xyz", e.tolist(), strict=True)))

    def act(self, campaign: Campaign) -> Campaign:
        """Add e."""
        forces = campaign.forces.copy()
        forces[self.row(campaign, "position")] += [self.shape[axis] for axis in "xyz"]
        return replace(campaign, forces=forces)
