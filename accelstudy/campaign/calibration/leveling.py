"""Apply a calibration to a log and level with it."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow.csv import WriteOptions, write_csv

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import show, track, warn
from accelstudy.basics.units import attitude_unit, display_unit, to_attitude, to_display
from accelstudy.basics.wording import one_line
from accelstudy.campaign.calibration.sensor_calibration import (
    DEVICE_COLUMNS,
    RANGE_MARGIN,
    RANGED,
    SensorCalibration,
    ranged_values,
)
from accelstudy.campaign.gross_errors.recognition import check_size
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.log import AnyLog, Log, read_log
from accelstudy.effects import HoldConditions, course_of_log
from accelstudy.files.outputs import whole_file
from accelstudy.files.tables import write_table
from accelstudy.leveling.angles import near_pole
from accelstudy.pages import render_lines

TEMPLATE = "campaign/calibration/leveling.txt.j2"
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


def level(
    calibration: SensorCalibration,
    log: AnyLog,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
) -> Leveling:
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
        If the log cannot be read, lacks a column that an effect of the calibration needs, is so far
        from gravity in most rows that it must be in another unit, or no row can be corrected.
    """
    leveled = Leveling(
        calibration, read_log(log, given or {}, calibration.usual_layout), sigma, start
    )
    leveled.check()
    return leveled


@dataclass(frozen=True, eq=False)
class Leveling:
    """A leveled log.

    Forces and angles are in the axes of the log. A row has empty cells if a reading is missing, or
    if no force explains it.

    Attributes
    ----------
    calibration : SensorCalibration
    log : Log, with the rows as they were read
    sigma : float, m/s², noise of a reading; None for that of the calibration
    start : float, s, from the start of the calibration session to the first row; None if it is
        taken for the same
    """

    calibration: SensorCalibration
    log: Log
    sigma: float | None = None
    start: float | None = None

    @cached_property
    def hold(self) -> HoldConditions:
        """What is known of the rows besides the forces."""
        names = [*(["time"] if self.log.timed else []), *self.log.conditions]
        known: dict[str, Any] = {name: self.log.samples[name].to_numpy() for name in names}
        if "time" in known:
            known["time"] = (self.start or 0.0) + known["time"]
            if "temperature" in known:
                known["course"] = course_of_log(known["time"], known["temperature"])
        # A log has no position before: effects that depend on it add nothing.
        return HoldConditions(**known).with_steps(np.zeros_like(self.log.forces))

    @property
    def mends(self) -> bool:
        """Whether readings are mended as those of the campaign were.

        What the user says of this log is right, whatever was wrong with the campaign.
        """
        mended = self.calibration.document.mended
        if mended is None or mended.matrix is None:
            return False
        option_of = {"unit_error": "unit", "axis_error": "frame"}
        return option_of.get(mended.error) not in self.log.settings

    @cached_property
    def forces(self) -> Array:
        """Readings, (n, 3), m/s², in forward, right, down, without a gross error."""
        forces = self.log.forces
        return forces @ self.calibration.mending.T if self.mends else forces

    def check(self) -> None:
        """Raise `InputError` if the log is not one of the sensor, or lacks what effects need."""
        path = self.log.path
        for effect, condition in self.calibration.model.needs:
            if condition.startswith("step_") or getattr(self.hold, condition) is not None:
                continue
            where = f"{path}: the effect {effect} needs the {condition} of each row"
            if condition not in OPTIONS:
                raise InputError(
                    f"{where}, which no log has; a calibration without this effect can be applied"
                )
            raise InputError(f"{where}; give it by {OPTIONS[condition]}")
        conditions = [condition for _, condition in self.calibration.model.needs]
        if "time" in conditions:
            self.log.check_order(self.log.samples["time"].dropna(), coarse=True)
        self.log.check_units(conditions)
        usable = self.forces[np.isfinite(self.forces).all(axis=1)]
        if len(usable):
            check_size(f"{path}", usable, self.calibration.gravity, self.log.layout.conversion)
        if not len(self.forces) or self.lost.all():
            first = f"; the first: {self.reason(0)}" if len(self.forces) else ""
            raise InputError(f"{path}: no row can be corrected{first}")

    # --- the columns that are added --------------------------------------------------------------

    @cached_property
    def added(self) -> pd.DataFrame:
        """Calibrated forces, roll and pitch and their sigmas, and whether a row is near the pole.

        Roll and pitch are in the unit of angles.
        """
        rows = np.arange(len(self.forces))
        parts = [rows[i : i + ROWS] for i in range(0, len(rows), ROWS)]
        tables = [self._level(some) for some in track(parts, "leveling")]
        return pd.concat(tables, ignore_index=True)

    def _level(self, rows: NDArray[np.int_]) -> pd.DataFrame:
        """Columns that are added to some rows."""
        calibration, forces, hold = self.calibration, self.forces[rows], self.hold.take(rows)
        noise = calibration.noise_of_reading if self.sigma is None else self.sigma
        with np.errstate(all="ignore"):  # forces that are not finite are counted later
            corrected, angles, sigmas = calibration.correct_and_level(forces, noise, hold)
        lost = np.asarray(~np.isfinite(corrected + angles[:, :1]).all(axis=1))
        full = calibration.document.range_mps2 or np.inf
        lost |= (np.abs(forces) >= SATURATED_SHARE * full).any(axis=1)
        frame = self.log.layout.axes
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

    @property
    def lost(self) -> NDArray[np.bool_]:
        """Which rows have no calibrated force, (n,)."""
        return self.added.iloc[:, 0].isna().to_numpy()

    # --- what the user should know ---------------------------------------------------------------

    @cached_property
    def warnings(self) -> tuple[str, ...]:
        """What the user should know of the calibration and of the rows."""
        return tuple(render_lines(TEMPLATE, "warnings", self, MANY_SIGMAS, np.pi / 2))

    @property
    def uncorrected(self) -> set[str]:
        """Effects that depend on the position before, which a log does not have."""
        needs = self.calibration.model.needs
        return {effect for effect, column in needs if column.startswith("step_")}

    def reason(self, row: int) -> str:
        """Say why a row is empty, and where it is."""
        needed = {*AXES, "time", *(column for _, column in self.calibration.model.needs)}
        lost = [key for key in self.log.unreadable(row) if key in needed]
        if lost:
            return self.log.describe(row, lost[0])
        where, _ = self.log.raw.look_up(row, self.log.places["fx"])
        full = self.calibration.document.range_mps2
        end = "" if full is None else f", or it is at the end of the range, ± {full:.4g} m/s²"
        return f"{where}: the calibration has no force for such a reading{end}"

    @property
    def rows_after_drifts(self) -> int:
        """Number of rows after the session in which effects were seen to drift."""
        session, time = self.calibration.ranges.get("time_s"), self.hold.time
        if not self.calibration.drifts or session is None or time is None:
            return 0
        return int(np.sum(time > (1 + RANGE_MARGIN) * session[1]))

    @property
    def beyond_ranges(self) -> Iterator[dict[str, Any]]:
        """What lies beyond the ranges of the calibration, in how many rows, and how far."""
        forces = self.log.layout.axes.to_frd(self.added.iloc[:, :3].to_numpy())
        for name, values in ranged_values(forces, self.hold).items():
            if name == DEVICE_COLUMNS["time"] or name not in self.calibration.ranges:
                continue
            low, high = self.calibration.ranges[name]
            excess = np.fmax(low - values, values - high)  # NaN where there is no number
            if count := int(np.sum(excess > RANGE_MARGIN * max(high - low, 1e-9))):
                what, unit = RANGED[name]
                value = values[np.nanargmax(excess)]
                yield {"what": what, "count": count, "value": value, "unit": unit,
                       "low": low, "high": high}  # fmt: skip

    # --- what is made of it ----------------------------------------------------------------------

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
        """Write the log with the added columns, whole or not at all.

        A file that ends in .parquet or .pq is Parquet, any other one CSV, packed if it ends in .gz.
        """
        out = Path(out)
        is_parquet = out.suffix.lower() in (".parquet", ".pq")
        table = self.log.raw.table(as_written=not is_parquet)
        added = pa.Table.from_pandas(self.added, preserve_index=False)
        columns = {each: own[each] for own in (table, added) for each in own.column_names}
        # The row labels that pandas writes as a column are not part of the log.
        labels = [name for name in columns if name.startswith("__index_level_")]
        table = pa.table(columns).drop_columns(labels)
        try:
            (write_table if is_parquet else _write_csv)(out, table)
        except pa.ArrowInvalid as error:
            raise InputError(f"{out}: no CSV holds the log: {one_line(error)}") from None


def _write_csv(path: Path, table: pa.Table) -> None:
    """Write CSV, with quotation marks where there is a text that needs them."""
    names = StringIO()
    csv.writer(names, lineterminator="\n").writerow(table.column_names)

    def write(part: Path, quotes: str) -> None:
        options = WriteOptions(include_header=False, quoting_style=quotes)
        packed = "gzip" if path.suffix.lower() == ".gz" else None
        with pa.output_stream(part, compression=packed) as file:
            file.write(names.getvalue().encode())
            write_csv(table, file, options)

    with whole_file(path) as part:
        try:
            write(part, "none")
        except pa.ArrowInvalid:
            write(part, "needed")
