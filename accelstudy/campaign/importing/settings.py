"""The settings of `accelstudy import`."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.sources import LogFile
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
    gravity: GravitySettings = GravitySettings()
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


def parse_settings(
    content: Mapping[str, Any],
    source: str | Path = "settings",
    names: Mapping[str, str] | None = None,
) -> ImportSettings:
    """Check settings; raise `InputError` with one line that names the source and the key.

    `names` are those of keys that are not from the source, see `validate`.
    """
    return validate(ImportSettings, content, source, names=names)


def read_settings(
    path: str | Path | None,
    given: Mapping[str, Any] | None = None,
    names: Mapping[str, str] | None = None,
) -> ImportSettings:
    """Settings from a YAML file, overlaid with `given`, whose keys messages call by `names`."""
    content = read_layer(path) if path is not None else {}
    return parse_settings(overlay(content, given or {}), str(path or "settings"), names)


def named_after(settings: ImportSettings, paths: Sequence[LogFile]) -> ImportSettings:
    """Settings with a name for the campaign, if they have none.

    It is the name of the file without endings, or of the folder of the files.
    """
    if settings.name:
        return settings
    path = Path(str(paths[0]))
    name = Path(path.stem).stem if path.suffix == ".gz" else path.stem
    if len(paths) > 1:
        name = path.absolute().parent.name or path.stem
    return settings.model_copy(update={"name": name})
