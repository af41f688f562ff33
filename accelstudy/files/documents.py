"""Files of results: one model writes, reads, checks and describes each, and gives its schema."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict

from accelstudy.files.outputs import write_text
from accelstudy.files.reading import read_json
from accelstudy.files.validation import DocumentedModel, Number, validate


class Part(DocumentedModel):
    """A part of a document; keys of later versions are kept as they are.

    It is made of a mapping, or of an object with these attributes.
    """

    model_config = ConfigDict(extra="allow", from_attributes=True)


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
    def content(cls, found: Mapping[str, Any]) -> dict[str, Any]:
        """Content of the file of what was found, with null for what is no finite number.

        Raises
        ------
        InputError
            If it could not be read again.
        """
        known = json_content({"schema_version": 1, **found})
        document = validate(cls, known, f"cannot make a {cls.file}")
        content: dict[str, Any] = document.model_dump(by_alias=True, exclude_unset=True)
        return json_content(content)

    @classmethod
    def of(cls, result: object) -> dict[str, Any]:
        """Content of the file of a result: for each key its attribute of that name."""
        keys = [key for key in cls.model_fields if key != "schema_version"]
        return cls.content({key: getattr(result, key) for key in keys})

    @classmethod
    def write(cls, folder: Path, content: Mapping[str, Any]) -> None:
        """Write the file into a folder, whole or not at all."""
        write_text(folder / cls.file, json_text(content))

    @classmethod
    def refusal(cls) -> str:
        """Say that a file holds something else."""
        return f"not a {cls.file} of accelstudy"


def json_content(content: Any) -> Any:
    """Content for JSON: arrays are lists, tables records; what is no finite number is None.

    Records stay as they are: the model of the document reads their attributes.
    """
    if isinstance(content, dict):
        return {key: json_content(value) for key, value in content.items()}
    if isinstance(content, np.ndarray | np.generic):
        return json_content(content.tolist())
    if hasattr(content, "reset_index"):  # a DataFrame; pandas is slow to import
        return json_content(content.reset_index().to_dict("records"))
    if isinstance(content, list | tuple) and not hasattr(content, "_fields"):
        return [json_content(value) for value in content]
    return None if isinstance(content, float) and not np.isfinite(content) else content


def json_text(content: Mapping[str, Any]) -> str:
    """JSON of a content for a file, as of `Document.content`: plain data, without NaN."""
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
