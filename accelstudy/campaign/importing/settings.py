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
    """How a log is read, and what the campaign gets from it.

    Attributes
    ----------
    means : the file is a table of means already
    block : samples of each position, in a log without the moves between them
    name : name of the campaign; that of the file if absent
    sensor : what was calibrated
    gravity : local gravity, m/s²
    gravity_sigma : its standard deviation; 0 holds it fixed
    robot_sigma : with means: standard deviation of the robot's roll and pitch, rad
    robot_unit : unit of these angles
    range : the sensor measures ± this
    window : length of the sliding window; 1 s, or 9 samples if these last longer
    threshold : sd of a window at rest; chosen from the data if absent
    trim : cut from both ends of a hold
    shortest : shortest hold
    exclude : holds to leave out, and why, as 13:moved or 13,14:somebody passed
    """

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

    means: bool = False
    block: int | None = Field(None, ge=4)
    name: str | None = None
    sensor: str | None = None
    gravity: Annotated[Gravity, in_unit("m/s^2")] = STANDARD_GRAVITY
    gravity_sigma: Annotated[SigmaGravity, in_unit("m/s^2")] = 0.0
    robot_sigma: Annotated[NotNegative, Field(lt=6.3), in_unit("rad")] | None = None
    robot_unit: Literal["gon", "deg", "rad"] = "gon"
    range: Force | None = None
    window: Annotated[Positive, in_unit("s")] | None = None
    threshold: Force | None = None
    trim: Annotated[NotNegative, in_unit("s")] = 0.2
    shortest: Annotated[Positive, in_unit("s")] = 1.0
    exclude: Annotated[dict[int, str], BeforeValidator(_parse_exclusions)] = Field({})

    @property
    def layout(self) -> dict[str, Any]:
        """Keys of the layout of the log that were said."""
        fields = {*LogLayout.model_fields}
        return self.model_dump(include=fields, exclude_unset=True, exclude_none=True)


def settings_of(given: Mapping[str, Any]) -> ImportSettings:
    """Settings of the file `settings`, overlaid with keywords.

    Raises
    ------
    InputError
        One line that names the keyword, or the file and the key.
    """
    path = given.get("settings")
    own = {
        name: list(value) if isinstance(value, tuple) else value
        for name, value in given.items()
        if name in ImportSettings.model_fields
        and not (value is None or value is False or value == ())
    }
    content = overlay({} if path is None else read_layer(path), own)
    return validate(ImportSettings, content, path or "settings", names={k: key(k) for k in own})
