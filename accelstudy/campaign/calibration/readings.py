"""How to read a log to which a calibration is applied, with the conditions that effects need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.applying import Calibration
from accelstudy.campaign.calibration.export import campaign_conversion, mending
from accelstudy.campaign.calibration.tables import column_names
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.opening import open_source
from accelstudy.campaign.importing.recording import (
    AXES,
    absurd,
    absurd_from,
    locate,
    nanoseconds_beside,
    time_factor_of,
    told_by_names,
)
from accelstudy.campaign.importing.sources import LogFile, Source, counted_from_first
from accelstudy.effects import HoldConditions, course_of_log
from accelstudy.files.reading import overlay
from accelstudy.files.validation import checked
from accelstudy.sensors.conversion import Conversion, conversion_of
from accelstudy.sensors.frames import Frame

Array = NDArray[np.float64]

OPTIONS = {
    "time": "--time or --rate",
    "temperature": "--columns temperature=NAME",
    "vibration": "--columns vibration=NAME",
}
"""Conditions that a log can hold, and the options that name their columns."""


@dataclass(frozen=True)
class Readings:
    """A log, prepared for a calibration.

    Attributes
    ----------
    source : Source, a file or a table in memory
    places : mapping of fx, fy, fz, time, temperature and vibration to columns, as far as known
    rate : float, 1/s, if the time comes from it
    time_factor : float, s per unit of the column of time, of whose dates these are ns
    start : float, s, from the start of the calibration session to the first row
    unit : str, of the forces
    conversion : Conversion, of forces to m/s², in the axes of the log
    frame : Frame, the axes of the log
    mending : (3, 3), turns forces in frd as they are read into mended ones
    """

    source: Source
    places: Mapping[str, int]
    rate: float | None
    time_factor: float
    start: float
    unit: str
    conversion: Conversion
    frame: Frame
    mending: Array

    @cached_property
    def table(self) -> pa.Table:
        """Rows as they are in the file, with all their columns."""
        names = column_names(self.source)
        return pa.table(self.source.columns(range(len(names))), names=names)

    @cached_property
    def values(self) -> dict[str, NDArray[Any]]:
        """Numbers of the columns that are used, NaN where there is none."""
        places = [*self.places.values()]
        columns = [self.table.column(place) for place in places]
        return dict(zip(self.places, self.source.numbers(places, columns), strict=True))

    @cached_property
    def forces(self) -> Array:
        """Forces of the rows, (n, 3), m/s² in frd; NaN where a reading is missing or absurd."""
        raw = np.column_stack([self.values[axis] for axis in AXES])
        forces = self.conversion.to_si(raw)
        forces[absurd(raw, forces, absurd_from(raw, self.conversion))] = np.nan
        return self.frame.to_frd(forces) @ self.mending.T

    @cached_property
    def hold(self) -> HoldConditions:
        """What else is known of the rows, for effects that need it."""
        time = None
        if self.rate is not None:
            time = self.start + np.arange(len(self.forces)) / self.rate
        elif "time" in self.values:
            time = counted_from_first(self.values["time"])[0] * self.time_factor
            time = time + 1e-9 * self.values.get("nanoseconds", 0)
            time = self.start + counted_from_first(time)[0]
        temperature = self.values.get("temperature")
        course = None
        if time is not None and temperature is not None:
            course = course_of_log(time, temperature)
        # A log has no position before: effects that depend on it add nothing.
        still = np.zeros(len(self.forces))
        return HoldConditions(
            time=time,
            temperature=temperature,
            vibration=self.values.get("vibration"),
            step_x=still,
            step_y=still,
            step_z=still,
            course=course,
        )


def readings_of(
    log: LogFile,
    calibration: Calibration,
    given: Mapping[str, Any] | None = None,
    start: float = 0.0,
) -> Readings:
    """Open a log; by default it is read like the log from which the campaign was made.

    Parameters
    ----------
    log : anything that `open_source` opens
    calibration : Calibration
    given : mapping, optional
        Keys of `LogLayout`. Columns overlay those of the campaign's log; if all three columns of
        the forces are given, they replace all others, since then the log is another one. A column
        of time replaces a rate, and vice versa.
    start : float, s, from the start of the calibration session to the first row

    Returns
    -------
    Readings

    Raises
    ------
    InputError
        If the file cannot be read, or lacks a column, perhaps one that an effect needs.
    """
    given = dict(given or {})
    if {"time", "rate_hz"} <= set(given):
        raise InputError(f"{log}: give the rate or the column of time, not both")
    layout = _layout(calibration, given)
    source = open_source(log, layout.variable, layout.delimiter)
    own = _with_format(source, calibration, given)
    layout = _layout(calibration, own)
    try:
        places = _places(source, layout, calibration, {*given, *given.get("columns", {})})
    except InputError as error:
        if calibration.log is None or "columns" in given:
            raise
        raise InputError(
            f"{error}; the columns are those of the log of the campaign, --columns and --time "
            "change them"
        ) from None
    for effect, condition in calibration.needs:
        if condition not in OPTIONS and not condition.startswith("step_"):
            raise InputError(
                f"{log}: the effect {effect} needs the {condition} of each row, which no log has; "
                "a calibration without this effect can be applied"
            )
        is_given = condition in places or (condition == "time" and layout.rate_hz is not None)
        if condition in OPTIONS and not is_given:
            raise InputError(
                f"{log}: the effect {effect} needs the {condition} of each row; "
                f"give it by {OPTIONS[condition]}"
            )
    unit = layout.unit
    if calibration.log is None and "unit" not in given and "unit" not in own:
        unit = calibration.content["unit"]
    # What the user says of this log is right, whatever was wrong with the campaign.
    option_of = {"unit_error": "unit", "axis_error": "frame"}
    mended = calibration.content.get("mended")
    mends = mended is None or option_of.get(mended["error"]) not in given
    return Readings(
        source,
        places | nanoseconds_beside(source, places),
        layout.rate_hz,
        time_factor_of(source, places, layout.time_unit),
        start,
        unit,
        _conversion(calibration, layout, unit),
        layout.axes,
        mending(calibration.content) if mends else np.eye(3),
    )


def _with_format(
    source: Source, calibration: Calibration, given: Mapping[str, Any]
) -> Mapping[str, Any]:
    """What the format of a log says, overlaid with `given`, unless the campaign's is like it."""
    if calibration.log is not None and calibration.log.columns.get("fx") in source.names:
        return given
    layout = _layout(calibration, given)
    own = {**told_by_names(source, layout.columns, layout.time)}
    if "rate_hz" in given:
        own.pop("time", None)
    return overlay(own, given)


def _layout(calibration: Calibration, given: Mapping[str, Any]) -> LogLayout:
    """Layout of the campaign's log, overlaid with `given`."""
    layout = {} if calibration.log is None else calibration.log.model_dump(exclude_none=True)
    if given.keys() & {"time", "rate_hz"}:
        layout = {key: value for key, value in layout.items() if key not in ("time", "rate_hz")}
    columns = given.get("columns", {})
    if not set(AXES) <= set(columns):
        columns = {**layout.get("columns", {}), **columns}
    return checked(LogLayout, {**layout, **given, "columns": columns}, "options")


def _places(
    source: Source, layout: LogLayout, calibration: Calibration, given: set[str]
) -> dict[str, int]:
    """Columns of the log; a column that no effect needs may be missing, unless it was given."""
    columns = dict(layout.columns)
    if layout.time is not None:
        columns["time"] = layout.time
    needed = {condition for _, condition in calibration.needs}
    if layout.rate_hz is not None:
        columns.pop("time", None)
        needed.discard("time")
    places = locate(source, {k: v for k, v in columns.items() if k not in OPTIONS}, AXES)
    for key in OPTIONS:
        if key in needed or (key in columns and key != "time"):
            wanted = {key: columns[key]} if key in columns else {}
            try:
                places |= locate(source, wanted, (key,), needed=False)
            except InputError:
                if key in given:
                    raise
    return places


def _conversion(calibration: Calibration, layout: LogLayout, unit: str) -> Conversion:
    """Conversion of readings in a unit, in the axes of the log."""
    if calibration.log is None and unit == calibration.content["unit"]:
        return campaign_conversion(calibration.content)
    if unit != "counts":
        return conversion_of(unit)
    if layout.scale is None:
        raise InputError("--unit counts: the calibration has no nominal scale of counts")
    return conversion_of("counts", layout.scale, layout.offset)
