"""Apply a calibration to a log and level with it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics import bounds
from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import track
from accelstudy.basics.units import (
    SENSOR_UNITS,
    attitude_unit,
    display_unit,
    to_attitude,
    to_display,
)
from accelstudy.basics.wording import counted, quantity_text, short_list
from accelstudy.campaign.calibration.applying import MARGIN, Calibration, Watch, noise_of_reading
from accelstudy.campaign.calibration.readings import Readings, readings_of
from accelstudy.campaign.calibration.tables import ROWS, infer_types, is_parquet, write_table
from accelstudy.campaign.checks import likely_fault
from accelstudy.campaign.importing.recording import AXES
from accelstudy.campaign.importing.sources import LogFile
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import near_pole
from accelstudy.sensors.frames import Frame

Array = NDArray[np.float64]

CLIPPED = 0.999
"""A reading beyond this part of the sensor's range is saturated: the last count is often below the
range."""

MANY_SIGMAS = 2.2
"""Sigmas that hold 95 % with 12 degrees of freedom; with more, 2 of them hold 93 % and above."""
NEAR_POLE = "near_pole"
"""Column that says whether a row is too close to the roll pole for its sigmas."""

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


def level(
    calibration: Calibration,
    log: LogFile,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
) -> tuple[Readings, dict[str, pa.ChunkedArray], Leveled]:
    """Level a log; see `level_log`.

    Returns
    -------
    readings : Readings, with the rows as they were read
    added : dict of columns, calibrated forces, roll and pitch and their standard deviations
    leveled : Leveled
    """
    readings = readings_of(log, calibration, given, start or 0.0)
    if sigma is not None:
        bounds.SIGMA_READING.check_key("--sigma", sigma)
    noise = noise_of_reading(calibration) if sigma is None else sigma
    rows = np.arange(len(readings.forces))
    parts = []
    for first in track(range(0, max(1, len(rows)), ROWS), "leveling"):
        some = rows[first : first + ROWS]
        of_rows = readings.forces[some], readings.hold.take(some)
        parts.append(_leveled(calibration, readings.frame, *of_rows, noise))
    corrected = np.concatenate([part[0] for part in parts])
    near = np.concatenate([part[1] for part in parts])
    added = {name: pa.chunked_array([part[2][name] for part in parts]) for name in parts[0][2]}
    account = Account(calibration, readings, corrected, near)
    doubts = (
        *_implausible(calibration),
        *_mended(calibration, readings),
        *_estimated(calibration),
        *(account.assumptions() if start is None else ()),
        *account.warnings(),
    )
    return readings, added, Leveled(account.rows, account.empty, doubts)


def level_frame(
    calibration: Calibration,
    log: LogFile,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
    frame: pd.DataFrame | None = None,
) -> tuple[pd.DataFrame, Leveled]:
    """Return what `level_log` writes, with nothing written.

    Parameters
    ----------
    calibration, log, given, sigma, start : as of `level_log`
    frame : DataFrame, optional
        The rows of the log as their owner has them, whose index and columns stay as they are; as
        they were read if omitted.
    """
    readings, added, leveled = level(calibration, log, given, sigma, start)
    if frame is None:
        frame = infer_types(readings.source, readings.table).to_pandas()
    values = {name: column.to_numpy() for name, column in added.items()}
    return frame.assign(**values), leveled


def level_log(
    calibration: Calibration,
    log: str | Path,
    out: str | Path,
    given: Mapping[str, Any] | None = None,
    sigma: float | None = None,
    start: float | None = None,
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

    Raises
    ------
    InputError
        If the log cannot be read, lacks a column that an effect of the calibration needs, or is so
        far from gravity in most rows that it must be in another unit.
    """
    readings, added, leveled = level(calibration, log, given, sigma, start)
    table = readings.table
    # The row labels that pandas writes as a column are not part of the log.
    table = table.drop_columns([n for n in table.column_names if n.startswith("__index_level_")])
    if is_parquet(out):
        table = infer_types(readings.source, table)
    write_table(out, _with(table, added))
    return leveled


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
    """Say how many sigmas hold 95 %, if its noise is hardly known."""
    needed = calibration.content["sigmas_95"] or 0.0
    if needed <= MANY_SIGMAS:
        return ()
    return (
        "the noise in the sigmas of the calibration is hardly known: to hold 95 % of the errors it "
        f"takes up to {needed:.2f} sigmas of roll and pitch",
    )


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


def _with(table: pa.Table, added: Mapping[str, pa.ChunkedArray]) -> pa.Table:
    """Table with added columns; existing columns of the same name are replaced."""
    for name, column in added.items():
        if name in table.column_names:
            table = table.set_column(table.column_names.index(name), name, column)
        else:
            table = table.append_column(name, column)
    return table


def clipped(calibration: Calibration, forces: Array) -> NDArray[np.bool_]:
    """Which readings (k, 3), m/s², are at the end of the sensor's range."""
    full = calibration.content.get("range_mps2")
    return np.abs(forces) >= CLIPPED * (np.inf if full is None else full)


class Account:
    """What the user should know about a log that was leveled.

    Parameters
    ----------
    calibration : Calibration
    readings : Readings
    corrected : (n, 3) array, m/s² in frd, calibrated forces of the rows; NaN where there is none
    near : (n,) bool array, rows that are too close to the roll pole for their sigmas

    Attributes
    ----------
    rows : int
    empty : int, rows without a calibrated force

    Raises
    ------
    InputError
        If no row is usable, or most readings are far from gravity.
    """

    def __init__(
        self,
        calibration: Calibration,
        readings: Readings,
        corrected: Array,
        near: NDArray[np.bool_],
    ) -> None:
        self._calibration, self._readings = calibration, readings
        self._empty = np.isnan(corrected[:, 0])
        self.rows, self.empty = len(corrected), int(self._empty.sum())
        self._near = int(near.sum())
        norms = np.linalg.norm(readings.forces, axis=1)
        norms = norms[np.isfinite(norms)]
        if not len(norms):
            path = readings.source.path
            raise InputError(f"{path}: no row has three numbers; the first: {self._reason()}")
        # Even bad sensors are wrong by some tenths only; larger differences come from motion.
        gravity, time = calibration.gravity, readings.hold.time
        if 2 * np.sum((norms < gravity / 2) | (norms > gravity * 2)) > len(norms):
            raise self._wrong_unit()
        self._after = 0
        if calibration.drifts and time is not None:
            self._after = int(np.sum(time > (1 + MARGIN) * self._session_end))
        self._watch = Watch(calibration.ranges)
        self._watch.look_at(corrected, readings.hold)

    def assumptions(self) -> Iterator[str]:
        """Assumptions that are made if the user does not say when the log was started."""
        needs = self._calibration.needs
        warmed = {effect for effect, column in needs if column == "temperature"}
        timed = [e for e, column in needs if column == "time" and e not in warmed]
        lagging = [e for e, column in needs if column == "time" and e in warmed]
        if lagging:
            yield f"{short_list(lagging)}: assumes that the sensor has the temperature of row 1"
        if timed:
            yield (
                f"{short_list(timed)}: assumes that the first row is the start of the calibration "
                "session; if not, give the seconds between them by --start"
            )

    def warnings(self) -> Iterator[str]:
        """Warnings about the log."""
        of_all = f"of {counted(self.rows, 'row')}"
        yield from self._readings.source.warnings
        if self.empty:
            first = self._reason()
            yield f"{self.empty} {of_all} have no calibrated force and get empty cells; {first}"
        if self._near:
            yield (
                f"{self._near} {of_all} are too close to a pitch of "
                f"±{quantity_text(np.pi / 2, 'rad')}, where roll has no meaning, for their sigmas "
                f"of roll and pitch to hold ({NEAR_POLE} is true there); use the calibrated force"
            )
        if self._after:
            yield (
                f"{short_list(self._calibration.drifts)}: kept constant after the end of the "
                f"calibration session ({self._session_end:.0f} s), in {self._after} {of_all}"
            )
        moved = dict.fromkeys(e for e, c in self._calibration.needs if c.startswith("step_"))
        for name in moved:
            yield (
                f"{name} is not corrected ({self._sizes(name)}): it depends on the position "
                "before, which a log does not have"
            )
        yield from self._watch.warnings(self.rows)

    @property
    def _session_end(self) -> float:
        return self._calibration.ranges.get("time_s", [0.0, np.inf])[1]

    def _sizes(self, name: str) -> str:
        model = self._calibration.model
        values = dict(zip(model.parameter_names, self._calibration.parameters, strict=True))
        (effect,) = (effect for effect in model.effects if effect.name == name)
        return ", ".join(
            f"{p.name} = {quantity_text(float(values[p.name]), p.unit)}" for p in effect.parameters
        )

    def _reason(self) -> str:
        """Say why the first empty row is empty, and where it is."""
        readings, source = self._readings, self._readings.source
        row = int(np.argmax(self._empty))
        keys = [key for key, values in readings.values.items() if not np.isfinite(values[row])]
        if not keys and np.isnan(readings.forces[row]).any():  # it is absurd
            keys = [max(AXES, key=lambda axis: abs(readings.values[axis][row]))]
        # This reads the file again to find the line.
        where, cell = source.look_up(row, readings.places[keys[0] if keys else "fx"])
        if keys:
            return f"{where}, column {source.names[readings.places[keys[0]]]} ({keys[0]}): {cell}"
        full = self._calibration.content.get("range_mps2")
        end = "" if full is None else f", or it is at the end of the range, ± {full:.4g} m/s²"
        return f"{where}: the calibration has no force for such a reading{end}"

    def _wrong_unit(self) -> InputError:
        readings, gravity = self._readings, self._calibration.gravity
        forces = readings.forces[np.isfinite(readings.forces).all(axis=1)]
        raw = forces / abs(float(readings.conversion.scale[0]))
        fault = likely_fault(raw, forces, readings.unit, gravity)
        looks = f"these look like {fault.cause}; give --unit {fault.cause}"
        return InputError(
            f"{readings.source.path}: the readings are about {fault.given:.3g} {readings.unit}: "
            + (
                looks
                if fault.cause in SENSOR_UNITS
                else "nowhere near gravity, "
                f"{gravity:.3g} m/s²; give the --unit or the --columns of this log"
            )
        )
