"""A calibrated sensor in a configuration: its data sheet, and how it is calibrated."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Self

from pydantic import Field, model_validator

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.config_names import ModelName
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.files.validation import Block
from accelstudy.pole.instrument.sensor import CalibratedSensor, from_calibration, from_linear_theory
from accelstudy.pole.instrument.setup import HOLD, ROBOT_SIGMA, check_one_kind
from accelstudy.schemes import get_scheme
from accelstudy.sensors.frames import FRD, Frame


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
        known = self.sensor in data_sheet_names()
        return [*([] if known else [self.sensor]), *filter(None, [self.calibration])]
