"""The layout of a raw log: what `import` was told or found out, and `apply` needs again."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, StrictInt, StrictStr

from accelstudy.files.types import Finite, OneOrMore, Rate
from accelstudy.sensors.frames import Frame, parse_frame

Place = Annotated[StrictInt, Field(ge=0)] | StrictStr
"""A column by its name in the header, or by its place, counted from 0."""


class LogLayout(BaseModel):
    """How the numbers of a log are read; the block `log` of a campaign's header.

    Scale and offset are in the order of the log's own axes, whatever its frame.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    columns: dict[str, Place] = Field(
        {},
        description="columns of fx, fy, fz, temperature and vibration: name, or place counted "
        "from 0",
    )
    time: Place | None = Field(None, description="column of time")
    time_unit: Literal["s", "ms", "us", "ns"] = Field("s", description="unit of that column")
    rate_hz: Rate | None = Field(None, description="samples per second, without time")
    variable: str | None = Field(None, description="which array of a MATLAB file")
    unit: Literal["m/s^2", "g", "counts"] = Field("m/s^2", description="unit of the forces")
    scale: OneOrMore[Finite] | None = Field(None, description="with counts: m/s² per count")
    offset: OneOrMore[Finite] | None = Field(None, description="with counts: reading at 0 m/s²")
    frame: Annotated[str, AfterValidator(lambda name: parse_frame(name).name)] = Field(
        "frd", description="where the axes x, y, z of the log point, as frd or flu"
    )

    @property
    def axes(self) -> Frame:
        """The frame."""
        return parse_frame(self.frame)
