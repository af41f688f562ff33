"""From a table of means to a campaign."""

from __future__ import annotations

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON, UNITS
from accelstudy.campaign.checks import OPPOSITE, better_angles
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.making import (
    ImportReport,
    far_from_gravity,
    imported_campaign,
)
from accelstudy.campaign.importing.recording import Log, read_log
from accelstudy.campaign.importing.settings import ImportSettings, named_after
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.campaign.session import Campaign

Array = NDArray[np.float64]

SDS = ("sd_fx", "sd_fy", "sd_fz")
ANGLES = ("roll", "pitch")
MEANS = ("n_samples", *SDS, "temperature", "vibration", *ANGLES, "yaw")
"""Columns that a table of means may have, besides its forces and its time."""
_YEARS = 1e8  # s; no session lasts for years, so later times count from 1970


def import_means(
    path: LogFile, settings: ImportSettings | None = None
) -> tuple[Campaign, ImportReport]:
    """Make a campaign of a table of means, one row for each position.

    Parameters
    ----------
    path : anything that `open_source` opens; a MATLAB array may have a column for each
        position instead
    settings : ImportSettings, optional
        Its `columns` are the forces and those of `MEANS`. Settings of the detector do not matter.
        With `robot` the columns roll, pitch and perhaps yaw are the robot's angles, in the
        convention of the frame.

    Returns
    -------
    Campaign
        It has a `sigma_force` if the table has numbers of samples and their standard deviations:
        that of white noise, since a table of means does not say more.
    ImportReport

    Raises
    ------
    InputError
        If the table cannot be read.
    """
    settings = named_after(settings or ImportSettings(), [path])
    wanted = [*(["time"] if settings.time is not None else []), *MEANS]
    log = read_log(path, settings, conditions=wanted, untimed=True)
    settings, frame = cast(ImportSettings, log.layout), log.layout.axes
    values, warnings = _values(log, settings)
    forces, scale = log.rows.forces, abs(log.conversion.scale)

    n_samples = None
    if "n_samples" in values:
        n_samples = np.round(values["n_samples"]).astype(int)
        if np.any(n_samples < 1):
            raise InputError(f"{path}: column n_samples: must be positive")
    sd = None
    if all(key in values for key in SDS):
        sd = frame.rearranged(np.column_stack([values[key] for key in SDS]) * scale)
        if np.any(sd < 0):
            raise InputError(f"{path}: columns sd_fx, sd_fy, sd_fz: must not be negative")
    sigma: float | None = None
    if sd is not None and n_samples is not None and np.any(sd > 0):
        sigma = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
        warnings.append("sigma of a mean assumes white noise; coloured noise makes it larger")
    warnings += far_from_gravity(settings, forces)
    campaign = imported_campaign(
        path,
        settings,
        forces,
        sigma_force=sigma,
        n_samples=n_samples,
        sd=sd,
        time=values.get("time"),
        temperature=values.get("temperature"),
        vibration=values.get("vibration"),
        log=_layout(settings),
        warnings=tuple(warnings),
    )
    if settings.robot is not None:
        given, signs = settings.robot.unit, frame.signs
        unit = UNITS["rad"][given]
        angles = np.column_stack([values[key] for key in ANGLES]) * signs[:2]
        if better := better_angles(angles, given, campaign.forces, campaign.gravity):
            right = "another `frame`" if better == OPPOSITE else f"`robot_unit` {better}"
            raise InputError(
                f"{path}: the robot's angles do not fit the forces in {given}; {right} would be "
                "right"
            )
        yaw = values.get("yaw")
        campaign = replace(
            campaign,
            angles=angles * unit,
            yaw=None if yaw is None else yaw * unit * signs[2],
            sigma_angle=settings.robot.angle_sigma_mgon * MGON,
        )
    return campaign, ImportReport(len(forces), None, sigma, None, (), tuple(warnings))


def _layout(settings: ImportSettings) -> LogLayout:
    """Layout of logs of the same sensor: unit and axes of the table, but not its columns."""
    return LogLayout.model_validate(
        settings.model_dump(include={"unit", "scale", "offset", "frame"}, exclude_none=True)
    )


def _values(log: Log, settings: ImportSettings) -> tuple[dict[str, Array], list[str]]:
    """Columns besides the forces by their keys, and warnings about columns that are not used."""
    rows, warnings = log.rows, []
    values = dict(rows.conditions)
    angles = [key for key in (*ANGLES, "yaw") if key in values]
    if settings.robot is not None:
        for missing in (key for key in ANGLES if key not in angles):
            raise InputError(
                f"{log.path}: which column is the robot's {missing}? Name it by "
                f"`columns` {missing}=..."
            )
    elif {*angles} & {*settings.columns}:
        raise InputError(
            f"{log.path}: columns {', '.join(angles)}: give the standard deviation of the "
            "robot's angles (`robot_sigma`)"
        )
    elif angles:
        warnings.append(
            f"columns {', '.join(angles)} are left out; `robot_sigma` takes them for the robot's"
        )
        values = {key: column for key, column in values.items() if key not in angles}
    if not len(rows.forces):
        raise InputError(f"{log.path}: no row of numbers")
    for key, bad in {**rows.lost, **{k: np.isnan(v) for k, v in values.items()}}.items():
        if bad.any():
            what = log.describe(int(np.argmax(bad)), key)
            raise InputError(f"{log.path}: {what}, not a usable number")
    if "time" in log.places and rows.time is not None:
        values["time"] = rows.time + (rows.start if abs(rows.start) < _YEARS else 0.0)
    return values, warnings
