"""The section `plan` of `config/plan-example.yaml`."""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from accelstudy.data_sheets import data_sheet_names, get_data_sheet
from accelstudy.errors import InputError
from accelstudy.study.config.schema import Block
from accelstudy.study.config.types import OneOrMore, Positive


class PlanConfig(Block):
    """What is planned."""

    sensors: OneOrMore[str] = Field(
        default=["all"], description="data sheets: names, paths of files of one's own, or all"
    )
    seconds: OneOrMore[Positive] = Field(default=[10.0], description="durations of a hold, s")

    @model_validator(mode="after")
    def _sensors_exist(self) -> Self:
        try:
            for name in self.chosen_sensors:
                get_data_sheet(name)
        except InputError as error:
            raise ValueError(f"sensors: {error}") from None
        return self

    @property
    def chosen_sensors(self) -> list[str]:
        """Names and paths of the data sheets."""
        return list(data_sheet_names()) if self.sensors == ["all"] else list(self.sensors)
