"""Public measurements: a registry of their sources, and checked downloads."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated
from urllib.parse import unquote, urlsplit

from pydantic import Field

from accelstudy.basics.errors import InputError, check_name
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.files.reading import read_layer
from accelstudy.files.validation import ConfigSection, validate

REGISTRY = Path(__file__).with_name("public_data.yaml")
TIMEOUT = 30.0
"""Longest time without data from a server, s."""


class PublicData(ConfigSection):
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


@cache
def public_data() -> Mapping[str, PublicData]:
    """Public files by name."""
    return {name: validate(PublicData, one, name) for name, one in read_layer(REGISTRY).items()}


def import_settings(name: str) -> ImportSettings:
    """How a public file is imported; the campaign is named as in the registry.

    Raises
    ------
    UnknownNameError
        If the registry has no such name.
    InputError
        If the file holds no forces.
    """
    settings = _public_data(name).settings
    if settings is None:
        raise InputError(f"the public data {name!r} hold no forces")
    return settings.model_copy(update={"name": name})


def public_file(name: str, folder: str | Path) -> Path:
    """Path of a public file; it is downloaded if it is missing.

    Parameters
    ----------
    name : str
        Name in the registry, see `public_data`.
    folder : path
        This folder and all its subfolders are searched for a file with that name and checksum.

    Raises
    ------
    UnknownNameError
        If the registry has no such name.
    InputError
        If the file cannot be downloaded, or is not the one that the registry knows.
    """
    import pooch

    pooch.get_logger().setLevel("WARNING")
    data, folder = _public_data(name), Path(folder).expanduser()  # no shell expands a configuration
    try:
        for path in sorted(folder.rglob(data.file_name)):
            if path.is_file() and pooch.file_hash(str(path)) == data.sha256:
                return path
        # As a stream, pooch would leave the connection open after an error.
        download = pooch.HTTPDownloader(timeout=TIMEOUT, stream=False)
        checksum, place = f"sha256:{data.sha256}", folder / name
        pooch.retrieve(data.url, checksum, data.file_name, place, downloader=download)
        return place / data.file_name
    except ValueError:
        raise InputError(
            f"{data.url}: has another sha256 than {data.sha256}: damaged on the way or changed at "
            "its source; try again"
        ) from None
    except OSError as error:
        raise InputError(
            f"{data.url}: cannot be downloaded: {' '.join(str(error).split())}; try again, or put "
            f"the file {data.file_name} below {folder}"
        ) from None


def _public_data(name: str) -> PublicData:
    registry = public_data()
    check_name("public data", name, registry)
    return registry[name]
