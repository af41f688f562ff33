"""JSON files of results: one model reads, checks and describes each, and gives its JSON Schema."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict

from accelstudy.files.reading import read_json
from accelstudy.files.validation import Number, validate


class Part(BaseModel):
    """A part of a document; keys of later versions are kept as they are."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True)


class Document(Part):
    """The content of a JSON file of accelstudy."""

    file: ClassVar[str]
    """Name of the file in its folder."""
    schema_version: Annotated[Literal[1], Number]
    """of this format"""

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """Read the file, given by itself or by its folder.

        Raises
        ------
        InputError
            If there is no such file, or it holds something else.
        """
        path = Path(path)
        path = path / cls.file if path.is_dir() else path
        return cls.check(read_json(path, cls.refusal()), str(path))

    @classmethod
    def check(cls, content: object, where: str = "") -> Self:
        """Check the content of such a file; `where` begins the message if it is something else."""
        return validate(cls, content, ": ".join(filter(None, [where, cls.refusal()])))

    @classmethod
    def refusal(cls) -> str:
        """Say that a file holds something else."""
        return f"not a {cls.file} of accelstudy"
