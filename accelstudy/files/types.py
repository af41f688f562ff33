"""The types of numbers and lists in a configuration."""

from __future__ import annotations

from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BeforeValidator, Field, GetCoreSchemaHandler
from pydantic import GetJsonSchemaHandler as JsonHandler
from pydantic_core import core_schema

from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.names import check_path_name


def _no_truth_value(value: Any) -> Any:
    if isinstance(value, bool):
        raise ValueError(f"must be a number, not {str(value).lower()}")
    return value


def _power_of_two(value: int) -> int:
    if value & (value - 1):
        raise ValueError("must be a power of two, as Sobol sequences are balanced only there")
    return value


PathName = Annotated[str, AfterValidator(check_path_name)]
Number = BeforeValidator(_no_truth_value)
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False), Number]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False), Number]
Finite = Annotated[float, Field(allow_inf_nan=False), Number]
Tilt = Annotated[float, Field(gt=0, lt=100), Number]
Pitch = Annotated[float, Field(gt=-100, lt=100), Number]


def _within(range_: Range) -> tuple[Any, ...]:
    """Annotations that keep a number within a range, in the schema too."""
    ends = {"minimum": 0 if range_.zero else range_.least, "maximum": range_.most}
    finite = Field(json_schema_extra=dict(ends))
    return Number, AfterValidator(range_.check), finite


Gravity = Annotated[float, *_within(bounds.GRAVITY)]
GravityError = Annotated[float, *_within(bounds.GRAVITY_ERROR)]
SigmaForce = Annotated[float, *_within(bounds.SIGMA_FORCE)]
SigmaGravity = Annotated[float, *_within(bounds.SIGMA_GRAVITY)]
SigmaAngle = Annotated[float, *_within(bounds.SIGMA_ANGLE)]
Angle = Annotated[float, *_within(bounds.ANGLE)]
Temperature = Annotated[float, *_within(bounds.TEMPERATURE)]
Vibration = Annotated[float, *_within(bounds.VIBRATION)]
Interval = Annotated[float, *_within(bounds.INTERVAL)]
Duration = Annotated[float, *_within(bounds.DURATION)]
Rate = Annotated[float, *_within(bounds.RATE)]
Replicates = Annotated[int, *_within(bounds.REPLICATES)]
Sessions = Annotated[int, *_within(bounds.SESSIONS)]
Attitudes = Annotated[int, *_within(bounds.ATTITUDES)]
BaseSamples = Annotated[int, *_within(bounds.BASE_SAMPLES), AfterValidator(_power_of_two)]
Resamples = Annotated[int, *_within(bounds.RESAMPLES)]
Seed = Annotated[int, *_within(bounds.SEED)]


class _OneOrMore:
    """Take a single value for a list of one, in the schema too."""

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return core_schema.no_info_before_validator_function(self._as_list, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: JsonHandler
    ) -> dict[str, Any]:
        many = handler(schema)
        return {"anyOf": [many["items"], many]}

    @staticmethod
    def _as_list(value: Any) -> Any:
        return [value] if isinstance(value, str | int | float) else value


T = TypeVar("T")
OneOrMore = Annotated[list[T], Field(min_length=1), _OneOrMore()]
