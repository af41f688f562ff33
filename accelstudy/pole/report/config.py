"""The section `pole` of `config/plan-example.yaml`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import Field

from accelstudy.data_sheets import get_data_sheet
from accelstudy.files.types import PathName, Replicates
from accelstudy.files.validation import Block
from accelstudy.pole.instrument.case import SensorCase
from accelstudy.pole.instrument.sensor import CalibratedSensor, from_tilt_sigma
from accelstudy.pole.instrument.setup import TILT_RANGE, TILT_SIGMA, setup_of
from accelstudy.pole.report.output import PoleResult, write_pole
from accelstudy.sensors.frames import FRD, Frame, parse_frame


class PoleCase(SensorCase):
    """A pole with its sensor: the options of `accelstudy pole`."""

    tilt_sigma: str | None = Field(
        None, description="sd of roll and pitch, if nothing else is known of the calibration"
    )
    mounting: str = Field("frd", description="where the axes point on the upright pole")
    tilt_range: str = Field(TILT_RANGE.usual, description="largest tilt")
    replicates: Replicates = Field(1000, description="of each tilt and direction")
    setup: dict[str, str] = Field(default_factory=dict, description="quantities of `Setup`")

    @property
    def checks(self) -> Mapping[str, tuple[Callable[[Any], Any], Any]]:
        """See `SensorCase.checks`."""
        known = self.tilt_sigma is not None
        return {
            **super().checks,
            "mounting": (parse_frame, self.mounting),
            "tilt_range": (TILT_RANGE.read, self.tilt_range),
            "setup": (setup_of, self.setup),
            **({"tilt_sigma": (TILT_SIGMA.read, self.tilt_sigma)} if known else {}),
        }

    def calibrated_sensor(self, mounting: Frame = FRD) -> CalibratedSensor:
        """See `SensorCase.calibrated_sensor`."""
        if self.tilt_sigma is None:
            return super().calibrated_sensor(mounting)
        sigma = TILT_SIGMA.read(self.tilt_sigma)
        return from_tilt_sigma(sigma, get_data_sheet(self.sensor), mounting)

    def write(self, seed: int, folder: Path, provenance: Mapping[str, Any]) -> PoleResult:
        """Calculate the case and write it into a folder; see `write_pole`."""
        return write_pole(
            setup_of(self.setup),
            self.calibrated_sensor(parse_frame(self.mounting)),
            TILT_RANGE.read(self.tilt_range),
            self.replicates,
            seed,
            folder,
            provenance,
        )


class PoleConfig(Block):
    """Poles; each result goes to a folder of that name."""

    cases: dict[PathName, PoleCase] = Field(default_factory=dict, description="by name")
