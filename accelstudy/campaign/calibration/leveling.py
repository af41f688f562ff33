"""Apply a calibration to a log and level with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.units import (
    attitude_unit,
    display_unit,
    to_attitude,
    to_display,
)
from accelstudy.basics.wording import counted, quantity_text, short_list
from accelstudy.campaign.calibration.applying import (
    FORCES,
    RANGE_MARGIN,
    SensorCalibration,
    noise_of_reading,
)
from accelstudy.campaign.calibration.device import KNOWN
from accelstudy.campaign.calibration.tables import ROWS, infer_types, is_parquet, write_table
from accelstudy.campaign.gross_errors.recognition import check_size
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.recording import AXES, CONDITIONS, Log, read_log
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.effects import HoldConditions, course_of_log
from accelstudy.files.validation import checked
from accelstudy.leveling.angles import near_pole
from accelstudy.sensors.frames import Frame

Array = NDArray[np.float64]

SATURATED_SHARE = 0.999
"""A reading beyond this part of the sensor's range is saturated: the last count is often below the
range."""

MANY_SIGMAS = 2.2
"""Sigmas that hold 95 % with 12 degrees of freedom; with more, 2 of them hold 93 % and above."""
NEAR_POLE = "near_pole"
"""Column that says whether a row is too close to the roll pole for its sigmas."""

OPTIONS = {
    "time": "`time` or `rate`",
    "temperature": "`columns` temperature=NAME",
    "vibration": "`columns` vibration=NAME",
}
"""Conditions that a log can hold, and the options that name their columns."""

DECIMALS = 9
"""Decimals of the added columns: far below any noise, and half the digits of a double."""


class Readings(NamedTuple):
    """The rows of a log, prepared for a calibration.

    Attributes
    ----------
    log : Log
    forces : (n, 3) array, m/s² in frd, mended as the data of the calibration were; NaN where a
        reading is missing or absurd
    hold : HoldConditions, what else is known of the rows, for effects that need it
    mended : bool, whether `forces` are not as they were read
    """

    log: Log
    forces: Array
    hold: HoldConditions
    mended: bool


def readings_of(
    log: LogFile,
    calibration: SensorCalibration,
    given: Mapping[str, Any] | None = None,
    start: float = 0.0,
) -> Readings:
    """Read a log; by default it is read like the log from which the campaign was made.

    Parameters
    ----------
    log : anything that `open_source` opens
    calibration : SensorCalibration
    given : mapping, optional
        Keys of `LogLayout`, which count before the layout of the campaign's log; see `read_log`.
    start : float, s, from the start of the calibration session to the first row

    Raises
    ------
    InputError
        If the file cannot be read, or lacks a column, perhaps one that an effect needs.
    """
    given = dict(given or {})
    needed = {condition for _, condition in calibration.needs}
    ranged = {key for key in CONDITIONS if KNOWN[key] in calibration.ranges}
    opened = read_log(
        log,
        checked(LogLayout, given, "options"),
        like=calibration.usual_layout,
        conditions=[key for key in OPTIONS if key in {*needed, *ranged, *given.get("columns", ())}],
        untimed=True,
    )
    timed = "time" if opened.layout.rate_hz is not None else ""
    for effect, condition in calibration.needs:
        if condition not in OPTIONS and not condition.startswith("step_"):
            raise InputError(
                f"{log}: the effect {effect} needs the {condition} of each row, which no log has; "
                "a calibration without this effect can be applied"
            )
        if condition in OPTIONS and condition not in (*opened.places, timed):
            raise InputError(
                f"{log}: the effect {effect} needs the {condition} of each row; "
                f"give it by {OPTIONS[condition]}"
            )
    table = opened.table  # before its numbers, so that the file is read once
    rows = opened.rows
    known = {name: rows[name].to_numpy() for name in ("time", *CONDITIONS) if name in rows}
    forces, temperature = rows[[*AXES]].to_numpy(), known.get("temperature")
    time = start + known["time"] if "time" in known else None
    course = None
    if time is not None and temperature is not None:
        course = course_of_log(time, temperature)
    # A log has no position before: effects that depend on it add nothing.
    still = np.zeros(len(table))
    hold = HoldConditions(
        time=time,
        temperature=temperature,
        vibration=known.get("vibration"),
        step_x=still,
        step_y=still,
        step_z=still,
        course=course,
    )
    # What the user says of this log is right, whatever was wrong with the campaign.
    option_of = {"unit_error": "unit", "axis_error": "frame"}
    mended = calibration.content.get("mended") or {"error": "", "matrix": None}
    mends = mended["matrix"] is not None and option_of.get(mended["error"]) not in given
    if mends:
        forces = forces @ calibration.mending.T
    return Readings(opened, forces, hold, mends)


@dataclass(frozen=True)
class Leveled:
    """A leveled log.

    Forces and angles are in the axes of the log. A row has empty cells if a reading is missing, or
    if no force explains it.

    Attributes
    ----------
    readings : Readings, with the rows as they were read
    added : mapping of columns: calibrated forces, roll and pitch and their standard deviations
    empty : int, rows without a calibrated force
    warnings : tuple of str
    """

    readings: Readings
    added: Mapping[str, pa.ChunkedArray]
    empty: int
    warnings: tuple[str, ...]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.readings.forces)

    def to_frame(self, frame: pd.DataFrame | None = None) -> pd.DataFrame:
        """Return the log with the added columns.

        Parameters
        ----------
        frame : DataFrame, optional
            The rows of the log as their owner has them, whose index and columns stay as they are;
            as they were read if omitted.
        """
        log = self.readings.log
        frame = infer_types(log.source, log.table).to_pandas() if frame is None else frame
        return frame.assign(**{name: column.to_numpy() for name, column in self.added.items()})

    def write(self, out: str | Path) -> None:
        """Write the log with the added columns, CSV or Parquet; if that fails, there is no file."""
        table = self.readings.log.table
        # The row labels that pandas writes as a column are not part of the log.
        labels = [name for name in table.column_names if name.startswith("__index_level_")]
        table = table.drop_columns(labels)
        if is_parquet(out):
            table = infer_types(self.readings.log.source, table)
        for name, column in self.added.items():
            if name in table.column_names:
                table = table.set_column(table.column_names.index(name), name, column)
            else:
                table = table.append_column(name, column)
        write_table(out, table)


def level(
    calibration: SensorCalibration,
    log: LogFile,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
) -> Leveled:
    """Level a log.

    Parameters
    ----------
    calibration : SensorCalibration
    log : anything that `open_source` opens
    given : mapping, optional
        How to read the log; see `readings_of`.
    sigma : float, m/s², noise of a reading; see `noise_of_reading` if omitted
    start : float, s, from the start of the calibration session to the first row; 0 if omitted

    Raises
    ------
    InputError
        If the log cannot be read, lacks a column that an effect of the calibration needs, or is so
        far from gravity in most rows that it must be in another unit.
    """
    readings = readings_of(log, calibration, given, start or 0.0)
    read, usable = readings.log, readings.forces[np.isfinite(readings.forces).all(axis=1)]
    if not len(usable):
        why = _reason(calibration, readings, 0)
        raise InputError(f"{read.path}: no row has three numbers; the first: {why}")
    check_size(f"{read.path}", usable, calibration.gravity, read.layout.unit, read.conversion)
    if sigma is not None:
        bounds.SIGMA_READING.check_key("`sigma`", sigma)
    noise = noise_of_reading(calibration) if sigma is None else sigma
    rows = np.arange(len(readings.forces))
    parts = []
    for first in track(range(0, max(1, len(rows)), ROWS), "leveling"):
        some = rows[first : first + ROWS]
        of_rows = readings.forces[some], readings.hold.take(some)
        parts.append(_leveled(calibration, read.layout.axes, *of_rows, noise))
    corrected, near = (np.concatenate([part[i] for part in parts]) for i in (0, 1))
    added = {name: pa.chunked_array([part[2][name] for part in parts]) for name in parts[0][2]}
    empty = np.isnan(corrected[:, 0])
    doubts = (
        *_of_calibration(calibration, readings),
        *(_assumptions(calibration) if start is None else ()),
        *_of_log(calibration, readings, empty, near),
        *_beyond_ranges(calibration.ranges, corrected, readings.hold),
    )
    return Leveled(readings, added, int(empty.sum()), doubts)


def _leveled(
    calibration: SensorCalibration, frame: Frame, forces: Array, hold: HoldConditions, noise: float
) -> tuple[Array, NDArray[np.bool_], dict[str, pa.Array]]:
    """Calibrated forces in frd of readings (k, 3), m/s², and the columns that are added.

    Between them, which rows (k,) are too close to the roll pole for their sigmas.
    """
    with np.errstate(all="ignore"):  # forces that are not finite are counted below
        corrected = calibration.correct(forces, hold)
        angles, sigmas = calibration.level(forces, noise, hold)
    lost = ~np.isfinite(corrected + angles[:, :1]).all(axis=1)
    full = calibration.content.get("range_mps2") or np.inf
    lost |= (np.abs(forces) >= SATURATED_SHARE * full).any(axis=1)
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


def _of_calibration(calibration: SensorCalibration, readings: Readings) -> Iterator[str]:
    """What the user should know about the calibration."""
    quality = calibration.content["quality"]
    if not quality["plausible"]:
        yield f"do not use this calibration: {'; '.join(quality['warnings'])}"
    if mended := calibration.content.get("mended"):
        how = ""
        if mended["matrix"] is not None:
            how = "; readings are converted by the options only, and are not mended"
            if readings.mended:
                how = "; readings are mended in the same way"
        yield f"the calibration is of mended data: {mended['reason']}{how}"
    needed = calibration.content["sigmas_95"] or 0.0
    if needed > MANY_SIGMAS:
        yield (
            "the noise in the sigmas of the calibration is hardly known: to hold 95 % of the "
            f"errors it takes up to {needed:.2f} sigmas of roll and pitch"
        )


def _assumptions(calibration: SensorCalibration) -> Iterator[str]:
    """Assumptions that are made if the user does not say when the log was started."""
    needs = calibration.needs
    warmed = {effect for effect, column in needs if column == "temperature"}
    timed = [e for e, column in needs if column == "time" and e not in warmed]
    lagging = [e for e, column in needs if column == "time" and e in warmed]
    if lagging:
        yield f"{short_list(lagging)}: assumes that the sensor has the temperature of row 1"
    if timed:
        yield (
            f"{short_list(timed)}: assumes that the first row is the start of the calibration "
            "session; if not, give the seconds between them by `start`"
        )


def _of_log(
    calibration: SensorCalibration,
    readings: Readings,
    empty: NDArray[np.bool_],
    near: NDArray[np.bool_],
) -> Iterator[str]:
    """What the user should know about the rows, of which some are empty or near the roll pole."""
    of_all, time = f"of {counted(len(empty), 'row')}", readings.hold.time
    yield from readings.log.source.warnings
    if empty.any():
        first = _reason(calibration, readings, int(np.argmax(empty)))
        yield f"{empty.sum()} {of_all} have no calibrated force and get empty cells; {first}"
    if near.any():
        yield (
            f"{near.sum()} {of_all} are too close to a pitch of "
            f"±{quantity_text(np.pi / 2, 'rad')}, where roll has no meaning, for their sigmas "
            f"of roll and pitch to hold ({NEAR_POLE} is true there); use the calibrated force"
        )
    end = calibration.ranges.get("time_s", [0.0, np.inf])[1]
    if calibration.drifts and time is not None and (after := time > (1 + RANGE_MARGIN) * end).any():
        yield (
            f"{short_list(calibration.drifts)}: kept constant after the end of the calibration "
            f"session ({end:.0f} s), in {after.sum()} {of_all}"
        )
    sizes = dict(zip(calibration.model.parameter_names, calibration.parameters, strict=True))
    moved = {effect for effect, column in calibration.needs if column.startswith("step_")}
    for effect in calibration.model.effects:
        if effect.name in moved:
            each = [f"{p.name} = {quantity_text(sizes[p.name], p.unit)}" for p in effect.parameters]
            yield (
                f"{effect.name} is not corrected ({', '.join(each)}): it depends on the position "
                "before, which a log does not have"
            )


def _beyond_ranges(
    ranges: Mapping[str, list[float]], corrected: Array, hold: HoldConditions
) -> Iterator[str]:
    """Say how many rows, of forces (n, 3) in m/s², lie beyond the ranges of a calibration."""
    columns = {
        "temperature_degC": hold.temperature,
        "vibration_mps2": hold.vibration,
        **dict(zip(FORCES, corrected.T, strict=True)),
    }
    for what, unit, names in (
        ("temperature", "°C", ["temperature_degC"]),
        ("vibration", "m/s²", ["vibration_mps2"]),
        ("specific force", "m/s²", [*FORCES]),
    ):
        values = [column for name in names if (column := columns[name]) is not None]
        if not values or not {*names} <= ranges.keys():
            continue
        low, high = np.array([ranges[name] for name in names]).T[..., None]
        # In parts of the width, so that axes can be compared; NaN does not count.
        excess = np.fmax(low - values, values - high) / np.maximum(high - low, 1e-9)
        beyond = excess > RANGE_MARGIN
        if beyond.any():
            axis, row = np.unravel_index(np.nanargmax(excess), excess.shape)
            way = f" {FORCES[names[axis]]}" if names[axis] in FORCES else ""
            yield (
                f"{what} outside the range of the calibration in {beyond.any(axis=0).sum()} of "
                f"{counted(len(corrected), 'row')}: up to {values[axis][row]:.4g} {unit}{way}, "
                f"while the calibration had {low[axis, 0]:.4g} to {high[axis, 0]:.4g}; it is "
                "extrapolated there"
            )


def _reason(calibration: SensorCalibration, readings: Readings, row: int) -> str:
    """Say why a row is empty, and where it is."""
    log = readings.log
    needed = {*AXES, "time", *(condition for _, condition in calibration.needs)}
    lost = [key for key in log.lacking(row) if key in needed]
    if lost:
        return log.describe(row, lost[0])
    where, _ = log.source.look_up(row, log.places["fx"])
    full = calibration.content.get("range_mps2")
    end = "" if full is None else f", or it is at the end of the range, ± {full:.4g} m/s²"
    return f"{where}: the calibration has no force for such a reading{end}"
