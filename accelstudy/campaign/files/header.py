"""What stands in a campaign's header, and what its columns are."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.units import GON
from accelstudy.campaign.files.layout import LogLayout
from accelstudy.files.types import (
    Finite,
    Gravity,
    Number,
    Positive,
    SigmaAngle,
    SigmaForce,
    SigmaGravity,
)
from accelstudy.files.validation import Block
from accelstudy.sensors.conversion import Conversion, conversion_of

Array = NDArray[np.float64]

HEADER = "campaign.yaml"
TABLES = ("positions.csv", "positions.parquet")

COLUMNS = {
    "positions": ("position",),
    "time": ("time_s",),
    "forces": ("fx", "fy", "fz"),
    "n_samples": ("n_samples",),
    "sd": ("sd_fx", "sd_fy", "sd_fz"),
    "slope": ("slope_fx", "slope_fy", "slope_fz"),
    "sd_slope": ("sd_slope_fx", "sd_slope_fy", "sd_slope_fz"),
    "temperature": ("temperature_degC",),
    "angles": ("roll_robot_gon", "pitch_robot_gon"),
    "yaw": ("yaw_robot_gon",),
    "vibration": ("vibration_mps2",),
}
"""Attributes of a campaign and the columns that make them up, all of them or none."""
KNOWN = tuple(name for names in COLUMNS.values() for name in names)
COUNTING = ("positions", "n_samples")
MOST = 1e12
"""Beyond anything that is measured, in any unit; squares and cubes of less stay finite."""
ANY = Range(-MOST, MOST)
RANGES = {
    "positions": Range(1, 2**53),  # beyond which not every integer is a float
    "n_samples": Range(1, 2**53),
    "sd": Range(0.0, MOST),
    "sd_slope": Range(0.0, MOST),
    "time": bounds.TIME,
    "temperature": bounds.TEMPERATURE,
    "vibration": bounds.VIBRATION,
    "angles": bounds.ANGLE,
    "yaw": bounds.ANGLE,
}
"""What columns can hold, in the unit of the file, where it is not `ANY`."""


def _not_zero(value: float) -> float:
    if value == 0:
        raise ValueError("must not be zero")
    return value


PerAxis = Field(min_length=3, max_length=3)


class Nominal(Block):
    """Nominal conversion of counts: f = (raw − offset) · scale, m/s², per axis."""

    scale: list[Annotated[Finite, AfterValidator(_not_zero)]] = PerAxis
    offset: list[Finite] = PerAxis


class _Gravity(Block):
    value_mps2: Gravity
    sigma_mps2: SigmaGravity = 0.0


class _SensorNoise(Block):
    sigma_mps2: SigmaForce


class _Robot(Block):
    angle_sigma_mgon: SigmaAngle


class Exclusion(Block):
    """A hold that is left out of every fit."""

    position: Annotated[int, Field(ge=1), Number]
    reason: Annotated[str, Field(min_length=1)]


class Header(Block):
    """What stands in `campaign.yaml`."""

    schema_version: Annotated[Literal[1], Number]
    name: Annotated[str, Field(min_length=1)]
    sensor: str | None = None
    unit: Literal["m/s^2", "g", "counts"]
    nominal: Nominal | None = None
    gravity: _Gravity
    sensor_noise: _SensorNoise | None = None
    range_mps2: Annotated[Positive, Field(le=MOST)] | None = None
    excluded: Annotated[list[Exclusion], Field(min_length=1)] | None = None
    robot: _Robot | None = None
    log: LogLayout | None = None

    @model_validator(mode="after")
    def _nominal_with_counts(self) -> Self:
        if self.unit == "counts" and self.nominal is None:
            raise ValueError("nominal: missing; unit: counts needs scale and offset of each axis")
        if self.unit != "counts" and self.nominal is not None:
            raise ValueError(f"nominal: goes with unit: counts, not with unit: {self.unit}")
        return self

    def conversion(self, attribute: str) -> Conversion:
        """Conversion of the columns of an attribute to SI."""
        if attribute in ("angles", "yaw"):
            return Conversion(np.array([GON]), np.zeros(1))
        if attribute not in ("forces", "sd", "slope", "sd_slope"):
            return Conversion(np.ones(1), np.zeros(1))
        if self.nominal is None:
            forces = conversion_of(self.unit)
        else:
            forces = Conversion(np.array(self.nominal.scale), np.array(self.nominal.offset))
        if attribute == "forces":
            return forces
        # Differences have no offset, and sds no sign.
        scale = forces.scale if attribute == "slope" else np.abs(forces.scale)
        return Conversion(scale, np.zeros(3))
