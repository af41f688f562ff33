"""The section `pole` of `config/plan-example.yaml`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from accelstudy.approaches import get_approach
from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.errors import InputError
from accelstudy.frames import parse_frame
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
from accelstudy.study.config.schema import Block
from accelstudy.study.config.types import ModelName, PathName, Replicates


class PoleCase(Block):
    """A pole with its sensor: the options of `accelstudy pole`."""

    sensor: str = Field("adxl355", description="data sheet: a name, or a path of one's own")
    calibration: str | None = Field(None, description="calibration.json, or one of these")
    tilt_sigma: str | None = Field(None, description="of roll and pitch, if no more is known; or")
    model: ModelName = Field("bias-scale-nonorthogonality", description="what is calibrated")
    scheme: str = Field("mclaren-24", description="positions")
    approach: str = Field("gravity", description="gravity or robot")
    hold: str = Field(HOLD.usual, description="time at each position")
    robot_sigma: str = Field(ROBOT_SIGMA.usual, description="sd of the robot's angles")
    mounting: str = Field("frd", description="where the axes point on the upright pole")
    tilt_range: str = Field(TILT_RANGE.usual, description="largest tilt")
    replicates: Replicates = Field(1000, description="of each tilt and direction")
    setup: dict[str, str] = Field(default_factory=dict, description="quantities of `Setup`")

    @model_validator(mode="after")
    def _can_be_used(self) -> Self:
        checks: dict[str, partial[Any]] = {
            "sensor": partial(get_data_sheet, self.sensor),
            "scheme": partial(get_scheme, self.scheme),
            "approach": partial(get_approach, self.approach),
            "mounting": partial(parse_frame, self.mounting),
            "hold": partial(HOLD.read, self.hold),
            "robot_sigma": partial(ROBOT_SIGMA.read, self.robot_sigma),
            "tilt_range": partial(TILT_RANGE.read, self.tilt_range),
            "setup": partial(setup_of, self.setup),
        }
        if self.tilt_sigma is not None:
            checks["tilt_sigma"] = partial(TILT_SIGMA.read, self.tilt_sigma)
        for key, check in checks.items():
            try:
                check()
            except InputError as error:
                raise ValueError(f"{key}: {error}") from None
        check_one_kind({k: k for k in self.model_fields_set if getattr(self, k) is not None})
        return self

    @property
    def calibrated_sensor(self) -> CalibratedSensor:
        """The sensor with its calibration."""
        sheet, frame = get_data_sheet(self.sensor), parse_frame(self.mounting)
        if self.calibration is not None:
            return from_calibration(self.calibration, sheet, frame)
        if self.tilt_sigma is not None:
            return from_tilt_sigma(TILT_SIGMA.read(self.tilt_sigma), sheet, frame)
        return from_linear_theory(
            self.model,
            self.scheme,
            self.approach,
            sheet,
            HOLD.read(self.hold),
            ROBOT_SIGMA.read(self.robot_sigma),
            frame,
        )

    @property
    def files(self) -> list[str]:
        """Files that are read: the calibration, and a data sheet of the user's."""
        known = self.sensor in data_sheet_names()
        return [*([] if known else [self.sensor]), *filter(None, [self.calibration])]

    def write(self, seed: int, folder: Path, provenance: Mapping[str, Any]) -> PoleResult:
        """Work the case out and write it into a folder; see `write_pole`."""
        return write_pole(
            setup_of(self.setup),
            self.calibrated_sensor,
            TILT_RANGE.read(self.tilt_range),
            self.replicates,
            seed,
            folder,
            provenance,
        )


class PoleConfig(Block):
    """Poles that are worked out; each has a folder of its name."""

    cases: dict[PathName, PoleCase] = Field(default_factory=dict, description="by name")
