"""Apply a calibration to a log and level with it, a chunk of rows at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics import bounds
from accelstudy.basics.progress import track
from accelstudy.basics.units import attitude_unit, display_unit, to_attitude, to_display
from accelstudy.campaign.logs.columns import AXES
from accelstudy.campaign.logs.sources import CHUNK
from accelstudy.campaign.logs.tables import chunk_writer, is_parquet
from accelstudy.campaign.use.account import NEAR_POLE, Account, clipped
from accelstudy.campaign.use.applying import Calibration
from accelstudy.campaign.use.readings import Readings, readings_of
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import near_pole
from accelstudy.sensors.frames import Frame

Array = NDArray[np.float64]

DECIMALS = 9
"""Decimals of the added columns: far below any noise, and half the digits of a double."""


@dataclass(frozen=True)
class Leveled:
    """Summary of a leveled log.

    Attributes
    ----------
    rows : int
    empty : int, rows without a calibrated force
    warnings : tuple of str
    """

    rows: int
    empty: int
    warnings: tuple[str, ...]


def level_log(
    calibration: Calibration,
    log: str | Path,
    out: str | Path,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
    chunk_size: int = CHUNK,
) -> Leveled:
    """Write a log with calibrated forces, roll and pitch and their standard deviations.

    Forces and angles are in the axes of the log. A row gets empty cells if a reading is missing, or
    if no force explains it.

    Parameters
    ----------
    calibration : Calibration
    log : file with the raw log; see `readings_of`
    out : CSV or Parquet file to write; if that fails, there is none
    given : mapping, optional
        How to read the log; see `readings_of`.
    sigma : float, m/s², noise of a reading; see `noise_of_reading` if omitted
    start : float, s, from the start of the calibration session to the first row; 0 if omitted
    chunk_size : int, rows held in memory at a time

    Raises
    ------
    InputError
        If the log cannot be read, lacks a column that an effect of the calibration needs, or is so
        far from gravity in most rows that it must be in another unit.
    """
    readings = readings_of(log, calibration, given, start or 0.0)
    if sigma is not None:
        bounds.SIGMA_READING.check_key("--sigma", sigma)
    noise = noise_of_reading(calibration) if sigma is None else sigma
    account = Account(calibration, readings)
    with chunk_writer(out) as write:
        chunks = readings.chunks(chunk_size, typed=is_parquet(out))
        for table, forces, hold in track(chunks, "leveling"):
            corrected, near, added = _leveled(calibration, readings.frame, forces, hold, noise)
            account.add(table, forces, corrected, near, hold)
            write(_with(table, added))
        account.close()
    assumed = account.assumptions() if start is None else ()
    doubts = (*_implausible(calibration), *_mended(calibration, readings), *_estimated(calibration))
    warnings = (*doubts, *assumed, *account.warnings())
    return Leveled(account.rows, account.empty, warnings)


def _implausible(calibration: Calibration) -> tuple[str, ...]:
    """Warn that no sensor can have such a calibration."""
    quality = calibration.content["quality"]
    if quality["plausible"]:
        return ()
    return (f"do not use this calibration: {'; '.join(quality['warnings'])}",)


def _mended(calibration: Calibration, readings: Readings) -> tuple[str, ...]:
    """Say that the calibration is of mended data, and whether readings were mended, too."""
    mended = calibration.content.get("mended")
    if mended is None:
        return ()
    warning = f"the calibration is of mended data: {mended['reason']}"
    if mended["matrix"] is None:
        return (warning,)
    if np.array_equal(readings.mending, np.eye(3)):
        return (f"{warning}; readings are converted by the options only, and are not mended",)
    return (f"{warning}; readings are mended in the same way",)


def _estimated(calibration: Calibration) -> tuple[str, ...]:
    """Say how many sigmas hold 95 %, if a calibration with few residuals makes that more than 2."""
    needed = calibration.content["sigmas_95"] or 0.0
    if needed <= 2:
        return ()
    return (
        "the sigmas of the calibration come from few residuals: to hold 95 % of the errors it "
        f"takes up to {needed:.2f} sigmas of roll and pitch",
    )


def noise_of_reading(calibration: Calibration) -> float:
    """Noise of a reading, m/s²: the noise within the holds of the campaign.

    If that is unknown it is the noise of the mean of a hold, which is smaller; 0 if neither is
    known.
    """
    sigmas = (calibration.content.get(f"sigma_{what}_mps2") for what in ("reading", "position"))
    return next((sigma for sigma in sigmas if sigma is not None), 0.0)


def _leveled(
    calibration: Calibration, frame: Frame, forces: Array, hold: HoldConditions, noise: float
) -> tuple[Array, NDArray[np.bool_], dict[str, pa.Array]]:
    """Calibrated forces in frd of readings (k, 3), m/s², and the columns that are added.

    Between them, which rows (k,) are too close to the roll pole for their sigmas.
    """
    with np.errstate(all="ignore"):  # forces that are not finite are counted below
        corrected = calibration.correct(forces, hold)
        angles, sigmas = calibration.level(forces, noise, hold)
    lost = ~np.isfinite(corrected + angles[:, :1]).all(axis=1)
    lost |= clipped(calibration, forces).any(axis=1)
    corrected[lost] = np.nan
    shown = frame.from_frd(corrected)
    added = {f"{axis}_calibrated_mps2": shown[:, i] for i, axis in enumerate(AXES)}
    for i, angle in enumerate(("roll", "pitch")):
        added[f"{angle}_{attitude_unit()}"] = frame.signs[i] * to_attitude(angles[:, i])
        added[f"sigma_{angle}_{display_unit('rad')}"] = to_display(sigmas[:, i], "rad")
    columns = {
        name: pa.array(np.round(values, DECIMALS), mask=lost | ~np.isfinite(values))
        for name, values in added.items()
    }
    near = ~lost & near_pole(angles, sigmas)
    return corrected, near, {**columns, NEAR_POLE: pa.array(near, mask=lost)}


def _with(table: pa.Table, added: dict[str, pa.Array]) -> pa.Table:
    """Table with added columns; existing columns of the same name are replaced."""
    for name, column in added.items():
        if name in table.column_names:
            table = table.set_column(table.column_names.index(name), name, column)
        else:
            table = table.append_column(name, column)
    return table
