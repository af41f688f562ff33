"""The configuration of a batch of campaigns: the keys of `config/campaigns.yaml`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import AfterValidator, Field, model_validator

from accelstudy.approaches import get_approach
from accelstudy.basics.errors import InputError
from accelstudy.basics.names import matches, path_name
from accelstudy.campaign.header import HEADER, TABLE
from accelstudy.campaign.importing.public import import_settings
from accelstudy.campaign.importing.settings import GravitySettings, ImportSettings
from accelstudy.config_names import KnownModel
from accelstudy.files.reading import config_hash, overlay
from accelstudy.files.validation import ConfigSection, Configuration, PathName, validate

KINDS = ("campaign", "log", "public")


def _known_approach(name: str) -> str:
    get_approach(name)
    return name


Approach = Annotated[str, AfterValidator(_known_approach)]


class Entry(ConfigSection):
    """One or more campaigns to calibrate, and what differs from the rest of the batch."""

    campaign: str | None = Field(None, description="folder of a campaign, or a pattern of folders")
    log: str | None = Field(None, description="raw log or table of means, or a pattern of files")
    public: str | None = Field(None, description="name of public data, see `accelstudy public`")
    name: PathName | None = Field(
        None, description="name of the results; by default that of the source"
    )
    model: KnownModel | None = Field(None, description="model; by default that of the batch")
    approach: Approach | None = Field(None, description="approach; by default that of the batch")
    gravity: GravitySettings | None = Field(None, description="instead of the campaign's own")
    settings: ImportSettings | None = Field(
        None,
        alias="import",
        description="how a log is read; of public data, what differs from the registry",
    )

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if sum(getattr(self, kind) is not None for kind in KINDS) != 1:
            raise ValueError(f"give exactly one of {', '.join(KINDS)}")
        if self.campaign is not None and self.settings is not None:
            raise ValueError("import: goes with log or public; a campaign is imported already")
        if self.public is not None:
            import_settings(self.public)
        return self

    @property
    def kind(self) -> str:
        """Kind of the source, one of `KINDS`."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def source(self) -> str:
        """Normalised path of the folder or file, or name of the public data."""
        return self.public or os.path.normpath(self.campaign or self.log or "")

    @property
    def matching(self) -> list[str] | None:
        """Paths that match a pattern; None if it names one thing."""
        wanted = os.path.isdir if self.kind == "campaign" else os.path.isfile
        return matches(self.source, wanted) if self.public is None else None

    def as_params(self) -> dict[str, Any]:
        """Keys that were given, as parameters of a rule."""
        return self.model_dump(mode="json", by_alias=True, exclude_unset=True)

    def files(self) -> list[str]:
        """Existing files on which the result depends; none for public data."""
        names = (HEADER, TABLE) if self.kind == "campaign" else ("",)
        paths = [Path(self.source, name) for name in names] if self.public is None else []
        return [str(path) for path in paths if path.is_file()]


class CampaignEntry(Entry):
    """One campaign to calibrate: an entry without patterns, and with all that it inherits."""

    name: PathName
    model: KnownModel


class BatchConfig(Configuration):
    """Campaigns that are calibrated and summarised together."""

    retired: ClassVar = {"lot": "`accelstudy lot` takes the folders of the campaigns"}

    batch: PathName = Field(description="name; results go to results/<batch>/")
    model: KnownModel = Field("bias-scale-nonorthogonality", description="model of all campaigns")
    approach: Approach | None = Field(
        None, description="approach of all; by default robot where a campaign has its angles"
    )
    public_folder: str = Field(
        "resources/public",
        description="folder with public files, in any subfolder; missing ones are downloaded to it",
    )
    campaigns: list[Entry] = Field(min_length=1)

    @model_validator(mode="after")
    def _names_differ(self) -> Self:
        sources: dict[str, str] = {}
        for task in self.tasks():
            if task.name in sources:
                raise ValueError(
                    f"campaigns: {sources[task.name]} and {task.source} are both named "
                    f"{task.name!r}; give one another `name`"
                )
            sources[task.name] = task.source
        return self

    def tasks(self) -> list[CampaignEntry]:
        """Campaigns in the order of the configuration, each with its name and all it inherits.

        Patterns match what is there now. A pattern leaves out what another entry names, so that
        this entry can differ from the rest.

        Raises
        ------
        InputError
            If nothing matches a pattern.
        """
        tasks = []
        found = [entry.matching for entry in self.campaigns]
        named = {e.source for e, paths in zip(self.campaigns, found, strict=True) if paths is None}
        for index, (entry, paths) in enumerate(zip(self.campaigns, found, strict=True)):
            if paths == []:
                what = "folder" if entry.kind == "campaign" else "file"
                raise InputError(f"campaigns.{index}: no {what} matches {entry.source}")
            for source in [entry.source] if paths is None else paths:
                if paths is not None and source in named:
                    continue
                path = Path(os.path.abspath(source))
                names = {"campaign": path.name, "log": path.stem, "public": source}
                inherited = {
                    **entry.model_dump(by_alias=True, exclude_unset=True),
                    entry.kind: source,
                    "name": entry.name or path_name(names[entry.kind], "campaign"),
                    "model": entry.model or self.model,
                    "approach": entry.approach or self.approach,
                }
                tasks.append(CampaignEntry.model_validate(inherited | _settings(entry)))
        return tasks

    @property
    def fingerprint(self) -> str:
        """Hash of the whole configuration, defaults included."""
        return config_hash(self.model_dump(mode="json"))


def parse_batch(content: Mapping[str, Any], source: str = "config") -> BatchConfig:
    """Check a configuration; raise `InputError` with one line that names the source and the key."""
    return validate(BatchConfig, content, source)


def _settings(entry: Entry) -> dict[str, Any]:
    """How a file is imported; for public data the entry overlays what the registry says."""
    if entry.kind == "campaign":
        return {}
    content = import_settings(entry.public).model_dump(exclude_unset=True) if entry.public else {}
    if entry.name is not None:
        content["name"] = entry.name
    if entry.settings is not None:
        content = overlay(content, entry.settings.model_dump(exclude_unset=True))
    if entry.gravity is not None:
        content["gravity"] = entry.gravity.model_dump()
    return {"import": content}
