"""Apply a calibration to a log and level with it, a chunk of rows at a time."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.campaign.applying import Calibration
from accelstudy.campaign.export import raw_conversion
from accelstudy.campaign.log_files import CHUNK
from accelstudy.campaign.log_tables import chunk_writer, read_chunks
from accelstudy.campaign.wording import listed
from accelstudy.errors import InputError
from accelstudy.units import GON, MGON

Array = NDArray[np.float64]


def level_log(
    calibration: Calibration,
    log: str | Path,
    out: str | Path,
    columns: Sequence[str] = ("fx", "fy", "fz"),
    sigma: float | None = None,
    chunk_size: int = CHUNK,
) -> None:
    """Write a log with calibrated forces, roll and pitch and their standard deviations.

    Parameters
    ----------
    calibration : Calibration
    log : CSV or Parquet file, in the unit of the campaign
    out : CSV or Parquet file; whole or not there
    columns : names of the three columns of the log
    sigma : float, m/s², noise of a reading; that of a position of the campaign if omitted
    chunk_size : int, rows held in memory at a time

    Raises
    ------
    InputError
        If the log cannot be read, lacks a column, or has something else than numbers there.
    """
    chunks = read_chunks(log, chunk_size)
    first = next(chunks)  # before anything is written
    missing = [name for name in columns if name not in first.column_names]
    if missing or len(set(columns)) != 3:
        raise InputError(
            f"{log}: --columns must name three columns of {listed(first.column_names)}"
        )
    scale, offset = raw_conversion(calibration.content)
    noise = calibration.content["sigma_position_mps2"] if sigma is None else sigma
    row = 0
    with chunk_writer(out) as write:
        for chunk in chain([first], chunks):
            forces = (_numbers(chunk, columns, row, log) - offset) * scale
            added = _leveled(calibration, forces, noise or 0.0)
            if len(bad := np.flatnonzero(~np.isfinite(added["roll_gon"] + added["pitch_gon"]))):
                raise InputError(
                    f"{log}: row {row + bad[0] + 1}: the calibration makes no force of it"
                )
            write(_with(chunk, added))
            row += len(chunk)


def _numbers(chunk: pa.Table, columns: Sequence[str], row: int, log: str | Path) -> Array:
    """Columns of a chunk that begins at `row`, (k, 3)."""
    values = chunk.select(columns).to_pandas().apply(pd.to_numeric, errors="coerce")
    numbers = values.to_numpy(float, na_value=np.nan)
    bad = np.flatnonzero(~np.isfinite(numbers).all(axis=1))
    if len(bad):
        raise InputError(
            f"{log}: row {row + bad[0] + 1}: {listed(columns)} must be three finite numbers"
        )
    return numbers


def _leveled(calibration: Calibration, forces: Array, noise: float) -> dict[str, Array]:
    """What is added to readings (k, 3) in m/s²."""
    with np.errstate(all="ignore"):  # what is not finite is found, or a sigma without a meaning
        corrected = calibration.correct(forces)
        angles, sigmas = calibration.level(forces, noise)
    added = {f"f{axis}_calibrated_mps2": corrected[:, i] for i, axis in enumerate("xyz")}
    for i, angle in enumerate(("roll", "pitch")):
        added[f"{angle}_gon"] = angles[:, i] / GON
        added[f"sigma_{angle}_mgon"] = sigmas[:, i] / MGON
    return added


def _with(table: pa.Table, added: dict[str, Array]) -> pa.Table:
    """Table with columns added; those that it had by these names are replaced."""
    for name, values in added.items():
        if name in table.column_names:
            table = table.set_column(table.column_names.index(name), name, pa.array(values))
        else:
            table = table.append_column(name, pa.array(values))
    return table
