"""The content of a YAML file with a scheme, such as `accelstudy design` writes.

A scheme of a file has the name that the file gives, with a digest of its directions. So results
depend on the content of the file, and not on its path.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from accelstudy.basics.bounds import Range
from accelstudy.basics.names import path_name
from accelstudy.files.validation import ConfigSection, PathName, bounds_of, validate
from accelstudy.positions.scheme import Scheme, unit_vectors

Component = Annotated[float, *bounds_of(Range(-1e100, 1e100))]  # whose square is finite


def _not_zero(direction: list[float]) -> list[float]:
    if not any(direction):
        raise ValueError("must not be zero")
    return direction


Direction = Annotated[list[Component], Field(min_length=3, max_length=3), AfterValidator(_not_zero)]


class SchemeFile(ConfigSection):
    """The content of a file: directions of gravity in the body frame, of any length.

    Attributes
    ----------
    positions : attitudes, for people; not read
    design : how it was designed, for people; not read
    """

    directions: Annotated[list[Direction], Field(min_length=1)]
    scheme: PathName | None = None
    title: str | None = None
    source: str | None = None
    positions: Any = None
    design: Any = None


def parse_scheme(content: Mapping[str, Any], name: str, source: str | Path = "scheme") -> Scheme:
    """Make a scheme of the content of a file.

    Parameters
    ----------
    content : mapping
    name : str, of the scheme if the content gives none
    source : str or path, named in errors
    """
    file = validate(SchemeFile, content, source)
    directions = unit_vectors(file.directions)
    digest = hashlib.sha256(directions.tobytes()).hexdigest()[:8]
    return Scheme(
        name=f"{file.scheme or path_name(name, 'scheme')}@{digest}",
        title=f"{len(directions)} {file.title or 'of a file'}",
        directions=directions,
        status="generated",
        source=file.source or "",
    )
