"""Campaigns of a program: found in a log, read from a folder, or simulated."""

from __future__ import annotations

from dataclasses import fields
from os import PathLike
from typing import Any

from accelstudy.api.given import path_of, quantity
from accelstudy.api.logs import Log, log_of
from accelstudy.basics.errors import UnknownNameError
from accelstudy.basics.units import Given
from accelstudy.campaign.format import read_campaign as read_folder
from accelstudy.campaign.importing.logs import import_log
from accelstudy.campaign.importing.settings import parse_settings
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.simulated import CampaignSettings
from accelstudy.campaign.simulated import simulate_campaign as simulated

GRAVITY = Given("m/s^2", "", "Local gravity.")


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
    Campaign, with what the user should know in `warnings`

    Raises
    ------
    InputError
        If the log cannot be read, has no holds, or a setting is wrong.
    """
    log = log_of(log)
    content = {"name": log.path.stem, **log.layout, **settings}
    if gravity is not None:
        content["gravity"] = {"value_mps2": quantity("gravity", gravity, GRAVITY)}
    campaign, _ = import_log(log.path, parse_settings(content, "find_holds"))
    return campaign


def read_campaign(folder: str | PathLike[str]) -> Campaign:
    """Read a campaign from its folder; see `accelstudy.campaign.format.read_campaign`."""
    return read_folder(path_of("folder", folder))


def simulate_campaign(**settings: Any) -> Campaign:
    """Simulate a campaign.

    Parameters
    ----------
    settings
        Those of `accelstudy.campaign.simulated.CampaignSettings`.

    Raises
    ------
    InputError
        If a setting is unknown or wrong.
    """
    known = [each.name for each in fields(CampaignSettings)]
    for key in settings:
        if key not in known:
            raise UnknownNameError("setting", key, known)
    return simulated(CampaignSettings(**settings))[0]
