"""Checks of what was read from a file; an error is one line that names the key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from accelstudy.basics.errors import InputError, shown

Model = TypeVar("Model", bound=BaseModel)


class Block(BaseModel):
    """A part of the configuration; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


def checked(
    model: type[Model], content: Mapping[str, Any], source: str | Path, section: str = ""
) -> Model:
    """Check what was read from a file against a pydantic model.

    Parameters
    ----------
    model : subclass of BaseModel
    content : mapping, as read from YAML or JSON
    source : str or path, named in errors
    section : str, key of `source` under which `content` stands

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
        raise InputError(f"{source}: {_first_error(error, model, section)}") from None


def _first_error(error: ValidationError, root: type[BaseModel], section: str) -> str:
    """Say in one line which key of a `root` is wrong, and what would be right."""
    first, *others = error.errors()
    key = ".".join(str(part)[:100] for part in (section, *first["loc"]) if part != "")
    if first["type"] == "extra_forbidden":
        text = f"{key}: unknown key"
        siblings = _keys_beside(first["loc"], root)
        near = get_close_matches(str(first["loc"][-1])[:100], siblings, n=1)
        text += f"; did you mean {near[0]!r}?" if near else ""
        text += f" (known: {', '.join(siblings)})"
    elif first["type"] == "value_error":
        # The check of a whole block names the key itself.
        mark = ": " if first["loc"] else "."
        text = mark.join(filter(None, [key, str(first["ctx"]["error"])]))
    elif first["type"] == "model_type":
        text = ": ".join(
            filter(None, [key, f"expected keys and values, not {shown(first['input'])}"])
        )
    else:
        value = "" if first["type"] == "missing" else f", not {shown(first['input'])}"
        text = f"{key}: {first['msg'][0].lower()}{first['msg'][1:]}{value}"
    more = f" (and {len(others)} more)" if others else ""
    return " ".join(f"{text}{more}".split())


def _keys_beside(location: Sequence[str | int], root: type[BaseModel]) -> list[str]:
    """Keys that are known in the place of an unknown one."""
    block = root
    for part in location[:-1]:
        field = _keys(block).get(str(part))
        if field is not None:
            block = next(_blocks(field.annotation), block)
    return list(_keys(block))


def _keys(block: type[BaseModel]) -> dict[str, FieldInfo]:
    return {field.alias or name: field for name, field in block.model_fields.items()}


def _blocks(annotation: Any) -> Iterator[type[BaseModel]]:
    """Blocks that occur in an annotation such as `list[Grid] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in getattr(annotation, "__args__", ()):
        yield from _blocks(argument)
