"""What pydantic finds wrong with a configuration, in one line for a person."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from accelstudy.basics.errors import shown


class Block(BaseModel):
    """A part of the configuration; keys that it does not know are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


def first_error(error: ValidationError, root: type[BaseModel]) -> str:
    """Say in one line which key of a `root` is wrong, and what would be right."""
    first, *others = error.errors()
    key = ".".join(str(part)[:100] for part in first["loc"])
    if first["type"] == "extra_forbidden":
        text = f"{key}: unknown key"
        siblings = _keys_beside(first["loc"], root)
        near = get_close_matches(str(first["loc"][-1])[:100], siblings, n=1)
        text += f"; did you mean {near[0]!r}?" if near else ""
        text += f" (known: {', '.join(siblings)})"
    elif first["type"] == "value_error":
        text = ": ".join(filter(None, [key, str(first["ctx"]["error"])]))
    else:
        value = "" if first["type"] == "missing" else f", not {shown(first['input'])}"
        text = f"{key}: {first['msg'][0].lower()}{first['msg'][1:]}{value}"
    more = f" (and {len(others)} more)" if others else ""
    return " ".join(f"{text}{more}".split())


def _keys_beside(location: Sequence[str | int], root: type[BaseModel]) -> list[str]:
    """Keys that are known where an unknown one stands."""
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
