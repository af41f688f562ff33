"""The settings of `accelstudy import`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from accelstudy.basics.arguments import tidy
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.units import MGON, STANDARD_GRAVITY
from accelstudy.campaign.header import LogLayout
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.validation import (
    ConfigSection,
    Gravity,
    NotNegative,
    Positive,
    SigmaAngle,
    SigmaGravity,
    in_unit,
    validate,
)

_LARGE = Field(le=1e6)

_EXCLUDED = re.compile(r"(\d{1,9}(?:\s*,\s*\d{1,9})*)\s*:\s*(\S.*)", re.DOTALL)
"""Holds by their numbers, and why they are left out."""


class GravitySettings(ConfigSection):
    """Gravity where the sensor was."""

    value_mps2: Annotated[Gravity, in_unit("m/s^2")] = Field(
        STANDARD_GRAVITY, description="local gravity, m/s²"
    )
    sigma_mps2: SigmaGravity = Field(0.0, description="its standard deviation; 0 holds it fixed")


def _gravity_of(value: Any) -> Any:
    """Take local gravity alone for the block, as the option does."""
    return {"value_mps2": value} if isinstance(value, float | int | str) else value


class RobotSettings(ConfigSection):
    """The robot whose angles a table of means has."""

    angle_sigma_mgon: SigmaAngle = Field(description="standard deviation of roll and of pitch")
    unit: Literal["gon", "deg", "rad"] = Field("gon", description="unit of the angles in the table")


class ImportSettings(LogLayout):
    """How a log is read, and what the campaign gets from it; the keys of a settings file."""

    retired: ClassVar = {
        **LogLayout.retired,
        "join": "holds in one attitude are positions each",
        "sensors": "import each of them by its `columns`, with a `name` of its own",
    }

    means: bool = Field(False, description="the file is a table of means already")
    block: int | None = Field(
        None, ge=4, description="samples of each position, in a log without the moves between them"
    )
    name: str | None = Field(None, description="name of the campaign; that of the file if absent")
    sensor: str | None = Field(None, description="what was calibrated")
    gravity: Annotated[GravitySettings, BeforeValidator(_gravity_of)] = GravitySettings()
    robot: RobotSettings | None = Field(None, description="with means: the robot's angles")
    range_mps2: Annotated[Annotated[Positive, _LARGE] | None, in_unit("m/s^2")] = Field(
        None, alias="range", description="the sensor measures ± this"
    )
    window_s: Annotated[Positive | None, in_unit("s")] = Field(
        None,
        alias="window",
        description="length of the sliding window; 1 s, or 9 samples if these last longer",
    )
    threshold_mps2: Annotated[Annotated[Positive, _LARGE] | None, in_unit("m/s^2")] = Field(
        None,
        alias="threshold",
        description="sd of a window at rest; chosen from the data if absent",
    )
    trim_s: Annotated[NotNegative, in_unit("s")] = Field(
        0.2, alias="trim", description="cut from both ends of a hold"
    )
    shortest_s: Annotated[Positive, in_unit("s")] = Field(
        1.0, alias="shortest", description="shortest hold"
    )
    exclude: list[str] = Field(
        [], description="holds to leave out, and why, as 13:moved or 13,14:somebody passed"
    )

    @model_validator(mode="after")
    def _names_holds(self) -> Self:
        _ = self.left_out
        return self

    @property
    def layout(self) -> dict[str, Any]:
        """Keys of the layout of the log that were said."""
        fields = {*LogLayout.model_fields}
        return self.model_dump(include=fields, exclude_unset=True, exclude_none=True)

    def with_layout(self, layout: LogLayout) -> Self:
        """Return the settings with the layout that a log has."""
        fields = LogLayout.model_fields
        return self.model_copy(update={key: getattr(layout, key) for key in fields})

    @property
    def full_range(self) -> float:
        """Range of the sensor, m/s²; infinite if it is unknown, or the offset of counts is."""
        if self.range_mps2 is None or (self.unit == "counts" and self.offset is None):
            return np.inf
        return self.range_mps2

    @property
    def left_out(self) -> dict[int, str]:
        """Numbers of the holds to leave out, with the reason: ``13:moved``."""
        reasons: dict[int, str] = {}
        for text in self.exclude:
            if (match := _EXCLUDED.fullmatch(text.strip())) is None:
                raise InputError(
                    "exclude: expected holds by their numbers in segmentation.png, and why, as "
                    f"13:moved or 13,14:moved, not {text!r}"
                )
            reasons |= dict.fromkeys(map(int, match[1].split(",")), " ".join(match[2].split()))
        return reasons


KEYS = {
    "gravity": "gravity.value_mps2",
    "robot_sigma": "robot.angle_sigma_mgon",
    "robot_unit": "robot.unit",
}
"""Keywords whose keys in a file have other names, of which some say a unit."""


def settings_of(
    given: Mapping[str, Any], layout: Mapping[str, Any] | None = None
) -> ImportSettings:
    """Settings of the file `settings`, overlaid with those of a layout, and these with keywords.

    Raises
    ------
    InputError
        One line that names the keyword, or the file and the key.
    """
    path = given["settings"]
    content, names = _keys_of(given, ImportSettings)
    own = LogLayout.model_validate(layout or {}).model_dump(by_alias=True, exclude_unset=True)
    below = overlay({} if path is None else read_layer(path), own)
    return validate(ImportSettings, overlay(below, content), path or "settings", names=names)


def layout_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a layout that keywords say, checked; other keywords do not count."""
    content, names = _keys_of(given, LogLayout)
    return validate(LogLayout, content, "log", names=names).model_dump(exclude_unset=True)


def _keys_of(
    given: Mapping[str, Any], model: type[LogLayout]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Content of a file that says the same as those keywords that a model has; keys with names."""
    known = {field.alias or name for name, field in model.model_fields.items()}
    content: dict[str, Any] = {}
    names = {}
    for name, value in given.items():
        place = KEYS.get(name, name)
        if place.partition(".")[0] not in known or value is None or value is False or value == ():
            continue
        names[place] = key(name)
        block, _, inner = place.rpartition(".")
        part = content.setdefault(block, {}) if block else content
        value = tidy(value / MGON) if name == "robot_sigma" else value
        part[inner] = list(value) if isinstance(value, tuple) else value
    return content, names
