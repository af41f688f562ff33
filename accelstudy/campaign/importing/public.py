"""Public measurements: a registry of their sources, and checked downloads."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import unquote, urlsplit

from pydantic import Field

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.files.outputs import whole_file
from accelstudy.files.reading import read_layer
from accelstudy.files.validation import Block, checked

REGISTRY = Path(__file__).with_name("public_data.yaml")
TIMEOUT = 30.0
"""Longest time without data from a server, s."""


class PublicData(Block):
    """One public file.

    Attributes
    ----------
    description : str
    url : str, of the file as it was at one commit
    sha256 : str, of its bytes
    licence : str, SPDX identifier
    settings : ImportSettings, the key `import`; None if the file holds no forces
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
    return checked(_Registry, {"sets": read_layer(REGISTRY)}, REGISTRY).sets


def import_settings(name: str) -> ImportSettings:
    """How a public file is imported; the campaign is named as in the registry.

    Raises
    ------
    UnknownNameError
        If the registry has no such name.
    InputError
        If the file holds no forces.
    """
    settings = _known(name).settings
    if settings is None:
        raise InputError(f"the public data {name!r} hold no forces")
    return settings.model_copy(update={"name": name})


def public_file(name: str, folder: str | Path) -> Path:
    """Path of a public file; the file is downloaded if it is missing.

    Parameters
    ----------
    name : str
        Name in the registry, see `public_data`.
    folder : path
        This folder and all its subfolders are searched for a file with that name and checksum. A
        download goes to `<folder>/<name>/`.

    Raises
    ------
    UnknownNameError
        If the registry has no such name.
    InputError
        If the file cannot be downloaded, or is not the one that the registry knows.
    """
    folder = Path(folder).expanduser()  # in a configuration no shell expands it
    return fetch(_known(name), folder, folder / name)


def _known(name: str) -> PublicData:
    registry = public_data()
    if name not in registry:
        raise UnknownNameError("public data", name, registry)
    return registry[name]


def record_public(name: str, folder: str | Path, path: str | Path, attempt: int) -> None:
    """Write to a JSON file where a public file is, or why it is missing.

    `attempt` is kept with it; see `next_attempt`.
    """
    record: dict[str, Any] = {"name": name, "file": None, "error": None, "attempt": attempt}
    try:
        record["file"] = str(public_file(name, folder))
    except InputError as error:
        record["error"] = str(error)
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(record, indent=2, ensure_ascii=False), encoding="utf-8")


def read_record(path: str | Path) -> dict[str, Any]:
    """Read what `record_public` wrote."""
    return json.loads(Path(path).read_text(encoding="utf-8"))


def next_attempt(path: str | Path) -> int:
    """Number of the attempt to get a file, from 1.

    It is the number in the record as long as the file is there, else the next one. As a parameter
    of a rule it makes Snakemake repeat failed downloads, and only those.
    """
    if not Path(path).exists():
        return 1
    record = read_record(path)
    there = record["file"] is not None and Path(record["file"]).is_file()
    return record["attempt"] + (0 if there else 1)


def fetch(data: PublicData, searched: Path, target: Path) -> Path:
    """Find a file below the folder `searched`, or download it to the folder `target`.

    Raises
    ------
    InputError
        If the file cannot be downloaded, or is not the expected one.
    """
    import pooch

    pooch.get_logger().setLevel("WARNING")
    try:
        for path in sorted(searched.rglob(data.file_name)):
            if path.is_file() and pooch.file_hash(str(path)) == data.sha256:
                return path
        # As a stream, pooch would leave the connection open after an error.
        download = pooch.HTTPDownloader(timeout=TIMEOUT, stream=False)
        checksum = f"sha256:{data.sha256}"
        return Path(pooch.retrieve(data.url, checksum, data.file_name, target, downloader=download))
    except ValueError:
        raise InputError(
            f"{data.url}: has another sha256 than {data.sha256}: damaged on the way or changed at "
            "its source; try again"
        ) from None
    except OSError as error:
        raise InputError(
            f"{data.url}: cannot be downloaded: {' '.join(str(error).split())}; try again, or put "
            f"the file {data.file_name} below {searched}"
        ) from None
