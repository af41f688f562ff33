"""The section `designs` of `config/plan-example.yaml`."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from accelstudy.approaches import approach_names, get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON
from accelstudy.config_names import ModelName, SchemeName
from accelstudy.design.task import Task
from accelstudy.files.validation import Block, OneOrMore, SigmaAngle, SigmaForce, Tilt
from accelstudy.leveling.error import MAX_TILT_GON
from accelstudy.schemes import get_scheme, scheme_names
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise


class DesignsConfig(Block):
    """Schemes and designs whose efficiency is compared."""

    model: ModelName = Field("bias-scale-nonorthogonality", description="what is calibrated")
    schemes: OneOrMore[SchemeName] = Field(default=["all"], description="schemes, or all")
    approaches: OneOrMore[str] = Field(default=["gravity", "robot"], description="or all")
    positions: list[int] = Field(
        default=[12, 24], description="numbers of positions of the I-optimal designs beside them"
    )
    tilt_range_gon: Tilt = Field(
        MAX_TILT_GON, description="tilt up to which the calibrated sensor is used"
    )
    sensor_sigma_mps2: SigmaForce = Field(0.002, description="noise of a position's mean")
    robot_sigma_mgon: SigmaAngle = Field(3.2, description="noise of the robot's angles")

    @model_validator(mode="after")
    def _can_be_done(self) -> Self:
        try:
            for name in self.chosen_schemes:
                get_scheme(name)
            for approach in self.chosen_approaches:
                task = self.task(approach)
                least = -(-task.model.n_parameters // task.approach.n_conditions)
                for n in self.positions:
                    if not least <= n <= 300:
                        raise InputError(f"positions: must be from {least} to 300, not {n}")
        except InputError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def chosen_schemes(self) -> list[str]:
        """Names of the schemes."""
        return list(scheme_names()) if self.schemes == ["all"] else list(self.schemes)

    @property
    def chosen_approaches(self) -> list[str]:
        """Names of the approaches."""
        return list(approach_names()) if self.approaches == ["all"] else list(self.approaches)

    def task(self, approach: str) -> Task:
        """The calibration with one of the approaches."""
        return Task(
            get_model(self.model),
            get_approach(approach),
            Noise(self.sensor_sigma_mps2, self.robot_sigma_mgon * MGON),
            tilt_range=self.tilt_range_gon * GON,
        )
