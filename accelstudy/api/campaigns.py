"""Campaigns of a program: found in a log, read from a folder, or simulated."""

from __future__ import annotations

from dataclasses import fields, replace
from os import PathLike
from pathlib import Path
from typing import Any, get_type_hints

from pydantic import ConfigDict, create_model

from accelstudy.api.given import GRAVITY, for_programs, names, path_of, python_words, quantity
from accelstudy.api.logs import Log, log_of
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import Given
from accelstudy.campaign.format import read_campaign as read_folder
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import parse_settings
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.simulated import CampaignSettings
from accelstudy.campaign.simulated import simulate_campaign as simulated
from accelstudy.files.validation import checked
from accelstudy.planning.quantities import QUANTITIES

_QUANTITIES = {
    "sigma": QUANTITIES["sigma"],
    "sigma_angle": Given("rad", "", "Noise of the robot's angles."),
    "gravity": GRAVITY,
    "interval": Given("s", "", "Time between holds."),
}
_NAMES = ("effects", "noise_effects", "gross_errors")
_TYPES = get_type_hints(CampaignSettings)
_KEYS: Any = {each.name: (_TYPES[each.name], each.default) for each in fields(CampaignSettings)}
_Settings = create_model("Settings", __config__=ConfigDict(extra="forbid"), **_KEYS)


@for_programs
def find_holds(log: Log, *, gravity: float | str | None = None, **settings: Any) -> Campaign:
    """Find the static holds of a log.

    Parameters
    ----------
    log : Log, or what `read_log` takes
    gravity : float in m/s² or str with a unit, optional; standard gravity if omitted
    settings
        Other keys of the settings of ``accelstudy import``, as ``exclude`` or ``window_s``.

    Returns
    -------
    Campaign, with what was found and assumed in `notes`, and what the user should know in
    `warnings`

    Raises
    ------
    InputError
        If the log cannot be read, has no holds, or a setting is wrong.
    """
    log = log_of(log)
    content = {"name": Path(log.name).stem, **log.layout, **settings}
    if gravity is not None:
        content["gravity"] = {"value_mps2": quantity("gravity", gravity, GRAVITY)}
    given = parse_settings(content, "find_holds")
    if given.sensors:
        raise InputError("sensors: several sensors make several campaigns; give the columns of one")
    campaign, report = import_log(log.file, given)
    notes, warnings = (
        tuple(map(python_words, each)) for each in (report.lines(), campaign.warnings)
    )
    return replace(campaign, notes=notes, warnings=warnings)


@for_programs
def read_campaign(folder: str | PathLike[str], *, plausible: bool = True) -> Campaign:
    """Read a campaign from its folder; see `accelstudy.campaign.format.read_campaign`.

    Parameters
    ----------
    folder : path
    plausible : bool
        Whether data that cannot be right, as of wrong units, is refused; `diagnose` tells what is
        wrong with it, too.
    """
    return read_folder(path_of("folder", folder), plausible=plausible)


@for_programs
def simulate_campaign(**settings: Any) -> Campaign:
    """Simulate a campaign.

    Parameters
    ----------
    settings
        Those of `accelstudy.campaign.simulated.CampaignSettings`. Quantities may be texts with
        their units, and a single effect stands for a list of one.

    Raises
    ------
    InputError
        If a setting is unknown or wrong.
    """
    for key, given in _QUANTITIES.items():
        if settings.get(key) is not None:
            settings[key] = quantity(key, settings[key], given)
    for key in _NAMES:
        if key in settings:
            settings[key] = names(key, settings[key])
    content = checked(_Settings, settings, "simulate_campaign")
    return simulated(CampaignSettings(**content.model_dump()))[0]
