"""The settings of `accelstudy import`: the keys of a settings file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.files.header import LogLayout, Place
from accelstudy.campaign.holds.selection import Selection, parse_selection
from accelstudy.files.layers import overlay, read_layer
from accelstudy.files.types import (
    Gravity,
    NotNegative,
    PathName,
    Positive,
    SigmaAngle,
    SigmaGravity,
)
from accelstudy.files.validation import checked

_LARGE = Field(le=1e6)


class GravitySettings(BaseModel):
    """Gravity where the sensor was."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    value_mps2: Gravity = Field(STANDARD_GRAVITY, description="local gravity, m/s²")
    sigma_mps2: SigmaGravity = Field(0.0, description="its standard deviation; 0 holds it fixed")


class RobotSettings(BaseModel):
    """The robot whose angles a table of means has."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    angle_sigma_mgon: SigmaAngle = Field(description="standard deviation of roll and of pitch")
    unit: Literal["gon", "deg", "rad"] = Field("gon", description="unit of the angles in the table")


class ImportSettings(LogLayout):
    """How a log is read, and what the campaign gets from it; the keys of a settings file."""

    means: bool = Field(False, description="the file is a table of means already")
    name: str | None = Field(None, description="name of the campaign; that of the file if absent")
    sensor: str | None = Field(None, description="what was calibrated")
    sensors: dict[PathName, Annotated[list[Place], Field(min_length=3, max_length=3)]] = Field(
        {}, description="several sensors of one log: name, and columns of its x, y, z"
    )
    gravity: GravitySettings = GravitySettings()
    robot: RobotSettings | None = Field(None, description="with means: the robot's angles")
    range_mps2: Annotated[Positive, _LARGE] | None = Field(
        None, description="the sensor measures ± this"
    )
    window_s: Positive = Field(1.0, description="length of the sliding window")
    threshold_mps2: Annotated[Positive, _LARGE] | None = Field(
        None, description="sd of a window at rest; chosen from the data if absent"
    )
    trim_s: NotNegative = Field(0.2, description="cut from both ends of a hold")
    shortest_s: Positive = Field(1.0, description="shortest hold")
    exclude: list[str] = Field(
        [], description="holds to leave out, as 13:moved or 120s-135s:somebody passed"
    )
    join: list[str] = Field([], description="holds that are one, as 4,5 or 120s-135s")

    @property
    def selection(self) -> Selection:
        """Holds that are left out or joined."""
        return parse_selection(self.exclude, self.join)


def parse_settings(content: Mapping[str, Any], source: str = "settings") -> ImportSettings:
    """Check settings; raise `InputError` with one line that names the source and the key."""
    settings = checked(ImportSettings, content, source)
    try:
        parse_selection(settings.exclude, settings.join)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None
    return settings


def read_settings(
    path: str | Path | None, given: Mapping[str, Any] | None = None
) -> ImportSettings:
    """Settings from a YAML file, overlaid with `given`."""
    content = read_layer(path) if path is not None else {}
    return parse_settings(overlay(content, given or {}), str(path or "options"))
