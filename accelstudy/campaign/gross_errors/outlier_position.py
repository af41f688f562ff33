"""Outlier: one hold was bumped, or the sensor had not come to rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Self

import numpy as np

from accelstudy.basics.registry import Setting
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.gross_errors.base import SINGLE, GrossError, Mending, register
from accelstudy.campaign.gross_errors.real_sensor import LOST, SHOWS, RealSensor
from accelstudy.campaign.session import Campaign

SIZE = 0.1
"""m/s², size of an error whose direction is drawn."""
PART = 8
"""At most one of so many positions may be bumped; if more are off, something else is wrong."""


@register
class OutlierPosition(GrossError):
    """The mean of one position is wrong by a vector e.

    The position is drawn if it is not given. If no component of e is given, its direction is drawn
    and its size is `SIZE`; if some are given, the others are zero.
    """

    name = "outlier_position"
    takes = (
        Setting("position", "1", math.nan),
        *(Setting(axis, "m/s^2", math.nan) for axis in "xyz"),
    )
    equation = "f + e in one position"
    rank = SINGLE[1]

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw the position, and the direction of e."""
        position = self.settings["position"]
        if self.is_open("position"):
            position = float(rng.choice(campaign.positions))
        if self.is_open(*"xyz"):
            direction = rng.standard_normal(3)
            e = SIZE * direction / np.linalg.norm(direction)
        else:
            e = np.nan_to_num([self.settings[axis] for axis in "xyz"])
        return type(self)(position=position, **dict(zip("xyz", e.tolist(), strict=True)))

    def act(self, campaign: Campaign) -> Campaign:
        """Add e."""
        forces = campaign.forces.copy()
        forces[self.row(campaign, "position")] += [self.settings[axis] for axis in "xyz"]
        return replace(campaign, forces=forces)

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Leave out positions that are so wrong that they would spoil a calibration."""
        far = sensor.wrong & (sensor.distance > LOST * sensor.gravity)
        bumped = tuple(campaign.positions[far].tolist())
        if not sensor.tells or not 0 < len(bumped) <= campaign.n_positions // PART:
            return
        # Far from a usual sensor, and yet all may fit one whose bias or scale no sensor has.
        free = RealSensor.of(campaign, sensor.expected is not None, mounted=True)
        if free.distance.max() < SHOWS * sensor.gravity:
            return
        sizes = comma_list([f"{size:.2g}" for size in sensor.distance[far]])
        reason = f"position {comma_list([str(p) for p in bumped])} is wrong by {sizes} m/s^2"
        if len(bumped) > 1:
            reason = reason.replace("position", "positions", 1).replace(" is ", " are ", 1)
        left = campaign.without(dict.fromkeys(bumped, reason))
        yield Mending(reason, left, left_out=bumped)
