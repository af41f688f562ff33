"""The section `plan` of `config/plan-example.yaml`."""

from __future__ import annotations

import math
from typing import Literal, Self

from pydantic import Field, model_validator

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import GON, MGON, parse_quantity
from accelstudy.data_sheets import data_sheet_names, of_sigma
from accelstudy.files.validation import Block, OneOrMore, PathName, Replicates
from accelstudy.plan.search.question import BY_HAND, ROBOT, Question
from accelstudy.plan.search.sensors import get_sensor


class PlanCase(Block):
    """One question, with the options of `accelstudy plan`."""

    tilt_accuracy: str = Field(description="target for roll and for pitch, as 10mgon")
    tilt_range: str = Field("30gon", description="largest tilt at which the sensor is used")
    sensor: str | None = Field(None, description="data sheet: a name, or the path of a file")
    sigma: str | None = Field(None, description="noise of a position's mean, as 2mm/s2, instead")
    equipment: Literal["gravity", "robot", "both"] = Field("both", description="what is available")
    confidence: float | None = Field(
        None, ge=0.5, le=0.999, description="share of the calibrations that must reach it; or rms"
    )
    max_time: str | None = Field(None, description="time in the field at most, as 20min")

    @property
    def question(self) -> Question:
        """The question in SI."""
        if (self.sensor is None) == (self.sigma is None):
            raise InputError("give sensor or sigma, one of them")
        sheet = (
            get_sensor(str(self.sensor))
            if self.sigma is None
            else of_sigma(_read("sigma", self.sigma, "m/s^2", 1e-9, 10.0))
        )
        longest = math.inf
        if self.max_time is not None:
            longest = _read("max_time", self.max_time, "s", 0.0, math.inf)
        return Question(
            _read("tilt_accuracy", self.tilt_accuracy, "rad", 1e-4 * MGON, 100 * GON),
            _read("tilt_range", self.tilt_range, "rad", 0.1 * GON, 90 * GON),
            sheet,
            {"gravity": (BY_HAND,), "robot": (ROBOT,), "both": (BY_HAND, ROBOT)}[self.equipment],
            self.confidence,
            most_seconds=longest,
        )

    @model_validator(mode="after")
    def _can_be_asked(self) -> Self:
        try:
            _ = self.question
        except InputError as error:
            raise ValueError(str(error)) from None
        return self


class PlanConfig(Block):
    """The plans, and the sensors that are compared."""

    cases: dict[PathName, PlanCase] = Field(default_factory=dict, description="name: question")
    sensors: OneOrMore[str] = Field(
        default=["all"], description="data sheets that are compared: names, files, or all"
    )
    replicates: Replicates = Field(10_000, description="simulated calibrations of each at the top")

    @model_validator(mode="after")
    def _sensors_exist(self) -> Self:
        try:
            for name in self.chosen_sensors:
                get_sensor(name)
        except InputError as error:
            raise ValueError(f"sensors: {error}") from None
        return self

    @property
    def chosen_sensors(self) -> list[str]:
        """Names and paths of the data sheets."""
        return list(data_sheet_names()) if self.sensors == ["all"] else list(self.sensors)


def _read(key: str, text: str, unit: str, least: float, most: float) -> float:
    try:
        return parse_quantity(text, unit, least, most)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None
