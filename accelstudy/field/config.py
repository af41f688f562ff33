"""The section `field` of `config/plan-example.yaml`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from accelstudy.drawing.saving import save
from accelstudy.drawing.style import DPI
from accelstudy.field.figure import field_figure
from accelstudy.field.shares import Use, field_shares
from accelstudy.files.tables import write_table
from accelstudy.files.validation import Angle, Block, Number, OneOrMore, PathName
from accelstudy.pole.config import SensorCase
from accelstudy.pole.setup import quantities

USUAL = quantities()
QUANTITIES = ("averaging", "age", "temperature_change")
"""Quantities of `Use` that have a unit."""

Pitch = Annotated[float, Field(ge=-80, le=80), Number]
"""Pitch in gon, far enough from ±100 gon that leveling is linear."""


class FieldCase(SensorCase):
    """A calibrated sensor in use."""

    averaging: str = Field(USUAL["averaging"].usual, description="duration of a reading")
    age: str = Field(USUAL["age"].usual, description="time since the calibration")
    temperature_change: str = Field(
        USUAL["temperature_change"].usual, description="difference from the calibration"
    )
    restarted: bool = Field(True, description="whether the sensor was switched off since")
    roll_gon: OneOrMore[Angle] = Field(default=[-30, 0, 30], description="rolls of the grid")
    pitch_gon: OneOrMore[Pitch] = Field(default=[-30, 0, 30], description="pitches of the grid")

    @property
    def checks(self) -> Mapping[str, tuple[Callable[[Any], Any], Any]]:
        """See `SensorCase.checks`."""
        reading = {name: (USUAL[name].read, getattr(self, name)) for name in QUANTITIES}
        return {**super().checks, **reading}

    @property
    def use(self) -> Use:
        """How the sensor is used."""
        values = {name: USUAL[name].read(getattr(self, name)) for name in QUANTITIES}
        return Use(**values, restarted=self.restarted)

    def write(self, folder: Path, provenance: Mapping[str, Any]) -> None:
        """Write `shares.parquet` and the figure `shares` into a folder."""
        sensor = self.calibrated_sensor()
        table = field_shares(sensor, self.use, self.roll_gon, self.pitch_gon)
        folder.mkdir(parents=True, exist_ok=True)
        write_table(folder / "shares.parquet", table, provenance)
        save(
            field_figure(table, sensor.sheet, self.use),
            folder / "shares.svg",
            folder / "shares.png",
            "What makes roll and pitch uncertain in the field",
            DPI,
        )


class FieldConfig(Block):
    """Sensors in use; each result goes to a folder of that name."""

    cases: dict[PathName, FieldCase] = Field(default_factory=dict, description="by name")
