"""The configuration of `workflow/plan.smk`: a section for each part; each part checks its own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, Field

from accelstudy.files.reading import config_hash
from accelstudy.files.validation import Block, PathName, Seed, checked

Section = TypeVar("Section", bound=BaseModel)


class Example(Block):
    """All parts of a run; results go to ``results/<study>``."""

    study: PathName = Field(description="name; results go to results/<study>/")
    seed: Annotated[Seed, Field(description="of all random numbers")] = 1
    plan: dict[str, Any] = Field(default_factory=dict, description="the cheapest calibration")
    designs: dict[str, Any] = Field(default_factory=dict, description="optimal schemes")
    sequential: dict[str, Any] = Field(default_factory=dict, description="one position at a time")
    pole: dict[str, Any] = Field(default_factory=dict, description="tilt of a pole")
    field: dict[str, Any] = Field(default_factory=dict, description="what limits a sensor in use")

    @property
    def provenance(self) -> dict[str, Any]:
        """Provenance that tables record."""
        return {"config_hash": config_hash(self.model_dump(mode="json")), "seed": self.seed}


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
