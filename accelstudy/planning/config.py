"""The configuration of `workflow/plan.smk`: its sections, and that of plans."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self, TypeVar, cast

from pydantic import BaseModel, Field, model_validator

from accelstudy.basics.errors import InputError
from accelstudy.data_sheets import of_sigma
from accelstudy.files.validation import (
    Block,
    Configuration,
    PathName,
    Replicates,
    Seed,
    checked,
)
from accelstudy.planning.quantities import QUANTITIES
from accelstudy.planning.question import Question, equipment_of, get_sensor


class PlanCase(Block):
    """One question, with options of `accelstudy plan`."""

    tilt_accuracy: str = Field(description="target for roll and for pitch, as 10mgon")
    tilt_range: str = Field(
        QUANTITIES["tilt_range"].usual, description="largest tilt at which the sensor is used"
    )
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
        sigma = self._si("sigma")
        longest = self._si("max_time")
        return Question(
            cast(float, self._si("tilt_accuracy")),
            cast(float, self._si("tilt_range")),
            get_sensor(str(self.sensor)) if sigma is None else of_sigma(sigma),
            equipment_of(self.equipment),
            self.confidence,
            most_seconds=math.inf if longest is None else longest,
        )

    def _si(self, key: str) -> float | None:
        text = getattr(self, key)
        try:
            return None if text is None else QUANTITIES[key].read(text)
        except InputError as error:
            raise InputError(f"{key}: {error}") from None

    @model_validator(mode="after")
    def _can_be_asked(self) -> Self:
        try:
            _ = self.question
        except InputError as error:
            raise ValueError(str(error)) from None
        return self


class PlanConfig(Block):
    """The plans."""

    retired = {  # noqa: RUF012
        "sensors": "plan each sensor as a case of its own, with sensor: NAME, and leave it out"
    }
    cases: dict[PathName, PlanCase] = Field(default_factory=dict, description="name: question")
    replicates: Replicates = Field(200, description="simulated calibrations of each at the top")


Section = TypeVar("Section", bound=BaseModel)
SECTIONS = ("plan", "designs", "sequential")
"""Each has rules in `workflow/rules/` under its name."""


class Example(Configuration):
    """The sections of a run; results go to ``results/<study>``."""

    retired = {  # noqa: RUF012
        "field": "`accelstudy plan` says what is left in use; leave it out",
        "pole": "examples/pole works it out with a calibration; leave it out",
    }

    study: PathName = Field(description="name; results go to results/<study>/")
    seed: Annotated[Seed, Field(description="of all random numbers")] = 1
    plan: dict[str, Any] = Field(default_factory=dict, description="the cheapest calibration")
    designs: dict[str, Any] = Field(default_factory=dict, description="optimal schemes")
    sequential: dict[str, Any] = Field(default_factory=dict, description="one position at a time")

    @model_validator(mode="after")
    def _has_a_section(self) -> Self:
        if not self.sections:
            raise ValueError(f"nothing to do; give at least one of {', '.join(SECTIONS)}")
        return self

    @property
    def sections(self) -> list[str]:
        """Names of the sections that are given."""
        return [name for name in SECTIONS if name in self.model_fields_set]


def parse_example(content: Mapping[str, Any], source: str = "config") -> Example:
    """Check the configuration, except its sections.

    Raises
    ------
    InputError
        One line that names the source, the key, what is wrong and what would be right.
    """
    return checked(Example, content, source)


def parse_section(
    example: Example, name: str, block: type[Section], source: str = "config"
) -> Section:
    """Check one section against the class of its part; raises errors like `parse_example`."""
    return checked(block, getattr(example, name), source, name)
