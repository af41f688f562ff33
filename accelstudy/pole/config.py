"""The section `pole` of `config/plan-example.yaml`, and the calibrated sensor that it names."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.config_names import ModelName
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.files.validation import Block, PathName, Replicates
from accelstudy.pole.output import PoleResult, write_pole
from accelstudy.pole.sensor import (
    CalibratedSensor,
    from_calibration,
    from_linear_theory,
    from_tilt_sigma,
)
from accelstudy.pole.setup import (
    HOLD,
    ROBOT_SIGMA,
    TILT_RANGE,
    TILT_SIGMA,
    check_one_kind,
    setup_of,
)
from accelstudy.schemes import get_scheme
from accelstudy.sensors.frames import FRD, Frame, parse_frame


class SensorCase(Block):
    """A sensor with its calibration: an existing one, or one that linear theory predicts."""

    sensor: str = Field("adxl355", description="data sheet: a name, or the path of your own")
    calibration: str | None = Field(None, description="calibration.json, instead of what follows")
    model: ModelName = Field("bias-scale-nonorthogonality", description="what is calibrated")
    scheme: str = Field("mclaren-24", description="positions")
    approach: str = Field("gravity", description="gravity or robot")
    hold: str = Field(HOLD.usual, description="time at each position")
    robot_sigma: str = Field(ROBOT_SIGMA.usual, description="sd of the robot's angles")

    @property
    def checks(self) -> Mapping[str, tuple[Callable[[Any], Any], Any]]:
        """For each key the function that checks its value, and the value."""
        return {
            "sensor": (get_data_sheet, self.sensor),
            "scheme": (get_scheme, self.scheme),
            "approach": (get_approach, self.approach),
            "hold": (HOLD.read, self.hold),
            "robot_sigma": (ROBOT_SIGMA.read, self.robot_sigma),
        }

    @model_validator(mode="after")
    def _can_be_used(self) -> Self:
        for key, (check, value) in self.checks.items():
            try:
                check(value)
            except InputError as error:
                raise ValueError(f"{key}: {error}") from None
        check_one_kind({k: k for k in self.model_fields_set if getattr(self, k) is not None})
        return self

    def calibrated_sensor(self, mounting: Frame = FRD) -> CalibratedSensor:
        """Read or compute the sensor with its calibration."""
        sheet = get_data_sheet(self.sensor)
        if self.calibration is not None:
            return from_calibration(self.calibration, sheet, mounting)
        return from_linear_theory(
            self.model,
            self.scheme,
            self.approach,
            sheet,
            HOLD.read(self.hold),
            ROBOT_SIGMA.read(self.robot_sigma),
            mounting,
        )

    @property
    def files(self) -> list[str]:
        """Files that are read: the calibration, and the user's own data sheet."""
        catalogued = self.sensor in data_sheet_names()
        return [*([] if catalogued else [self.sensor]), *filter(None, [self.calibration])]


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
        checks: dict[str, tuple[Callable[[Any], Any], Any]] = {
            **super().checks,
            "mounting": (parse_frame, self.mounting),
            "tilt_range": (TILT_RANGE.read, self.tilt_range),
            "setup": (setup_of, self.setup),
        }
        if self.tilt_sigma is not None:
            checks["tilt_sigma"] = (TILT_SIGMA.read, self.tilt_sigma)
        return checks

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
