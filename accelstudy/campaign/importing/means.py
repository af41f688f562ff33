"""From a table of means to a campaign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import MGON, UNITS
from accelstudy.campaign.checks import OPPOSITE, better_angles
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.making import (
    ImportReport,
    far_from_gravity,
    imported_campaign,
)
from accelstudy.campaign.importing.opening import open_source
from accelstudy.campaign.importing.recording import AXES, locate
from accelstudy.campaign.importing.settings import ImportSettings, named_after
from accelstudy.campaign.importing.sources import LogFile, Source, counted_from_first
from accelstudy.campaign.session import Campaign
from accelstudy.sensors.conversion import LARGEST, conversion_of

Array = NDArray[np.float64]

SDS = ("sd_fx", "sd_fy", "sd_fz")
ANGLES = ("roll", "pitch")
MEANS = (*AXES, "n_samples", *SDS, "temperature", "vibration", *ANGLES, "yaw")
"""Columns that a table of means may have, besides its time."""
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
        Its `columns` are those of `MEANS`. Settings of the detector do not matter. With `robot`
        the columns roll, pitch and perhaps yaw are the robot's angles, in the convention of the
        frame.

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
    conversion = conversion_of(settings.unit, settings.scale, settings.offset)
    source = open_source(path, settings.variable)
    values, warnings = _columns(source, settings)
    frame = settings.axes

    n_samples = None
    if "n_samples" in values:
        n_samples = np.round(values["n_samples"]).astype(int)
        if np.any(n_samples < 1):
            raise InputError(f"{path}: column n_samples: must be positive")
    sd = None
    if all(key in values for key in SDS):
        sd = frame.rearranged(np.column_stack([values[key] for key in SDS]) * abs(conversion.scale))
        if np.any(sd < 0):
            raise InputError(f"{path}: columns sd_fx, sd_fy, sd_fz: must not be negative")
    sigma: float | None = None
    if sd is not None and n_samples is not None and np.any(sd > 0):
        sigma = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
        warnings.append("sigma of a mean assumes white noise; coloured noise makes it larger")
    forces = frame.to_frd(conversion.to_si(np.column_stack([values[axis] for axis in AXES])))
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
            right = "another --frame" if better == OPPOSITE else f"--robot-unit {better}"
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


def _columns(source: Source, settings: ImportSettings) -> tuple[dict[str, Array], list[str]]:
    """Columns by their keys, and warnings about columns that are not used."""
    given = settings.columns
    for key in given:
        if key not in MEANS:
            raise UnknownNameError("column", key, MEANS)

    def places_of(keys: tuple[str, ...], needed: bool = False) -> dict[str, int]:
        return locate(source, {k: given[k] for k in keys if k in given}, keys, needed)

    places = places_of(AXES, needed=True)
    places |= places_of(("n_samples", *SDS, "temperature", "vibration"))
    warnings = []
    angles = places_of((*ANGLES, "yaw"))
    if settings.robot is not None:
        missing = [key for key in ANGLES if key not in angles]
        if missing:
            raise InputError(
                f"{source.path}: which column is the robot's {missing[0]}? Name it by "
                f"--columns {missing[0]}=..."
            )
        places |= angles
    elif {*angles} & {*given}:
        raise InputError(
            f"{source.path}: columns {', '.join(angles)}: give the standard deviation of the "
            "robot's angles (--robot-sigma)"
        )
    elif angles:
        warnings.append(
            f"columns {', '.join(angles)} are left out; --robot-sigma takes them for the robot's"
        )
    if settings.time is not None:
        places |= locate(source, {"time": settings.time}, ("time",))
    columns = source.numbers([*places.values()])
    if not len(columns[0]):
        raise InputError(f"{source.path}: no row of numbers")
    values = {}
    for key, column in zip(places, columns, strict=True):
        bad = ~np.isfinite(column) if key == "time" else ~(np.abs(column) <= LARGEST)
        if bad.any():
            where, cell = source.look_up(int(np.argmax(bad)), places[key])
            raise InputError(
                f"{source.path}: {where}, column {source.names[places[key]]} ({key}): "
                f"{cell}, not a usable number"
            )
        values[key] = column.astype(float)
    if "time" in places:
        factor = 1e-9 if places["time"] in source.dates else UNITS["s"][settings.time_unit]
        time, first = counted_from_first(columns[[*places].index("time")])
        values["time"] = (time + (first if abs(first * factor) < _YEARS else 0.0)) * factor
    return values, warnings
