"""The section `sequential` of `config/plan-example.yaml`."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.files.validation import Block, OneOrMore, Positive
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.sequential.promise import get_rule
from accelstudy.simulation.hold_plan import check_needs_no_plan


class SequentialConfig(Block):
    """Sessions that are simulated, each until its promise is kept."""

    model: str = Field(
        default="bias-scale-nonorthogonality", description="of sensor and calibration"
    )
    approaches: OneOrMore[str] = Field(default=["gravity", "robot"], description="equipment")
    rules: OneOrMore[str] = Field(
        default=["known", "bound", "plain"],
        description="how the noise is judged: known, an upper bound from residuals, plain σ̂0",
    )
    instead_of: str = Field(default="mclaren-24", description="fixed scheme to compare with")
    accuracies: OneOrMore[Positive] = Field(
        default=[0.75, 1.0, 1.5, 2.0],
        description="promised accuracies, as multiples of that of the fixed scheme",
    )
    tilt_range_gon: Annotated[float, Field(gt=0, le=100)] = Field(
        default=30.0, description="tilts up to which the accuracy is promised"
    )
    sigma_mps2: Positive = Field(default=0.002, description="noise of a position, per axis")
    robot_sigma_mgon: Positive = Field(default=3.2, description="noise of the robot's angles")
    placing_gon: Annotated[float, Field(ge=0, le=20)] = Field(
        default=2.0, description="sd per axis by which positions miss the chosen attitudes"
    )
    seconds: Positive = Field(
        default=60.0, description="time for a position, including the turn to it"
    )
    sessions: Annotated[int, Field(ge=2, le=1_000_000)] = Field(
        default=300, description="for each of the above"
    )
    most_positions: Annotated[int, Field(ge=2, le=1000)] = Field(
        default=120, description="where a session ends that does not reach its accuracy"
    )

    @model_validator(mode="after")
    def _names_exist(self) -> Self:
        try:
            check_needs_no_plan(get_model(self.model))
            get_scheme(self.instead_of)
            for approach in self.approaches:
                get_approach(approach)
            for rule in self.rules:
                get_rule(rule)
        except InputError as error:
            raise ValueError(str(error)) from None
        return self
