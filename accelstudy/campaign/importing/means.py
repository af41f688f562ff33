"""Tables of means, a row for each position."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON, UNITS
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.noise import sigma_text
from accelstudy.campaign.importing.recording import SDS, SensorLog, read_log
from accelstudy.campaign.importing.settings import ImportSettings
from accelstudy.campaign.importing.sources import Source

ANGLES = ("roll", "pitch")
MEANS = ("n_samples", *SDS, "temperature", "vibration", *ANGLES, "yaw")
"""Columns that a table of means may have, besides its forces and its time."""
_YEARS = 1e8  # s; no session lasts for years, so later times count from 1970


def read_means(
    file: Source, settings: ImportSettings
) -> tuple[ImportSettings, NDArray[np.float64], dict[str, Any]]:
    """Read a table of means, one row for each position; a MATLAB array may have columns instead.

    The columns are the forces and those of `MEANS`. With `robot` roll, pitch and perhaps yaw are
    the robot's angles, in the convention of the frame.

    Returns
    -------
    settings : ImportSettings, with what the table tells
    forces : (n, 3) array, m/s²
    columns : dict, what the campaign gets besides. It has a `sigma_force` if the table has numbers
        of samples and their standard deviations: that of white noise, since a table of means does
        not say more.
    """
    wanted = [*(["time"] if settings.time is not None else []), *MEANS]
    log = read_log(file, settings, conditions=wanted, untimed=True)
    settings, frame = cast(ImportSettings, log.layout), log.layout.axes
    rows, warnings = _rows(log, settings)
    columns: dict[str, Any] = {}
    if "n_samples" in rows:
        columns["n_samples"] = n_samples = np.round(rows["n_samples"]).astype(int)
        if np.any(n_samples < 1):
            raise InputError(f"{file}: column n_samples: must be positive")
    if {*SDS} <= rows.keys():
        sd = frame.to_frd_order(np.column_stack([rows[k] for k in SDS]) * abs(log.conversion.scale))
        columns["sd"] = sd
        if np.any(sd < 0):
            raise InputError(f"{file}: columns sd_fx, sd_fy, sd_fz: must not be negative")
        if "n_samples" in columns and np.any(sd > 0):
            columns["sigma_force"] = float(np.sqrt(np.mean(sd**2 / n_samples[:, None])))
            warnings.append("sigma of a mean assumes white noise; coloured noise makes it larger")
    columns |= {k: rows[k] for k in ("time", "temperature", "vibration") if k in rows}
    if settings.robot is not None:
        unit, signs = UNITS["rad"][settings.robot.unit], frame.signs
        angles = np.column_stack([rows[key] for key in ANGLES]) * signs[:2]
        columns |= {"angles": angles * unit, "sigma_angle": settings.robot.angle_sigma_mgon * MGON}
        if "yaw" in rows:
            columns["yaw"] = rows["yaw"] * unit * signs[2]
    # Logs of the sensor have the unit and the axes of the table, but not its columns.
    layout = settings.model_dump(include={"unit", "scale", "offset", "frame"}, exclude_none=True)
    sigma = columns.get("sigma_force")
    said = f"sigma of a mean: {'unknown' if sigma is None else sigma_text(sigma)}"
    columns |= {
        "log": LogLayout.model_validate(layout),
        "notes": (f"{len(log.forces)} positions; {said}",),
        "warnings": tuple(warnings),
    }
    return settings, log.forces, columns


def _rows(
    log: SensorLog, settings: ImportSettings
) -> tuple[dict[str, NDArray[np.float64]], list[str]]:
    """Columns of the rows without those that are not used, and warnings about these."""
    rows, warnings = dict(log.rows), []
    angles = [key for key in (*ANGLES, "yaw") if key in rows]
    if settings.robot is not None:
        for missing in (key for key in ANGLES if key not in angles):
            raise InputError(
                f"{log.path}: which column is the robot's {missing}? Name it by "
                f"`columns` {missing}=..."
            )
    elif angles:
        warnings.append(
            f"columns {', '.join(angles)} are left out; `robot_sigma` takes them for the robot's"
        )
        rows = {key: values for key, values in rows.items() if key not in angles}
    if not len(log.forces):
        raise InputError(f"{log.path}: no row of numbers")
    for row in np.flatnonzero(np.isnan([*rows.values()]).any(axis=0)):
        key = next(key for key in log.lacking(int(row)) if key in rows)
        raise InputError(f"{log.path}: {log.describe(int(row), key)}, not a usable number")
    if "time" in log.places and abs(log.start) < _YEARS:
        rows["time"] = rows["time"] + log.start
    return rows, warnings
