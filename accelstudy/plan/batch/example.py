"""The configuration of `workflow/plan.smk`: a section for each part; each part checks its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self, TypeVar

from pydantic import BaseModel, Field, model_validator

from accelstudy.files.types import PathName, Seed
from accelstudy.files.validation import Block, checked

Section = TypeVar("Section", bound=BaseModel)

SECTIONS = ("plan", "designs", "sequential", "pole", "field")
"""Each has rules in `workflow/rules/` under its name."""


class Example(Block):
    """The sections of a run; results go to ``results/<study>``."""

    study: PathName = Field(description="name; results go to results/<study>/")
    seed: Annotated[Seed, Field(description="of all random numbers")] = 1
    plan: dict[str, Any] = Field(default_factory=dict, description="the cheapest calibration")
    designs: dict[str, Any] = Field(default_factory=dict, description="optimal schemes")
    sequential: dict[str, Any] = Field(default_factory=dict, description="one position at a time")
    pole: dict[str, Any] = Field(default_factory=dict, description="tilt of a pole")
    field: dict[str, Any] = Field(default_factory=dict, description="what limits a sensor in use")

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
