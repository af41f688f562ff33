"""The folder of a new study: a Snakefile, a configuration, profiles and a README."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import yaml

from accelstudy.basics.plugins import file_key
from accelstudy.basics.units import MGON, STANDARD_GRAVITY
from accelstudy.campaign.format import write_campaign
from accelstudy.campaign.simulated import CampaignSettings, simulate_campaign
from accelstudy.effects import get_effect
from accelstudy.files.outputs import STUDY, result_folder
from accelstudy.files.shipped import shipped

TEMPLATE = Path(__file__).with_name("template")
TEMPLATES = {
    "study": "A Monte Carlo study of accelerometer calibrations",
    "campaigns": "A batch of measured campaigns",
}
"""What may be set up, and what it is."""
RETIRED = {
    "plan": "`accelstudy plan` needs no folder",
    "diagnose": "`accelstudy simulate-campaign` and `accelstudy diagnose` need no folder",
}
"""Templates of earlier versions, and what takes their place."""
UNITS = {"bias": ("m/s^2", 1.0), "scale": ("ppm", 1e-6), "nonorthogonality": ("mgon", MGON)}
"""Unit of the true errors in a configuration, and its size in SI."""
OF_THE_PAPER = {
    "bias": (0.05, 0.01, 0.03),
    "scale": (200e-6, 200e-6, 200e-6),
    "nonorthogonality": (12 * MGON, 12 * MGON, 44 * MGON),
}
"""True errors that the paper simulates, SI."""


@dataclass(frozen=True)
class NewSensor:
    """The sensor of a new study; by default that of the paper. Everything is in SI.

    Attributes
    ----------
    sigma, sigma_angle : float, of the mean of a position, and of the robot's angles
    noise : str, what the first is of
    gravity : float
    errors : dict of the name of an effect to the true values of its parameters
    source : dict of the name of an effect to where its values come from
    campaign : Path of its campaign, if there is one
    """

    sigma: float = 0.002
    sigma_angle: float = 3.2 * MGON
    noise: str = "of the paper"
    gravity: float = STANDARD_GRAVITY
    errors: dict[str, tuple[float, ...]] = field(default_factory=lambda: dict(OF_THE_PAPER))
    source: dict[str, str] = field(default_factory=dict)
    campaign: Path | None = None


def new_study(
    folder: Path, template: str = "study", sensor: NewSensor | None = None, force: bool = False
) -> str:
    """Write the folder of a new study.

    Parameters
    ----------
    folder : Path, made if it is not there
    template : str, one of `TEMPLATES`
    sensor : NewSensor, by default that of the paper
    force : bool, whether to replace files of the same names

    Returns
    -------
    str, the name of the study, which is that of the folder as far as a configuration allows it

    Raises
    ------
    InputError
        If the folder is not empty, or cannot be written.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    name = re.sub(r"[^A-Za-z0-9]+", "-", folder.resolve().name).strip("-") or "study"
    sensor = sensor or NewSensor()
    jinja = Environment(
        loader=FileSystemLoader(TEMPLATE, encoding="utf-8"),
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    jinja.filters["numbers"] = _numbers
    words = {"name": name, "template": template, "what": TEMPLATES[template], "sensor": sensor}
    effects = [(get_effect(effect), *UNITS[effect]) for effect in sensor.errors]
    sources = {
        "Snakefile": f"{template}.smk",
        "config/config.yaml": f"{template}.yaml",
        "README.md": "README.md",
    }
    inputs = [] if sensor.campaign is None else [sensor.campaign]
    with result_folder(folder, STUDY, inputs, force=force) as new:
        (new / "config").mkdir()
        for target, source in sources.items():
            text = jinja.get_template(source).render(**words, effects=effects, mgon=MGON)
            (new / target).write_text(text, encoding="utf-8")
        if named := file_key():  # the workflow runs in the new folder
            named = {k: {os.path.abspath(p): d for p, d in v.items()} for k, v in named.items()}
            with (new / "config" / "config.yaml").open("a", encoding="utf-8") as file:
                file.write(f"\n{yaml.safe_dump(named)}")
        shutil.copytree(shipped("profiles"), new / "profiles")
        if template == "campaigns" and sensor.campaign is None:  # an example, to begin with
            settings = CampaignSettings(
                name="example",
                sigma=sensor.sigma,
                gravity=sensor.gravity,
                effects=tuple(f"{k}: {_numbers(v)}" for k, v in sensor.errors.items()),
            )
            write_campaign(simulate_campaign(settings)[0], new / "campaigns" / "example")
    return name


def _numbers(values: Iterable[float], unit: float = 1.0, digits: int = 4) -> str:
    """Write numbers without an exponent, which not all readers of YAML take for a number."""
    return ", ".join(
        np.format_float_positional(value / unit, digits, unique=False, fractional=False, trim="-")
        for value in values
    )
