"""Apply a calibration to a log and level with it."""

from __future__ import annotations

import csv
import gzip
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import show, track, warn
from accelstudy.basics.units import attitude_unit, display_unit, to_attitude, to_display
from accelstudy.basics.wording import one_line
from accelstudy.campaign.calibration.sensor_calibration import (
    FORCES,
    RANGE_MARGIN,
    SensorCalibration,
)
from accelstudy.campaign.gross_errors.recognition import check_size
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.log import AnyLog, Log, read_log
from accelstudy.effects import HoldConditions, course_of_log
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import write_table
from accelstudy.leveling.angles import near_pole
from accelstudy.pages import render_lines

Array = NDArray[np.float64]

SATURATED_SHARE = 0.999
"""A reading beyond this part of the sensor's range is saturated: the last count is often below the
range."""
MANY_SIGMAS = 2.2
"""Number of sigmas that hold 95 % with 12 degrees of freedom; 2 hold 93 % or more beyond."""
ROWS = 2**16
"""Rows that are processed together, so that memory does not grow with the log."""
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


@dataclass(frozen=True)
class LeveledLog:
    """A leveled log.

    Forces and angles are in the axes of the log. A row has empty cells if a reading is missing, or
    if no force explains it.

    Attributes
    ----------
    log : Log, with the rows as they were read
    added : DataFrame of calibrated forces, roll and pitch and their standard deviations, and
        whether the row is near the pole
    warnings : tuple of str
    """

    log: Log
    added: pd.DataFrame
    warnings: tuple[str, ...]

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Which rows have no calibrated force, (n,)."""
        return self.added.iloc[:, 0].isna().to_numpy()

    def to_frame(self) -> pd.DataFrame:
        """Return the log with the added columns; a table in memory keeps its index and columns."""
        raw = self.log.raw
        frame = raw.table().to_pandas() if raw.frame is None else raw.frame
        return frame.assign(**{str(name): column.array for name, column in self.added.items()})

    def tell(self, place: Path) -> None:
        """Print how many rows are leveled, and what the user should know."""
        for warning in self.warnings:
            warn(warning)
        show(f"{np.sum(~self.lost)} of {len(self.added)} rows leveled: {place}")

    def write(self, out: str | Path, place: Path | None = None) -> None:
        """Write the log with the added columns, CSV or Parquet; if that fails, there is no file."""
        table = self.log.raw.table(as_written=not _is_parquet(out))
        added = pa.Table.from_pandas(self.added, preserve_index=False)
        columns = {each: own[each] for own in (table, added) for each in own.column_names}
        # The row labels that pandas writes as a column are not part of the log.
        labels = [name for name in columns if name.startswith("__index_level_")]
        _write_table(out, pa.table(columns).drop_columns(labels))


def level(
    calibration: SensorCalibration,
    log: AnyLog,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
) -> LeveledLog:
    """Level a log; by default it is read like the log from which the campaign was made.

    Parameters
    ----------
    calibration : SensorCalibration
    log : path, table or Log
    given : mapping, optional
        Keys of `LogLayout`, which count before the layout of the campaign's log.
    sigma : float, m/s², noise of a reading; that of the calibration if omitted
    start : float, s, from the start of the calibration session to the first row; 0 if omitted

    Raises
    ------
    InputError
        If the log cannot be read, lacks a column that an effect of the calibration needs, or is so
        far from gravity in most rows that it must be in another unit.
    """
    read = _read(calibration, log, given or {})
    given, forces, hold = read.given, read.forces, _conditions(read, start or 0.0)
    # What the user says of this log is right, whatever was wrong with the campaign.
    option_of = {"unit_error": "unit", "axis_error": "frame"}
    mended = calibration.document.mended
    mends = mended is not None and mended.matrix is not None
    if mended is not None and option_of.get(mended.error) in given:
        mends = False
    if mends:
        forces = forces @ calibration.mending.T
    usable = forces[np.isfinite(forces).all(axis=1)]
    if not len(usable):
        first = f"; the first: {_reason(calibration, read, 0)}" if len(forces) else ""
        raise InputError(f"{read.path}: no row has three numbers{first}")
    check_size(
        f"{read.path}", usable, calibration.gravity, read.layout.unit, read.layout.conversion
    )
    if sigma is not None:
        bounds.SIGMA_READING.check_key("`sigma`", sigma)
    noise = calibration.noise_of_reading if sigma is None else sigma
    rows = np.arange(len(forces))
    parts = [
        _level_rows(calibration, read, forces[some], hold.take(some), noise)
        for some in track([rows[i : i + ROWS] for i in range(0, len(rows), ROWS)], "leveling")
    ]
    leveled = LeveledLog(read, pd.concat(parts, ignore_index=True), ())
    warnings = _warnings(calibration, leveled, hold, mends, start is None)
    return replace(leveled, warnings=warnings)


def _warnings(
    calibration: SensorCalibration,
    leveled: LeveledLog,
    hold: HoldConditions,
    mends: bool,
    assumes_start: bool,
) -> tuple[str, ...]:
    """What the user should know of the calibration and of the rows."""
    lost, needs = leveled.lost, calibration.model.needs
    timed = [effect for effect, column in needs if assumes_start and column == "time"]
    lagging = [effect for effect in timed if (effect, "temperature") in needs]
    moved = {effect for effect, column in needs if column.startswith("step_")}
    late = 0
    if calibration.drifts and hold.time is not None and "time_s" in calibration.ranges:
        late = int(np.sum(hold.time > (1 + RANGE_MARGIN) * calibration.ranges["time_s"][1]))
    warnings = render_lines(
        "campaign/calibration/leveling.txt.j2",
        "warnings",
        sensor=calibration,
        log=leveled.log,
        mends=mends,
        timed=[effect for effect in timed if effect not in lagging],
        lagging=lagging,
        moved=[effect for effect in calibration.model.effects if effect.name in moved],
        rows=len(lost),
        empty=int(lost.sum()),
        reason=_reason(calibration, leveled.log, int(np.argmax(lost))) if lost.any() else "",
        near=leveled.added[NEAR_POLE].sum(),
        vertical=np.pi / 2,
        after=late,
        many=MANY_SIGMAS,
        beyond=[*_beyond_ranges(calibration.ranges, leveled, hold)],
    )
    return tuple(warnings)


def _read(calibration: SensorCalibration, log: AnyLog, given: Mapping[str, Any]) -> Log:
    """Read a log, and check that it has what the effects need."""
    read = read_log(log, given, calibration.usual_layout)
    known = {*read.conditions, *(["time"] if read.timed else [])}
    for effect, condition in calibration.model.needs:
        if condition in known or condition.startswith("step_"):
            continue
        where, how = f"{read.path}: the effect {effect} needs the {condition} of each row", OPTIONS
        if condition not in how:
            raise InputError(
                f"{where}, which no log has; a calibration without this effect can be applied"
            )
        raise InputError(f"{where}; give it by {how[condition]}")
    return read


def _conditions(read: Log, start: float) -> HoldConditions:
    """What is known of the rows besides the forces; the first is `start` s after the session's."""
    names = [*(["time"] if read.timed else []), *read.conditions]
    known: dict[str, Any] = {name: read.samples[name].to_numpy() for name in names}
    if "time" in known:
        known["time"] = start + known["time"]
        if "temperature" in known:
            known["course"] = course_of_log(known["time"], known["temperature"])
    # A log has no position before: effects that depend on it add nothing.
    steps: dict[str, Any] = dict.fromkeys(
        ("step_x", "step_y", "step_z"), np.zeros(len(read.forces))
    )
    return HoldConditions(**known, **steps)


def _level_rows(
    calibration: SensorCalibration,
    log: Log,
    forces: Array,
    hold: HoldConditions,
    noise: float,
) -> pd.DataFrame:
    """Columns that are added to rows whose readings, in frd, are forces (k, 3), m/s²."""
    with np.errstate(all="ignore"):  # forces that are not finite are counted below
        corrected = calibration.correct(forces, hold)
        angles, sigmas = calibration.level(forces, noise, hold)
    lost = np.asarray(~np.isfinite(corrected + angles[:, :1]).all(axis=1))
    full = calibration.document.range_mps2 or np.inf
    lost |= (np.abs(forces) >= SATURATED_SHARE * full).any(axis=1)
    frame = log.layout.axes
    columns = [f"{axis}_calibrated_mps2" for axis in AXES]
    added = pd.DataFrame(frame.from_frd(corrected), columns=columns)
    for i, angle in enumerate(("roll", "pitch")):
        added[f"{angle}_{attitude_unit()}"] = frame.signs[i] * to_attitude(angles[:, i])
        added[f"sigma_{angle}_{display_unit('rad')}"] = to_display(sigmas[:, i], "rad")
    added = added.round(DECIMALS).where(np.isfinite)
    added[lost] = np.nan
    # With a plain bool a row without an answer would make a column that knows no `~`.
    near = pd.array(near_pole(angles, sigmas), dtype="boolean")
    near[lost] = pd.NA
    return added.assign(**{NEAR_POLE: near})


def _beyond_ranges(
    ranges: Mapping[str, list[float]], leveled: LeveledLog, hold: HoldConditions
) -> Iterator[dict[str, Any]]:
    """What lies beyond the ranges of a calibration, in how many rows, and how far."""
    forces = leveled.log.layout.axes.to_frd(leveled.added.iloc[:, :3].to_numpy())
    columns = {
        ("temperature", "°C"): ("temperature_degC", hold.temperature),
        ("vibration", "m/s²"): ("vibration_mps2", hold.vibration),
    }
    for name, force in zip(FORCES, forces.T, strict=True):
        columns["specific force", f"m/s² {FORCES[name]}"] = name, force
    for (what, unit), (name, values) in columns.items():
        if values is None or name not in ranges:
            continue
        low, high = ranges[name]
        excess = np.fmax(low - values, values - high)  # NaN where there is no number
        count = int(np.sum(excess > RANGE_MARGIN * max(high - low, 1e-9)))
        if count:
            value = values[np.nanargmax(excess)]
            yield {"what": what, "count": count, "value": value, "unit": unit,
                   "low": low, "high": high}  # fmt: skip


def _reason(calibration: SensorCalibration, log: Log, row: int) -> str:
    """Say why a row is empty, and where it is."""
    needed = {*AXES, "time", *(condition for _, condition in calibration.model.needs)}
    lost = [key for key in log.lacking(row) if key in needed]
    if lost:
        return log.describe(row, lost[0])
    where, _ = log.raw.look_up(row, log.places["fx"])
    full = calibration.document.range_mps2
    end = "" if full is None else f", or it is at the end of the range, ± {full:.4g} m/s²"
    return f"{where}: the calibration has no force for such a reading{end}"


# --- The file ------------------------------------------------------------------------------------


def _write_table(path: str | Path, table: pa.Table) -> None:
    """Write a table into a file; if that fails, there is no file.

    Parameters
    ----------
    path : file to write; see `_is_parquet`, anything else is CSV, packed if it ends in .gz
    table : Table
    """
    path = Path(path)
    try:
        if _is_parquet(path):
            write_table(path, table)
        else:
            _write_csv(path, table)
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error.strerror or error}") from None


def _is_parquet(path: str | Path) -> bool:
    """Whether a file is Parquet by its ending."""
    return Path(path).suffix.lower() in (".parquet", ".pq")


def _write_csv(path: Path, table: pa.Table) -> None:
    packed = path.suffix.lower() == ".gz"
    with (
        whole_file(path) as temporary,
        (gzip.open if packed else open)(temporary, "wt", encoding="utf-8", newline="") as file,
    ):
        csv.writer(file, lineterminator="\n").writerow(table.column_names)
        for first in range(0, len(table), ROWS):
            file.write("".join(_lines(table.slice(first, ROWS))))


def _lines(table: pa.Table) -> list[str]:
    """Lines of CSV, joined column by column, which is ten times as fast as row by row."""
    cells = [_text(name, table[name]) for name in table.column_names]
    lines = pc.binary_join_element_wise(*cells, ",", null_handling="replace", null_replacement="")
    return pc.binary_join_element_wise(lines, "", "\n").to_pylist()


def _text(name: str, column: pa.ChunkedArray) -> pa.ChunkedArray:
    """Column as cells of CSV; null for empty cells and NaN."""
    if pa.types.is_floating(column.type):
        return pc.if_else(pc.is_nan(column), None, column).cast(pa.string())
    try:
        text = column.cast(pa.string())
    except (pa.ArrowInvalid, pa.ArrowNotImplementedError):
        raise InputError(
            f"column {name!r} is {one_line(column.type)}, which no text holds; write .parquet"
        ) from None
    special = pc.match_substring_regex(text, '[",\r\n]')
    if not pc.any(special).as_py():
        return text
    quoted = pc.binary_join_element_wise("", pc.replace_substring(text, '"', '""'), "", '"')
    return pc.if_else(special, quoted, text)
