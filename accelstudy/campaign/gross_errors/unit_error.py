"""Unit error: numbers are in another unit than the file says."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any, Self

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Setting
from accelstudy.basics.units import ROBOT_UNITS, SENSOR_UNITS, UNITS
from accelstudy.campaign.gross_errors.base import (
    EVERYWHERE,
    GrossError,
    Mending,
    register,
    with_readings,
)
from accelstudy.campaign.gross_errors.real_sensor import RealSensor
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import usual_norm
from accelstudy.sensors.plausibility import LARGEST

NEAR = 1 - LARGEST["scale"]
"""Share of gravity that even a bad sensor reads in the right unit."""


@register
class UnitError(GrossError):
    """The numbers of the forces, or of the robot's angles, are wrong by a factor.

    One of the usual mistakes is drawn if no factor is given: forces in g in a column of m/s²
    (1/9.80665), degrees (0.9) or radians (π/200) in a column of gon.
    """

    name = "unit_error"
    takes = (Setting("force", "1", math.nan, above=0), Setting("angle", "1", math.nan, above=0))
    equation = "f → factor · f, or (φ, θ) → factor · (φ, θ)"
    rank = EVERYWHERE

    def drawn(self, campaign: Campaign, rng: np.random.Generator) -> Self:
        """Draw one of the usual mistakes."""
        if not self.is_open("force", "angle"):
            return self
        possible = [{"force": 1 / UNITS["m/s^2"]["g"]}]
        if campaign.angles is not None:
            possible += [{"angle": 1 / factor} for factor in _other_angles().values()]
        return type(self)(**possible[rng.integers(len(possible))])

    def act(self, campaign: Campaign) -> Campaign:
        """Multiply by the factors that are given."""
        if not self.is_open("angle"):
            if campaign.angles is None:
                raise InputError(f"gross error {self.name!r}: angle: {campaign.name} has no angles")
            campaign = _angles_times(campaign, self.settings["angle"])
        if not self.is_open("force"):
            campaign = _forces_times(campaign, self.settings["force"])
        return campaign

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Convert the forces, or the angles, as if they were in another unit."""
        norm = usual_norm(campaign.forces) / campaign.gravity
        own = campaign.unit if campaign.unit in SENSOR_UNITS else "m/s^2"
        for stated in (own, "g" if own == "m/s^2" else "m/s^2"):
            for unit, factor in _other_units("m/s^2", SENSOR_UNITS, stated).items():
                if NEAR < factor * norm < 1 / NEAR:
                    instead = "" if stated == "m/s^2" else f", not in {stated}"
                    reason = f"the forces are in {unit}{instead}"
                    yield Mending(reason, _forces_times(campaign, factor), factor * np.eye(3))
        if sensor.expected is not None:
            for unit, factor in _other_angles().items():
                reason = f"the robot's angles are in {ROBOT_UNITS[unit]}"
                yield Mending(reason, _angles_times(campaign, factor))


def _other_units(quantity: str, units: Iterable[str], stated: str) -> dict[str, float]:
    """Units that could be meant, each with the factor that mends numbers stated in `stated`."""
    sizes = UNITS[quantity]
    return {unit: sizes[unit] / sizes[stated] for unit in units if unit != stated}


def _other_angles() -> dict[str, float]:
    return _other_units("rad", ROBOT_UNITS, "gon")


def _forces_times(campaign: Campaign, factor: float) -> Campaign:
    return with_readings(campaign, lambda values: factor * values)


def _angles_times(campaign: Campaign, factor: float) -> Campaign:
    columns: dict[str, Any] = {"angles": campaign.angles, "yaw": campaign.yaw}
    return replace(campaign, **{key: factor * v for key, v in columns.items() if v is not None})
