"""Unit error: numbers are in another unit than the file says."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Self

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.registry import Setting
from accelstudy.basics.units import UNITS
from accelstudy.campaign.gross_errors.base import (
    EVERYWHERE,
    Array,
    GrossError,
    Mending,
    register,
    with_readings,
)

if TYPE_CHECKING:
    from accelstudy.campaign.files.session import Campaign
    from accelstudy.campaign.gross_errors.real_sensor import RealSensor

FORCES = {unit: UNITS["m/s^2"][unit] for unit in ("m/s^2", "g", "mg")}
"""Units in which sensors give forces, and their sizes in m/s²."""
ANGLES = {unit: UNITS["rad"][unit] for unit in ("gon", "deg", "rad")}
"""Units in which robots give angles, and their sizes in rad."""
WORDS = {"deg": "degrees", "rad": "radians"}
"""What people call them."""
NEAR = 0.8
"""Share of gravity to which a sensor comes, at worst, in the right unit."""


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
        possible = [{"force": 1 / FORCES["g"]}]
        if campaign.angles is not None:
            possible += [{"angle": 1 / size} for size in other_units(ANGLES, "gon").values()]
        return type(self)(**possible[rng.integers(len(possible))])

    def act(self, campaign: Campaign) -> Campaign:
        """Multiply by the factors; one that is not given is 1."""
        force, angle = np.nan_to_num(
            [self.settings["force"], self.settings["angle"]], nan=1.0
        ).tolist()
        if angle != 1 and campaign.angles is None:
            raise InputError(f"gross error {self.name!r}: angle: {campaign.name} has no angles")
        return _multiplied(campaign, force, angle)

    def mendings(self, campaign: Campaign, sensor: RealSensor) -> Iterator[Mending]:
        """Take the forces, or the angles, for numbers in another unit."""
        norm = float(np.median(np.linalg.norm(campaign.forces, axis=1))) / campaign.gravity
        for said in ("g", "m/s^2") if campaign.unit == "g" else ("m/s^2", "g"):
            for unit, factor in other_units(FORCES, said).items():
                if NEAR < factor * norm < 1 / NEAR:
                    reason = f"the forces are in {unit}" + (", not in g" if said == "g" else "")
                    mended = _multiplied(campaign, factor, 1.0)
                    yield Mending(reason, mended, factor * np.eye(3))
        if sensor.expected is not None:
            for unit, factor in other_units(ANGLES, "gon").items():
                reason = f"the robot's angles are in {WORDS[unit]}"
                yield Mending(reason, _multiplied(campaign, 1.0, factor))


def other_units(units: Mapping[str, float], said: str) -> dict[str, float]:
    """Return the units that could be meant, and what numbers in `said` are to be multiplied by."""
    return {unit: size / units[said] for unit, size in units.items() if unit != said}


def _multiplied(campaign: Campaign, force: float, angle: float) -> Campaign:
    def times(values: Array | None) -> Array | None:
        return None if values is None else angle * values

    if force != 1:
        campaign = with_readings(campaign, lambda values: force * values)
    return replace(campaign, angles=times(campaign.angles), yaw=times(campaign.yaw))
