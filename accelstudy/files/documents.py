"""JSON files of results: one model reads, checks and describes each, and gives its JSON Schema."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict

from accelstudy.files.reading import read_json
from accelstudy.files.validation import Number, validate

ITEM = re.compile(r"^(\w+) : (.+(?:\n {4}.+)*)", re.MULTILINE)
"""Name and meaning of an attribute in a docstring."""


class Part(BaseModel):
    """A part of a document; keys of later versions are kept as they are.

    What its docstring says of attributes describes the keys, on pages and in the JSON Schema.
    """

    model_config = ConfigDict(extra="allow")

    @classmethod
    def __pydantic_init_subclass__(cls, **settings: Any) -> None:
        super().__pydantic_init_subclass__(**settings)
        for name, meaning in ITEM.findall(inspect.cleandoc(cls.__doc__ or "")):
            cls.model_fields[name].description = " ".join(meaning.split())
        cls.model_rebuild(force=True)


class Document(Part):
    """The content of a JSON file of accelstudy, whose name is `file`.

    Attributes
    ----------
    schema_version : of this format
    """

    file: ClassVar[str]
    schema_version: Annotated[Literal[1], Number]

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read the file, given by itself or by its folder.

        Raises
        ------
        InputError
            If there is no such file, or it holds something else.
        """
        path = Path(path, cls.file) if os.path.isdir(path) else Path(path)
        return cls.check(read_json(path, cls.refusal()), str(path))

    @classmethod
    def check(cls, content: Mapping[str, Any], where: str = "") -> Self:
        """Check the content of such a file; `where` begins the message if it is something else."""
        return validate(cls, content, ": ".join(filter(None, [where, cls.refusal()])))

    @classmethod
    def refusal(cls) -> str:
        """Say that a file holds something else."""
        return f"not a {cls.file} of accelstudy"
