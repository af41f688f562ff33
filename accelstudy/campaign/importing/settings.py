"""The settings of `accelstudy import`: the keywords of `find_holds`, as a file may have them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field

from accelstudy.basics.errors import key
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.header import LogLayout
from accelstudy.files.reading import overlay, read_layer
from accelstudy.files.validation import (
    Gravity,
    NotNegative,
    Positive,
    SigmaGravity,
    in_unit,
    validate,
)

_EXCLUDED = re.compile(r"(\d{1,9}(?:\s*,\s*\d{1,9})*)\s*:\s*(\S.*)", re.DOTALL)
"""Holds by their numbers, and why they are left out."""
Force = Annotated[Positive, Field(le=1e6), in_unit("m/s^2")]


def _parse_exclusions(texts: Any) -> Any:
    """Parse ``13,14:moved`` to numbers of holds with the reason."""
    reasons: dict[int, str] = {}
    for text in [texts] if isinstance(texts, str) else texts if isinstance(texts, list) else ():
        if (match := _EXCLUDED.fullmatch(str(text).strip())) is None:
            raise ValueError(
                "expected holds by their numbers in segmentation.png, and why, as 13:moved or "
                f"13,14:moved, not {text!r}"
            )
        reasons |= dict.fromkeys(map(int, match[1].split(",")), " ".join(match[2].split()))
    return reasons if isinstance(texts, str | list) else texts


class ImportSettings(LogLayout):
    """How a log is read, and what the campaign gets from it."""

    retired: ClassVar = {
        **LogLayout.retired,
        "rate_hz": "write rate instead",
        "range_mps2": "write range instead",
        "window_s": "write window instead",
        "threshold_mps2": "write threshold instead",
        "trim_s": "write trim instead",
        "shortest_s": "write shortest instead",
        "robot": "write robot_sigma, as 3.2mgon, and robot_unit instead",
        "join": "holds in one attitude are positions each",
        "sensors": "import each of them by its `columns`, with a `name` of its own",
    }

    means: bool = Field(False, description="the file is a table of means already")
    block: int | None = Field(
        None, ge=4, description="samples of each position, in a log without the moves between them"
    )
    name: str | None = Field(None, description="name of the campaign; that of the file if absent")
    sensor: str | None = Field(None, description="what was calibrated")
    gravity: Annotated[Gravity, in_unit("m/s^2")] = Field(
        STANDARD_GRAVITY, description="local gravity, m/s²"
    )
    gravity_sigma: Annotated[SigmaGravity, in_unit("m/s^2")] = Field(
        0.0, description="its standard deviation; 0 holds it fixed"
    )
    robot_sigma: Annotated[NotNegative, Field(lt=6.3), in_unit("rad")] | None = Field(
        None, description="with means: standard deviation of the robot's roll and pitch, rad"
    )
    robot_unit: Literal["gon", "deg", "rad"] = Field("gon", description="unit of these angles")
    range: Force | None = Field(None, description="the sensor measures ± this")
    window: Annotated[Positive, in_unit("s")] | None = Field(
        None, description="length of the sliding window; 1 s, or 9 samples if these last longer"
    )
    threshold: Force | None = Field(
        None, description="sd of a window at rest; chosen from the data if absent"
    )
    trim: Annotated[NotNegative, in_unit("s")] = Field(
        0.2, description="cut from both ends of a hold"
    )
    shortest: Annotated[Positive, in_unit("s")] = Field(1.0, description="shortest hold")
    exclude: Annotated[dict[int, str], BeforeValidator(_parse_exclusions)] = Field(
        {}, description="holds to leave out, and why, as 13:moved or 13,14:somebody passed"
    )

    @property
    def layout(self) -> dict[str, Any]:
        """Keys of the layout of the log that were said."""
        fields = {*LogLayout.model_fields}
        return self.model_dump(include=fields, exclude_unset=True, exclude_none=True)


def settings_of(
    given: Mapping[str, Any], layout: Mapping[str, Any] | None = None
) -> ImportSettings:
    """Settings of the file `settings`, overlaid with those of a layout, and these with keywords.

    Raises
    ------
    InputError
        One line that names the keyword, or the file and the key.
    """
    path, own = given["settings"], _said(given, ImportSettings)
    content = overlay({} if path is None else read_layer(path), {**(layout or {}), **own})
    return validate(ImportSettings, content, path or "settings", names={k: key(k) for k in own})


def layout_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a layout that keywords say, checked; other keywords do not count."""
    own = _said(given, LogLayout)
    names = {name: key(name) for name in own}
    return validate(LogLayout, own, "log", names=names).model_dump(exclude_unset=True)


def _said(given: Mapping[str, Any], model: type[LogLayout]) -> dict[str, Any]:
    """Keywords that say something and are keys of a model."""
    return {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in given.items()
        if name in model.model_fields and not (value is None or value is False or value == ())
    }
