"""Campaigns of a program: found in a log, read from a folder, or simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from os import PathLike
from pathlib import Path
from typing import Any, get_type_hints

from pydantic import ConfigDict, create_model

from accelstudy.api.given import GRAVITY, for_programs, names, path_of, python_words, quantity
from accelstudy.api.logs import Log, log_of
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import STANDARD_GRAVITY, Given
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
    "sigma_angle": Given("rad"),
    "gravity": GRAVITY,
    "interval": Given("s"),
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
def simulate_campaign(
    *,
    name: str = "simulated",
    seed: int = 1,
    scheme: str = "mclaren-24",
    repeats: int = 1,
    repeat_first: int = 0,
    order: str = "scheme",
    approach: str = "robot",
    model: str = "bias-scale-nonorthogonality",
    effects: str | Sequence[str] = (),
    size: float = 1.0,
    noise_effects: str | Sequence[str] = (),
    gross_errors: str | Sequence[str] = (),
    sigma: float | str = 0.002,
    sigma_known: bool = True,
    sigma_angle: float | str = "3.2 mgon",
    gravity: float | str = STANDARD_GRAVITY,
    interval: float | str | None = 60.0,
    temperature: tuple[float, float] | None = None,
    temperature_order: str = "linear",
    vibration: tuple[float, float] | None = None,
    yaw: str = "none",
    n_samples: int | None = None,
) -> Campaign:
    """Simulate a campaign with effects of your choice.

    What is not given is drawn at random, from the seed.

    Parameters
    ----------
    name : str
        Name of the campaign.
    seed : int
        Seed of all random numbers.
    scheme : str
        Positions: a name that `accelstudy schemes` lists, or a file.
    repeats : int
        How often the scheme is measured.
    repeat_first : int
        First holds that are measured again at the end.
    order : str
        Order of the holds: scheme or random.
    approach : str
        By gravity alone, or with the angles of a robot, too.
    model : str
        Effects that the sensor has; their parameters are drawn, of typical size.
    effects : str, or several
        Effects beside the model, as "warm_up(tau=400)" or, with their parameters in SI,
        "thermal_bias: 0.004, -0.002, 0.001"; one of an effect of the model replaces it.
    size : float
        Factor of the typical size of each effect without parameters.
    noise_effects : str, or several
        As "heavy_tails(nu=3)".
    gross_errors : str, or several
        As "row_order(first=3, second=4)".
    sigma : float in m/s², or str with a unit
        Standard deviation of a position's mean.
    sigma_known : bool
        Whether the campaign states it.
    sigma_angle : float in rad, or str with a unit
        Standard deviation of the robot's roll and pitch.
    gravity : float in m/s², or str with a unit
        Local gravity.
    interval : float in s, or str with a unit
        Time between holds; without time if None.
    temperature : two of float, °C
        First and last temperature.
    temperature_order : str
        Course of the temperature: linear, ABBA or random.
    vibration : two of float, m/s²
        Lowest and highest rms.
    yaw : str
        Yaw of the holds: none or random.
    n_samples : int
        Samples of a hold; adds columns on them.

    Raises
    ------
    InputError
        If a name is unknown or a value is wrong.
    """
    settings = dict(locals())
    for key, given in _QUANTITIES.items():
        if settings[key] is not None:
            settings[key] = quantity(key, settings[key], given)
    for key in _NAMES:
        settings[key] = names(key, settings[key])
    content = checked(_Settings, settings, "simulate_campaign")
    return simulated(CampaignSettings(**content.model_dump()))[0]
