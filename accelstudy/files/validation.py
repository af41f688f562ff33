"""Checks of what was read from a file: types of its values, and errors that name the key."""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Mapping
from datetime import date
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar

from pydantic import (
    AfterValidator,
    AliasChoices,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetCoreSchemaHandler,
    ValidationError,
    model_validator,
)
from pydantic import GetJsonSchemaHandler as JsonHandler
from pydantic_core import ErrorDetails, PydanticCustomError, core_schema

from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, brief, did_you_mean
from accelstudy.basics.names import check_path_name
from accelstudy.basics.plugins import as_names, load_plugins
from accelstudy.basics.units import InputQuantity
from accelstudy.basics.wording import short_list


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


def bounds_of(range_: Range) -> tuple[Any, ...]:
    """Annotations that keep a number within a range, in the schema too."""
    ends = {"minimum": 0 if range_.zero else range_.least, "maximum": range_.most}
    finite = Field(json_schema_extra=dict(ends))
    return Number, AfterValidator(range_.check), finite


def in_unit(unit: str) -> BeforeValidator:
    """Take a text with a unit, as `8g`, for a number in the SI unit, as the command line does."""
    quantity = InputQuantity(unit, -math.inf, bare=True)

    def read(value: Any) -> Any:
        return quantity.read(value) if isinstance(value, str) else value

    return BeforeValidator(read, json_schema_input_type=float | str)


Gravity = Annotated[float, *bounds_of(bounds.GRAVITY)]
GravityError = Annotated[float, *bounds_of(bounds.GRAVITY_ERROR)]
SigmaForce = Annotated[float, *bounds_of(bounds.SIGMA_FORCE)]
SigmaGravity = Annotated[float, *bounds_of(bounds.SIGMA_GRAVITY)]
SigmaAngle = Annotated[float, *bounds_of(bounds.SIGMA_ANGLE)]
ParameterValue = Annotated[float, *bounds_of(bounds.PARAMETER)]
ParameterSigma = Annotated[float, *bounds_of(bounds.SIGMA_PARAMETER)]
Angle = Annotated[float, *bounds_of(bounds.ANGLE)]
Temperature = Annotated[float, *bounds_of(bounds.TEMPERATURE)]
Vibration = Annotated[float, *bounds_of(bounds.VIBRATION)]
Interval = Annotated[float, *bounds_of(bounds.INTERVAL)]
Rate = Annotated[float, *bounds_of(bounds.RATE)]
Replicates = Annotated[int, *bounds_of(bounds.REPLICATES)]
Attitudes = Annotated[int, *bounds_of(bounds.ATTITUDES)]
BaseSamples = Annotated[int, *bounds_of(bounds.BASE_SAMPLES), AfterValidator(_power_of_two)]
Seed = Annotated[int, *bounds_of(bounds.SEED)]


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


Model = TypeVar("Model", bound=BaseModel)


_KEYS = "expected keys and values"
_LEAST, _MOST = "must have at least {min_length}", "must have at most {max_length}"
WORDS = {
    "missing": "must be given",
    "greater_than": "must be greater than {gt}",
    "greater_than_equal": "must be at least {ge}",
    "less_than": "must be less than {lt}",
    "less_than_equal": "must be at most {le}",
    "finite_number": "must be a finite number",
    **dict.fromkeys(("float_type", "float_parsing"), "must be a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "must be a whole number"),
    "int_parsing_size": "must be a smaller number",
    "string_type": "must be a text",
    "string_unicode": "must be a text in UTF-8",
    "string_too_short": f"{_LEAST} characters",
    **dict.fromkeys(("list_type", "tuple_type"), "must be a list"),
    "too_short": f"{_LEAST} entries",
    "too_long": f"{_MOST} entries",
    **dict.fromkeys(("bool_type", "bool_parsing"), "must be true or false"),
    "literal_error": "must be {expected}",
    "string_pattern_mismatch": "must match {pattern}",
    "invalid_key": "a key must be a text",
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), _KEYS),
}
"""What would be right, by the type of pydantic's error; two types have a text of their own."""


ITEM = re.compile(r"^(\w+) : (.+(?:\n {4}.+)*)", re.MULTILINE)
"""Name and meaning of an attribute in a docstring."""


class KeyProblem(ValueError):
    """What is wrong with a key of a section, which the message begins with."""


class DocumentedModel(BaseModel):
    """A model whose docstring says what its keys mean, on pages and in the JSON Schema."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core: core_schema.CoreSchema, handler: JsonHandler
    ) -> dict[str, Any]:
        """JSON Schema with the head of the docstring, and the meaning of each key."""
        schema = handler.resolve_ref_schema(handler(core))
        for one in reversed(cls.__mro__[: cls.__mro__.index(DocumentedModel)]):
            text, _, attributes = inspect.cleandoc(one.__doc__ or "").partition("\n\nAttributes\n")
            schema["description"] = text
            for name, meaning in ITEM.findall(attributes):
                key = cls.model_fields[name].alias or name
                schema["properties"][key]["description"] = " ".join(meaning.split())
        return schema


class ConfigSection(DocumentedModel):
    """A part of the configuration; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)
    retired: ClassVar[Mapping[str, str]] = {}
    """Keys of earlier versions, and what to do instead."""

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, content: Any) -> Any:
        fields = cls.model_fields
        known = [field.alias or name for name, field in fields.items()]
        other = [field.validation_alias for field in fields.values()]
        before = [name for one in other if isinstance(one, AliasChoices) for name in one.choices]
        if not isinstance(content, Mapping | cls):
            raise PydanticCustomError("keys", f"{_KEYS} ({', '.join(known)})")
        for key in content if isinstance(content, Mapping) else ():
            if key in cls.retired:
                raise KeyProblem(f"{key}: no longer a key; {cls.retired[key]}")
            if isinstance(key, str) and key not in (*known, *fields, *before):
                hint = did_you_mean(key, known)
                raise KeyProblem(f"{key[:100]}: unknown key{hint} (known: {', '.join(known)})")
        return content


class Configuration(ConfigSection):
    """A whole configuration, whose plug-ins are loaded before its other keys are read.

    Attributes
    ----------
    plugins : Python files with effects, schemes and the like of your own, from the folder in
        which the workflow runs
    """

    plugins: Annotated[
        list[str],
        BeforeValidator(as_names, json_schema_input_type=str | list[str] | dict[str, str]),
    ] = Field(default=[])

    @model_validator(mode="before")
    @classmethod
    def _load_plugins(cls, content: Any) -> Any:
        if isinstance(content, Mapping):
            load_plugins(content)
        return content


def validate(
    model: type[Model],
    content: Mapping[str, Any],
    source: str | Path,
    names: Mapping[str, str] | None = None,
) -> Model:
    """Check what was read from a file against a pydantic model.

    Parameters
    ----------
    model : subclass of BaseModel
    content : mapping, as read from YAML or JSON
    source : str or path, named in errors
    names : mapping of str to str, optional
        Keys that are not of the source, as they were given on the command line, to what they are
        called there; then the error does not name the source.

    Returns
    -------
    Model

    Raises
    ------
    InputError
        One line that names the source, the key, what is wrong and what would be right.
    """
    try:
        return model.model_validate(content)
    except ValidationError as error:
        text = _first_error(error, content)
        for key, name in (names or {}).items():
            if text.startswith((f"{key}: ", f"{key}.")):
                raise InputError(f"{name}{text.removeprefix(key)}") from None
        raise InputError(f"{source}: {text}") from None


def _first_error(error: ValidationError, content: object) -> str:
    """Say in one line which key is wrong, and what would be right."""
    # Beside a missing key there is often its name with a typo, which says more.
    errors = sorted(error.errors(), key=lambda each: each["type"] == "missing")
    keys = [".".join(str(p)[:100] for p in _place(each, content) if p != "") for each in errors]
    first, key = errors[0], keys[0]
    if first["type"] == "value_error":
        problem = first["ctx"]["error"]
        # The check of a whole section names the key itself.
        mark = "." if isinstance(problem, KeyProblem) else ": "
        text = mark.join(filter(None, [key, str(problem)]))
    else:
        # Where several kinds of values are right, there is an error for each of them.
        wants = [_wanted(e) for e, k in zip(errors, keys, strict=True) if k == key]
        wanted = " or ".join([wants[0], *(text.removeprefix("must be ") for text in wants[1:])])
        value = "" if first["type"] == "missing" else f", not {_as_written(first['input'])}"
        text = ": ".join(filter(None, [key, f"{wanted}{value}"]))
    others = [*dict.fromkeys(other for other in keys if other != key)]
    more = f" (also wrong: {short_list(others, 3)})" if others else ""
    return " ".join(f"{text}{more}".split())


def _as_written(value: Any) -> str:
    """Show a value as YAML has it: null, true and 2024-01-01."""
    plain = value is None or isinstance(value, bool | date)
    return json.dumps(value, default=str).strip('"') if plain else brief(value)


def _place(error: ErrorDetails, content: Any) -> tuple[str | int, ...]:
    """Keys and numbers of entries that lead to an error, without the marks of pydantic."""
    keys = []
    for number, part in enumerate(error["loc"], start=1):
        if _has(content, part):
            content = content[part]
        elif number < len(error["loc"]) or error["type"] != "missing":
            continue
        keys.append(part)
    return tuple(keys)


def _has(content: object, part: str | int) -> bool:
    if isinstance(content, list | tuple):
        return part in range(len(content))
    return isinstance(content, Mapping) and part in content


def _wanted(error: ErrorDetails) -> str:
    """Say what would be right, in plain words."""
    if error["type"] not in WORDS:
        return error["msg"][0].lower() + error["msg"][1:]
    context = error.get("ctx", {})
    if context.get("min_length") == 1:
        return "must not be empty"
    return WORDS[error["type"]].format(**context)
