"""Campaigns that are found in logs, or simulated, for the public functions."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from accelstudy.api.logs import Log, keys_of, log_of
from accelstudy.basics.arguments import as_sequence, path_of
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.names import matches, natural
from accelstudy.campaign.importing.bags import BAG_OF_FOLDER
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import ImportSettings, parse_settings, read_settings
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.campaign.reference_log import ReferenceLog, open_reference
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.simulated import CampaignSettings
from accelstudy.campaign.simulated import simulate_campaign as simulate

OTHERS = ("reference_log", "reference", "reference_columns", "reference_offset", "settings")
"""Keywords of an import that no file of settings has."""


@dataclass(frozen=True)
class Import:
    """Log files, and the settings by which campaigns are made of them.

    Attributes
    ----------
    files : list of path, or the columns of a table in memory
    settings : ImportSettings
    reference : ReferenceLog, optional, of a calibrated sensor on the same plate
    """

    files: list[LogFile]
    settings: ImportSettings
    reference: ReferenceLog | None

    @classmethod
    def of(
        cls, log: Any, given: Mapping[str, Any], sensors: Mapping[str, list[str]] | None = None
    ) -> Import:
        """Read the settings and look for the files.

        Parameters
        ----------
        log : Log or path or DataFrame, or several paths
        given : mapping, keywords of `find_holds`, checked
        sensors : mapping of a name to three columns, of several sensors in one log
        """
        settings = settings_of(given, sensors or {})
        reference = _reference(*(given[name] for name in OTHERS[:-1]))
        if not isinstance(log, Log | pd.DataFrame):
            return cls([*files_of(as_sequence(log))], settings, reference)
        log = log_of(log, given)
        layout = settings.model_dump(exclude_unset=True) | log.layout
        return cls([log.file], parse_settings(layout), reference)

    def campaign(self) -> Campaign:
        """Campaign of the one sensor."""
        return import_log(self.files, self.settings, self.reference)[0]


def settings_of(
    given: Mapping[str, Any], sensors: Mapping[str, list[str]] | None = None
) -> ImportSettings:
    """Settings of a file, overlaid with those that were given as keywords."""
    own = {
        name: value for name, value in given.items() if name not in OTHERS and value is not False
    }
    content, names = keys_of({**own, "sensors": sensors or None})
    return read_settings(given["settings"], content, names)


def files_of(given: Iterable[str | PathLike[str]]) -> list[Path]:
    """Files named by paths of files and folders, and by patterns.

    Those of a folder or a pattern come in the order of their names, and pos2 before pos10. So do
    files in the order of the alphabet, which is how a shell lists them.

    Raises
    ------
    InputError
        If there is none.
    """
    files: list[Path] = []
    for path in (path_of("log", one, "a path or a DataFrame") for one in given):
        if path.is_dir() and not (path / BAG_OF_FOLDER).is_file():
            inside = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
            inside.sort(key=natural)
        else:
            found = matches(path, os.path.isfile)
            inside = [path] if found is None else [*map(Path, found)]
        if not inside:
            raise InputError(f"{path}: no file there")
        files += inside
    if files == sorted(files):
        files.sort(key=natural)
    twice = [path for path in files if files.count(path) > 1]
    if twice:
        raise InputError(f"{twice[0]}: the file is given twice")
    return files


def _reference(
    log: Path | None,
    calibration: Path | None,
    columns: dict[str, str] | None,
    offset: float | None,
) -> ReferenceLog | None:
    """Return the calibrated sensor on the same plate, if there is one."""
    of_log, of_calibration = key("reference_log"), key("reference")
    if log is None and calibration is None:
        more = {"reference_columns": columns, "reference_offset": offset}
        for name in (name for name, value in more.items() if value is not None):
            raise InputError(f"{key(name)}: goes with {of_log} and {of_calibration}")
        return None
    if calibration is None:
        raise InputError(f"{of_log}: give the calibration.json of that sensor by {of_calibration}")
    if log is None:
        raise InputError(f"{of_calibration}: give the raw log of that sensor by {of_log}")
    return open_reference(log, calibration, columns, offset)


# --- simulated ----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedCampaign(Campaign):
    """A campaign of which the truth is known.

    Attributes
    ----------
    truth : mapping, the settings, and everything that was drawn
    """

    truth: Mapping[str, Any] = field(default_factory=dict)


def simulate_from(settings: Mapping[str, Any]) -> SimulatedCampaign:
    """Simulate a campaign by the keywords of `simulate_campaign`, checked."""
    campaign, truth = simulate(CampaignSettings(**settings))
    values = {one.name: getattr(campaign, one.name) for one in fields(campaign)}
    return SimulatedCampaign(**values, truth=truth)
