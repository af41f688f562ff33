"""Public measurements: a registry of where they are, and a way to get them whole."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from functools import cache
from http.client import HTTPException
from pathlib import Path
from typing import Annotated, Literal
from urllib.error import HTTPError
from urllib.parse import unquote, urlsplit
from urllib.request import Request, urlopen

from pydantic import Field, ValidationError

from accelstudy.campaign.header import Nominal
from accelstudy.errors import InputError, UnknownNameError
from accelstudy.study.config.errors import first_error
from accelstudy.study.config.layers import read_layer
from accelstudy.study.config.schema import Block
from accelstudy.study.config.types import Positive

REGISTRY = Path(__file__).with_name("public_data.yaml")
TIMEOUT = 30.0
"""s, that a server may be silent."""


class ImportSettings(Block):
    """How a file is read; the head of `public_data.yaml` explains the keys."""

    content: Literal["samples", "means"]
    format: Literal["text", "matlab"]
    columns: list[str | None]
    delimiter: str | None = None
    skip_rows: Annotated[int, Field(ge=0)] = 0
    variable: str | None = None
    transposed: bool = False
    unit: Literal["m/s^2", "g", "counts"]
    nominal: Nominal | None = None
    rate_hz: Positive | None = None
    gravity_mps2: Positive


class PublicData(Block):
    """One public file.

    Attributes
    ----------
    description : str
    url : str, of the file as it was at one commit
    sha256 : str, of its bytes
    licence : str, SPDX identifier
    settings : ImportSettings, the key `import`; None where the file holds no forces
    """

    description: str
    url: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    licence: str
    settings: ImportSettings | None = Field(None, alias="import")

    @property
    def file_name(self) -> str:
        """Name of the file at its source."""
        return Path(unquote(urlsplit(self.url).path)).name


class _Registry(Block):
    sets: dict[str, PublicData]


@cache
def public_data() -> Mapping[str, PublicData]:
    """Public files by name."""
    try:
        return _Registry(sets=read_layer(REGISTRY)).sets
    except ValidationError as error:
        raise InputError(f"{REGISTRY}: {first_error(error, _Registry)}") from None


def public_file(name: str, folder: str | Path) -> Path:
    """Path of a public file, which is downloaded unless it is there already.

    Parameters
    ----------
    name : str
        Name in the registry, see `public_data`.
    folder : path
        Searched with all its subfolders for a file of that name and checksum. A download goes to
        `<folder>/<name>/`.

    Raises
    ------
    UnknownNameError
        If the registry has no such name.
    InputError
        If the file cannot be downloaded, or is not the one that the registry knows.
    """
    known = public_data()
    if name not in known:
        raise UnknownNameError("public data", name, known)
    return fetch(known[name], Path(folder), Path(folder) / name)


def fetch(data: PublicData, searched: Path, target: Path) -> Path:
    """Find a file below the folder `searched`, or download it to the folder `target`.

    What an interrupted download leaves, a `.part` file, is continued by the next one.

    Raises
    ------
    InputError
        If the file cannot be downloaded, or is not the one that is meant.
    """
    try:
        for path in sorted(searched.rglob(data.file_name)):
            if path.is_file() and _sha256(path) == data.sha256:
                return path
        target.mkdir(parents=True, exist_ok=True)
        path = target / data.file_name
        part = path.with_name(f"{path.name}.part")
        _download(data.url, part)
        found = _sha256(part)
        if found != data.sha256:
            part.unlink()  # it cannot be continued to something right
            raise InputError(
                f"{data.url}: the sha256 is {found}, not {data.sha256}: damaged on the way or "
                "changed at its source; try again"
            )
        return part.replace(path)
    except (OSError, HTTPException) as error:
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        raise InputError(
            f"{data.url}: cannot be downloaded: {' '.join(str(reason).split())}; try again, or put "
            f"the file {data.file_name} below {searched}"
        ) from None


def _download(url: str, part: Path) -> None:
    """Download to `part`, after what it holds already."""
    have = part.stat().st_size if part.exists() else 0
    request = Request(url, headers={"Range": f"bytes={have}-"} if have else {})
    try:
        with urlopen(request, timeout=TIMEOUT) as response:
            # A server that does not know ranges sends the whole file, with another status.
            resumed = response.headers.get("Content-Range", "").startswith(f"bytes {have}-")
            with part.open("ab" if resumed else "wb") as file:
                start = file.tell()
                shutil.copyfileobj(response, file)
                came = file.tell() - start
            expected = response.headers.get("Content-Length")
            # The end of a broken connection looks like the end of the file.
            if expected is not None and came < int(expected):
                raise OSError(f"the connection broke after {came} of {expected} bytes")
    except HTTPError as error:
        # Nothing comes after what is there: it is whole, or wrong, which its checksum will tell.
        if not (have and error.code == 416):
            raise


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
