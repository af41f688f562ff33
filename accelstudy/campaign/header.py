"""The header of a campaign, as `campaign.yaml` has it, the layout of its log included."""

from __future__ import annotations

from collections.abc import Callable
from datetime import date as calendar_date
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import (
    AfterValidator,
    AliasChoices,
    BeforeValidator,
    Field,
    StrictInt,
    StrictStr,
    model_validator,
)

from accelstudy.basics.bounds import Range
from accelstudy.basics.dates import read_date
from accelstudy.basics.units import CLOCK_UNITS, GON, MGON, SENSOR_UNITS
from accelstudy.campaign.columns import COLUMNS, MAX_CELL
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.campaign.unit_spellings import parse_unit
from accelstudy.files.validation import (
    ConfigSection,
    Finite,
    Gravity,
    NotNegative,
    Number,
    OneOrMore,
    Positive,
    Rate,
    SigmaAngle,
    SigmaForce,
    SigmaGravity,
    bounds_of,
    in_unit,
)
from accelstudy.sensors.conversion import MAX_VALUE, Conversion, conversion_of
from accelstudy.sensors.frames import Frame, parse_frame

HEADER = "campaign.yaml"
TABLE = "positions.csv"

Place = Annotated[StrictInt, Field(ge=0)] | StrictStr
"""A column by its name in the header, or by its place, counted from 0."""


def _usual_spelling(*units: str) -> Callable[[Any], Any]:
    """Make a validator that takes a unit in any usual spelling: m/s2, µs."""

    def read(value: Any) -> Any:
        unit = parse_unit(value) if isinstance(value, str) else None
        return unit if unit in units else value

    return read


class LogLayout(ConfigSection):
    """Layout of a log: how `import` read its numbers, and `apply` reads them again.

    Scale and offset are in the order of the log's own axes, whatever its frame.

    Attributes
    ----------
    columns : columns of fx, fy, fz, temperature and vibration: name, or place counted from 0
    time : column of time
    time_unit : unit of that column
    rate : samples per second, without time
    variable : which array of a MATLAB file, topic of a bag, or instance of a ULog
    unit : unit of the forces
    scale : with counts: m/s² per count
    offset : with counts: reading at 0 m/s²
    frame : where the axes x, y, z of the log point, as frd or flu
    """

    retired: ClassVar = {"delimiter": "it is told from the rows"}

    columns: dict[str, Place] = Field({})
    time: Place | None = None
    time_unit: Annotated[
        Literal["s", "ms", "us", "ns"], BeforeValidator(_usual_spelling(*CLOCK_UNITS))
    ] = "s"
    rate: Annotated[Rate | None, in_unit("Hz")] = Field(
        None,
        validation_alias=AliasChoices("rate", "rate_hz"),  # as 0.1 to 0.3 wrote it
    )
    variable: str | None = None
    unit: Annotated[
        Literal["m/s^2", "g", "mg", "counts"],
        BeforeValidator(_usual_spelling(*SENSOR_UNITS, "counts")),
    ] = "m/s^2"
    scale: OneOrMore[Finite] | None = None
    offset: OneOrMore[Finite] | None = None
    frame: Annotated[str, AfterValidator(lambda name: parse_frame(name).name)] = "frd"

    @property
    def axes(self) -> Frame:
        """Frame of the axes of the log."""
        return parse_frame(self.frame)

    @property
    def conversion(self) -> Conversion:
        """Conversion of forces to m/s², in the axes of the log."""
        return conversion_of(self.unit, self.scale, self.offset)


def _not_zero(value: float) -> float:
    if value == 0:
        raise ValueError("must not be zero")
    return value


PerAxis = Field(min_length=3, max_length=3)
Calculable = Annotated[float, *bounds_of(Range(-MAX_VALUE, MAX_VALUE))]


class Nominal(ConfigSection):
    """Nominal conversion of counts: f = (raw − offset) · scale, m/s², per axis.

    Attributes
    ----------
    scale : m/s² per count, of x, y and z
    offset : reading at 0 m/s², of x, y and z
    """

    scale: Annotated[list[Annotated[Calculable, AfterValidator(_not_zero)]], PerAxis]
    offset: Annotated[list[Calculable], PerAxis]


class _Gravity(ConfigSection):
    """Gravity where the sensor was.

    Attributes
    ----------
    value_mps2 : local gravity
    sigma_mps2 : its standard deviation; 0 holds it fixed in the adjustment
    """

    value_mps2: Gravity
    sigma_mps2: SigmaGravity = 0.0


class _SensorNoise(ConfigSection):
    """A-priori noise of the sensor; without it the noise is estimated from the residuals.

    Attributes
    ----------
    sigma_mps2 : standard deviation of a position mean, per axis
    degrees_of_freedom : of that sigma, where it is an estimate; without them it counts as known
    """

    sigma_mps2: SigmaForce
    degrees_of_freedom: Positive | None = None


class _Robot(ConfigSection):
    """The robot, whose section stands in the header exactly if the table has its angles.

    Attributes
    ----------
    angle_sigma_mgon : standard deviation of roll and of pitch
    """

    angle_sigma_mgon: SigmaAngle


class Exclusion(ConfigSection):
    """A hold that is left out of every fit.

    Attributes
    ----------
    position : number of the hold
    reason : why it is left out
    """

    position: Annotated[int, Field(ge=1), Number]
    reason: Annotated[str, Field(min_length=1)]


def _date(value: Any) -> Any:
    """Date as text; YAML makes dates of what looks like one."""
    text = value.isoformat() if isinstance(value, calendar_date) else value
    if isinstance(text, str):
        read_date(text)
    return text


class Header(ConfigSection):
    """The content of `campaign.yaml`.

    Attributes
    ----------
    schema_version : of this format
    name : of the campaign, any text
    sensor : what was calibrated, any text
    date : when it was measured, as 2026-03-01 or 2026-03-01T14:00
    unit : of the forces in the table; g is 9.80665 m/s²
    range_mps2 : the sensor measures ± this; where it can saturate
    resolution_mps2 : steps in which x, y and z are read; where rounding counts
    """

    schema_version: Annotated[Literal[1], Number]
    name: Annotated[str, Field(min_length=1)]
    sensor: str | None = None
    date: Annotated[str, BeforeValidator(_date)] | None = None
    unit: Literal["m/s^2", "g", "mg", "counts"]
    nominal: Nominal | None = None
    gravity: _Gravity
    sensor_noise: _SensorNoise | None = None
    range_mps2: Annotated[Positive, Field(le=MAX_CELL)] | None = None
    resolution_mps2: Annotated[list[Annotated[NotNegative, Field(le=MAX_CELL)]], PerAxis] | None = (
        None
    )
    excluded: Annotated[list[Exclusion], Field(min_length=1)] | None = None
    robot: _Robot | None = None
    reference: ReferenceSensor | None = None
    log: LogLayout | None = None

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.unit == "counts" and self.nominal is None:
            raise ValueError("nominal: missing; unit: counts needs scale and offset of each axis")
        if self.unit != "counts" and self.nominal is not None:
            raise ValueError(f"nominal: goes with unit: counts, not with unit: {self.unit}")
        if self.robot is not None and self.reference is not None:
            raise ValueError("robot: goes without reference: the angles are those of one of them")
        return self

    @property
    def sigma_force(self) -> float | None:
        """A-priori standard deviation of a position mean, m/s²; None if unknown."""
        return None if self.sensor_noise is None else self.sensor_noise.sigma_mps2

    @property
    def sigma_dof(self) -> float:
        """Degrees of freedom of that noise, where it is an estimate; else infinite."""
        stated = self.sensor_noise and self.sensor_noise.degrees_of_freedom
        return stated or np.inf

    @property
    def sigma_angle(self) -> float | None:
        """Standard deviation of the angles of a level hold, rad; None without angles."""
        if self.reference is not None:
            return self.reference.sigma_mps2 / self.gravity.value_mps2
        return None if self.robot is None else self.robot.angle_sigma_mgon * MGON

    def conversion(self, attribute: str) -> Conversion:
        """Conversion of the columns of an attribute to SI."""
        unit = COLUMNS[attribute].unit
        if unit != "unit":
            return Conversion(np.array([GON if unit == "gon" else 1.0]), np.zeros(1))
        nominal = {} if self.nominal is None else self.nominal.model_dump()
        forces = conversion_of(self.unit, **nominal)
        if attribute == "forces":
            return forces
        # Sds have neither an offset nor a sign.
        return Conversion(np.abs(forces.scale), np.zeros(3))
