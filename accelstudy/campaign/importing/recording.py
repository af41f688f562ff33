"""Raw accelerometer logs: a table as it is in its file, and what its columns are in SI.

A log is text (comma, semicolon, tab or blanks between numbers, with or without header and comment
lines), a MATLAB file, a Parquet file or a recording of a robot. It gives times in s since its first
sample, and specific forces in m/s². An error is one line with its place in the file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import CLOCK_UNITS, SENSOR_UNITS, UNITS
from accelstudy.basics.wording import plural, short_list
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.formats import open_source
from accelstudy.campaign.importing.names import places_by_name, unit_in, without_unit
from accelstudy.campaign.importing.sources import LogFile, Source
from accelstudy.files.reading import overlay
from accelstudy.sensors.conversion import MAX_VALUE, Conversion, conversion_of

Array = NDArray[np.float64]

AXES = ("fx", "fy", "fz")
SDS = ("sd_fx", "sd_fy", "sd_fz")
CONDITIONS = ("temperature", "vibration")
"""Columns of a log besides time and forces."""
MAX_FORCE = 1e4
"""m/s², some 1000 g: what levels gives no larger reading."""
SAMPLED_ROWS = 1000
"""Rows of a log that tell how large its readings are."""
MAX_BAD_SHARE = 0.05
"""Share of rows without a usable reading from which on a log is refused."""
MAX_NAMED = 3
"""Rows that are named of those left out."""
GAP_RATIO = 5.0
"""A step of time that is this many times the usual one is a gap."""
_NANOSECONDS = re.compile(r"(.*?)n(ano)?(secs?)", re.IGNORECASE)
"""Whole seconds of a stamp of ROS, where there is no other time, and the rest of it."""
_USUAL_RATE = 100.0
"""1/s; of several units of time the likely one gives the rate nearest to it."""


# --- Which column is which -----------------------------------------------------------------------


def read_log(
    path: LogFile,
    layout: LogLayout | None = None,
    *,
    like: LogLayout | None = None,
    conditions: Collection[str] = ("time", *CONDITIONS),
    untimed: bool = False,
) -> SensorLog:
    """Find out how a log is laid out; its numbers are read when they are first asked for.

    What `layout` says counts before what the format of the file and the names of its columns say,
    and this before how another log of the sensor was read. A log with the columns of that other one
    is read as it was.

    Parameters
    ----------
    path : anything that `open_source` opens
    layout : LogLayout, of which the keys that were given count
    like : LogLayout, how another log of the sensor was read
    conditions : names of what to look for beside the forces; time and `CONDITIONS` by default,
        columns of a table of means as well
    untimed : bool, whether a log may have neither a time nor a rate; its times are numbers of
        samples then

    Raises
    ------
    InputError
        If the file cannot be read or lacks a column.
    """
    given = {} if layout is None else layout.model_dump(exclude_unset=True, exclude_none=True)
    if {"time", "rate_hz"} <= given.keys():
        raise InputError(f"{path}: give the rate or the column of time, not both")
    kind = LogLayout if layout is None else type(layout)
    source = open_source(path, _laid_over(like, given, kind).variable)
    told: dict[str, Any] = {}
    if another := like is None or like.columns.get("fx") not in source.names:
        told = {k: v for k, v in source.layout.items() if k != "time" or "rate_hz" not in given}
    try:
        chosen = _laid_over(like, overlay(told, given), kind)
        places = _places(source, chosen, given, conditions, untimed)
    except InputError as error:
        if like is None or "columns" in given:
            raise
        raise InputError(
            f"{error}; the columns are those of the log of the campaign, `columns` and `time` "
            "change them"
        ) from None
    if another:
        scaled = {"unit": "counts"} if given.keys() & {"scale", "offset"} else {}
        told = {**scaled, **_units(source, places), **told}
        chosen = _laid_over(like, overlay(told, given), kind)
    return SensorLog(source, chosen, places)


def _laid_over(
    like: LogLayout | None, given: Mapping[str, Any], kind: type[LogLayout]
) -> LogLayout:
    """Layout of another log overlaid with what is given of this one.

    If all three columns of the forces are given, they replace all others, since then the log is
    another one. A column of time replaces a rate, and a unit the scale of counts.
    """
    below = {} if like is None else like.model_dump(exclude_none=True)
    replaced = {"time", "rate_hz"} if given.keys() & {"time", "rate_hz"} else set()
    if given.get("unit", "counts") != "counts":
        replaced |= {"scale", "offset"}
    if {*AXES} <= given.get("columns", {}).keys():
        replaced |= {"columns"}
    kept = {key: value for key, value in below.items() if key not in replaced}
    return kind.model_validate(overlay(kept, given))


def _places(
    source: Source,
    layout: LogLayout,
    given: Mapping[str, Any],
    conditions: Collection[str],
    untimed: bool,
) -> dict[str, int]:
    """Places of the columns of a log; those of another log of the sensor may be missing."""
    known = dict.fromkeys((*AXES, *CONDITIONS, *conditions))
    for key in layout.columns:
        if key not in known:
            raise UnknownNameError("column", key, [each for each in known if each != "time"])
    columns = layout.columns | ({} if layout.time is None else {"time": layout.time})
    found = ((key, find_column(source, key, columns.get(key))) for key in AXES)
    places = {key: place for key, place in found if place is not None}
    if not places and len(source.names) == 3:
        places = dict(zip(AXES, range(3), strict=True))
    for key in (key for key in AXES if key not in places):
        raise _not_found(source, key)
    _check_different(source, places)
    for key in conditions:
        if key == "time" and layout.rate_hz is not None:
            continue
        needed = key == "time" and not untimed
        try:
            place = find_column(source, key, columns.get(key))
            if place is None and needed:
                raise _not_found(source, key)
        except InputError as error:
            if key in given.keys() | given.get("columns", {}).keys():
                raise
            if needed:
                raise InputError(
                    f"{error}; give the column of time (`time`), or the rate (`rate`), or, for a "
                    "log without the moves between positions, the samples of each (`block`)"
                ) from None
            continue
        if place is not None and (key in columns or key == "time" or place not in places.values()):
            places[key] = place
    _check_different(source, places)
    if "time" in places:  # in whole seconds, "stamp.secs", it has a column of ns, "stamp.nsecs"
        parts = ((i, _NANOSECONDS.fullmatch(name)) for i, name in enumerate(source.names))
        whole = source.names[places["time"]]
        rest = [i for i, part in parts if part and part[1] + part[3] == whole]
        if len(rest) == 1:
            places["nanoseconds"] = rest[0]
    return places


def find_column(source: Source, key: str, column: Place | None = None) -> int | None:
    """Place of the column of a key: as given, or by its usual names; None if no name tells it.

    Digits are a place, unless a column has them as its name.

    Raises
    ------
    InputError
        If the column that is given does not exist, or has dates instead of numbers.
    """
    names = source.names
    if column is None:
        found = places_by_name(names, key) or ([*source.dates] if key == "time" else [])
    elif source.named and isinstance(column, str) and column in names:
        if names.count(column) > 1:
            raise InputError(f"{source.path}: {key}: there are several columns {column!r}")
        found = [names.index(column)]
    else:
        # A unit in brackets belongs to the column, and may be in one of the names only.
        plain = without_unit(str(column))
        found = [i for i, name in enumerate(names) if without_unit(name) == plain]
        if not (source.named and isinstance(column, str) and len(found) == 1):
            if not re.fullmatch(r"[0-9]{1,9}", str(column)) or int(column) >= len(names):
                raise InputError(
                    f"{source.path}: {key}: no column {column!r}; there are {short_list(names)}, "
                    "counted from 0"
                )
            found = [int(column)]
    if len(found) != 1:
        return None
    if found[0] in source.dates and key != "time":
        name = names[found[0]]
        raise InputError(f"{source.path}: column {name} is timestamps, not numbers ({key})")
    return found[0]


def _not_found(source: Source, key: str) -> InputError:
    how = "" if key == "time" else f"; give `columns` {key}=NAME, or its number"
    return InputError(
        f"{source.path}: which column is {key}? The columns are "
        f"{short_list(source.names) or 'none'}, counted from 0{how}"
    )


def _check_different(source: Source, places: Mapping[str, int]) -> None:
    if len({*places.values()}) < len(places):
        raise InputError(f"{source.path}: two of {', '.join(places)} name the same column")


def _units(source: Source, places: Mapping[str, int]) -> dict[str, str]:
    """Units of the forces and of the time, as far as the names of their columns tell them."""
    units: dict[str, str] = {}
    of_axes = {unit_in(source.names[places[axis]], axis) for axis in AXES}
    if len(of_axes) == 1 and (unit := of_axes.pop()) in SENSOR_UNITS:
        units["unit"] = unit
    dated = "nanoseconds" in places or places.get("time") in source.dates
    if "time" in places and not dated and (unit := unit_in(source.names[places["time"]], "time")):
        units["time_unit"] = unit
    return units


# --- Its numbers ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class SensorLog:
    """The log of one sensor in one file.

    Attributes
    ----------
    source : Source, what gives the numbers as they stand in the file
    layout : LogLayout, how they are read
    places : mapping of "fx", "fy", "fz" and perhaps "time", "nanoseconds" (to be added to a time
        in whole seconds) and `CONDITIONS` to columns
    """

    source: Source
    layout: LogLayout
    places: Mapping[str, int]

    @property
    def path(self) -> Path:
        """Name of the log in messages."""
        return self.source.path

    @property
    def conversion(self) -> Conversion:
        """Conversion of forces to m/s², in the axes of the log."""
        return conversion_of(self.layout.unit, self.layout.scale, self.layout.offset)

    @property
    def time_factor(self) -> float:
        """S per unit of the column of time."""
        if self.places.get("time") in self.source.dates:
            return UNITS["s"]["ns"]
        return UNITS["s"]["s" if "nanoseconds" in self.places else self.layout.time_unit]

    @property
    def conditions(self) -> tuple[str, ...]:
        """What the log has besides forces and time."""
        return tuple(key for key in self.places if key not in (*AXES, "time", "nanoseconds"))

    @property
    def rows(self) -> Mapping[str, Array]:
        """All rows in SI, each column (n,) by its key; what is no number, or absurd, is NaN.

        They are time, s since the first row that has one, if anything tells it; fx, fy, fz, m/s²,
        in forward, right, down; and the conditions, °C or m/s².
        """
        return self._numbers[0]

    @property
    def forces(self) -> Array:
        """Forces of `rows`, (n, 3), m/s²; each axis in one piece."""
        return self._numbers[1]

    @property
    def start(self) -> float:
        """First time of `rows` in the file, s; NaN without a column of time."""
        return self._numbers[2]

    @cached_property
    def _numbers(self) -> tuple[Mapping[str, Array], Array, float]:
        numbers = self.source.numbers([*self.places.values()])
        values = dict(zip(self.places, numbers, strict=True))
        rows, start, count = {}, np.nan, len(values["fx"])
        if "time" in values:
            time, start = _counted_from_first(values["time"])
            time = _usable(time)
            time *= self.time_factor
            if "nanoseconds" in values:
                time += 1e-9 * _usable(values["nanoseconds"])
            first = next(iter(time[np.isfinite(time)]), 0.0)
            time -= first
            rows["time"], start = time, start * self.time_factor + first
        elif self.layout.rate_hz is not None:
            rows["time"] = np.arange(count) / self.layout.rate_hz
        frame, conversion, forces = self.layout.axes, self.conversion, np.empty((3, count))
        for force, sign, i in zip(forces, frame.signs, frame.order, strict=True):
            own = conversion.axis(i)
            np.subtract(values.pop(AXES[i]), own.offset, out=force)
            force *= sign * own.scale
        # The unit may be wrong, which the means of the holds show, but it is the same in all rows.
        usual = _usable(np.abs(forces[:, :SAMPLED_ROWS]).max(axis=0))
        usual = usual[np.isfinite(usual)]
        limit = max([MAX_FORCE, *([1000 * np.median(usual)] if len(usual) else [])])
        for key, force in zip(AXES, forces, strict=True):
            rows[key] = _usable(force, limit)
        rows |= {key: _usable(values[key]) for key in self.conditions}
        return rows, forces.T, start

    @cached_property
    def lost(self) -> NDArray[np.bool_]:
        """Which rows lack a force, or the time that they should have, (n,)."""
        needed = [*AXES, *(("time",) if "time" in self.places else ())]
        return np.any([np.isnan(self.rows[key]) for key in needed], axis=0)

    def lacking(self, row: int) -> list[str]:
        """Keys of the readings that a row lacks; axes are those of the log."""
        of_frame = dict(zip(self.layout.axes.order, AXES, strict=True))
        named = {key: of_frame[i] for i, key in enumerate(AXES)}
        lost = {key for key, values in self.rows.items() if np.isnan(values[row])}
        return [key for key in self.places if named.get(key, key) in lost]

    def describe(self, row: int, key: str | None = None) -> str:
        """Say what stands in a row for "time", "fx", …, by default for the first that it lacks.

        This reads the file again to find it.
        """
        key = key or self.lacking(row)[0]
        place = self.places[key]
        where, cell = self.source.look_up(row, place)
        return f"{where}, column {self.source.names[place]} ({key}): {cell}"


def _counted_from_first(values: NDArray[Any]) -> tuple[Array, float]:
    """Numbers counted from the first of them, and that first one; NaN if there is none.

    Whole numbers, such as times in ns, are counted as integers.
    """
    zero = next(iter(values[np.isfinite(values)]), np.nan)
    if values.dtype.kind in "iu" and isinstance(zero, np.integer):
        return (values.astype(np.int64) - zero.astype(np.int64)).astype(float), float(zero)
    return values - float(zero), float(zero)


def _usable(values: NDArray[Any], largest: float = MAX_VALUE) -> Array:
    """Numbers of at most ±`largest`, by default those that can be calculated with; else NaN.

    An array of floats is changed itself, unless nothing may write to it.
    """
    absurd = ~((values >= -largest) & (values <= largest))
    if not absurd.any():
        return np.asarray(values, dtype=float)
    numbers = np.require(values, float, "W")
    numbers[absurd] = np.nan
    return numbers


class Recording:
    """The logs of one sensor, often only one, in their order: all rows that lack no reading.

    Parameters
    ----------
    parts : sequence of SensorLog

    Attributes
    ----------
    parts
    first : SensorLog, which has the layout of all
    path : Path, first of the files
    step : float, s, usual time between two samples: the mean, without gaps. Steps may jitter or be
        multiples of a clock's tick. So the median may be far from the mean, and only the mean fits
        the number of samples
    starts : (k,) array, s, time of the first sample of each part as written in its file; NaN
        without any
    timed : bool, whether the times of the parts count from one zero, so that they follow each other
    time : (n,) array, s, since the first sample; if the times of the parts do not tell, each begins
        where the last one ends
    forces : (n, 3) array, m/s², in forward, right, down; each axis in one piece
    conditions : mapping of str to (n,) arrays, those of `CONDITIONS` that all parts have
    lengths : list of int, samples of each part

    Raises
    ------
    InputError
        If time does not increase, a channel is constant, a log is empty, or many rows lack a
        reading.
    """

    def __init__(self, parts: Sequence[SensorLog]) -> None:
        self.parts, self.first = parts, parts[0]
        self.path = self.first.path
        times = [_checked_time(part, alone=len(parts) == 1) for part in parts]
        self.step = self._usual_step(times)
        firsts = [time[0] for time in times]
        self.starts = np.array([part.start for part in parts]) + firsts
        self.timed = bool(np.all(np.diff(self.starts) > 0))
        end = 0.0
        for i, (part, first) in enumerate(zip(parts, firsts, strict=True)):
            start = self.starts[i] - self.starts[0] if i and self.timed else end
            if i and start < end - self.step / 2:  # a clock rounds
                raise InputError(f"{part.path}: begins before the recording before it ends")
            times[i] = times[i] - (first if "time" in part.places else 0.0) + start
            end = times[i][-1] + self.step
        self.time = np.concatenate(times) if times[1:] else times[0]
        self.forces = self._concatenate([part.forces.T for part in parts]).T
        self.conditions = {
            key: self._concatenate([part.rows[key] for part in parts])
            for key in CONDITIONS
            if all(key in part.places for part in parts)
        }
        self.lengths = [len(each) for each in times]

    @property
    def part(self) -> NDArray[np.int_]:
        """Number of the part of each sample, from 0, (n,)."""
        return np.repeat(np.arange(len(self.parts)), self.lengths)

    @property
    def row(self) -> NDArray[np.int_]:
        """Number of the row of each sample in its part, from 0, (n,)."""
        return self._concatenate([np.arange(len(part.lost)) for part in self.parts])

    def _concatenate(self, columns: Sequence[NDArray[Any]]) -> NDArray[Any]:
        """Columns of the parts, (..., n) each, without the rows that lack a reading."""
        each = zip(columns, self.parts, strict=True)
        whole = [values[..., ~part.lost] if part.lost.any() else values for values, part in each]
        return np.concatenate(whole, axis=-1) if whole[1:] else whole[0]

    def _usual_step(self, times: Sequence[Array]) -> float:
        """Usual time between two samples, s, which is that of all parts."""
        steps = [
            usual_step(np.diff(time))
            if "time" in part.places
            else 1.0 / (part.layout.rate_hz or 1.0)
            for part, time in zip(self.parts, times, strict=True)
        ]
        odd = [i for i, step in enumerate(steps) if not 0.9 < step / steps[0] < 1.1]
        if odd:
            raise InputError(
                f"{self.parts[odd[0]].path}: {1 / steps[odd[0]]:.6g} samples per second, but "
                f"{1 / steps[0]:.6g} in {self.path}"
            )
        return float(np.mean(steps))

    def warnings(self) -> list[str]:
        """What could not be read."""
        said: list[str] = []
        for part in self.parts:
            said += part.source.warnings
            if part.lost.any():
                rows = np.flatnonzero(part.lost)
                each = "; ".join(part.describe(row) for row in rows[:MAX_NAMED].tolist())
                more = "; …" if len(rows) > MAX_NAMED else ""
                said.append(
                    f"{len(rows)} of {plural(len(part.lost), 'row')} left out, as a reading is "
                    f"missing or absurd: {each}{more}"
                )
        return said

    def unit_hint(self) -> str:
        """Hint at the unit of time that would give a usual rate; empty if the rate is usual."""
        if "time" not in self.first.places:
            return ""
        step = self.step / self.first.time_factor
        rates = {unit: 1 / (step * UNITS["s"][unit]) for unit in CLOCK_UNITS}
        unit = min(rates, key=lambda unit: abs(np.log(rates[unit] / _USUAL_RATE)))
        if UNITS["s"][unit] == self.first.time_factor:
            return ""
        return (
            f"; if its times are in {unit}, there are {rates[unit]:.4g} samples per second: give "
            f"`time_unit` {unit}"
        )


def _checked_time(part: SensorLog, alone: bool) -> Array:
    """Times in a log of its rows that lack nothing, (n,), which are checked."""
    lost, place = part.lost, part.places.get("time")
    used = ~lost if lost.any() else slice(None)
    time = part.rows.get("time", np.arange(float(len(lost))))[used]
    backward = np.diff(time) <= 0
    if place is not None and backward.any():
        row = int(np.flatnonzero(~lost)[1 + np.argmax(backward)])
        where, cell = part.source.look_up(row, place)
        raise InputError(
            f"{part.path}: {where}, column {part.source.names[place]} (time): time does not "
            f"increase ({cell}); the rate (`rate`) does without it"
        )
    if lost.sum() > MAX_BAD_SHARE * len(lost):
        row = int(np.argmax(lost))
        hint = "; give the rate (`rate`) instead" if part.lacking(row)[0] == "time" else ""
        raise InputError(
            f"{part.path}: {part.describe(row)}, not a usable number{hint}; {lost.sum()} of "
            f"{plural(len(lost), 'row')} lack one, which are too many"
        )
    if len(lost) < 2 or (place is not None and len(time) < 2):
        raise InputError(f"{part.path}: too few samples ({len(time)})")
    # In a single position, a channel of a coarse sensor may be constant.
    constant = [bool((force == force[0]).all()) for force in part.forces[used].T]
    if alone and any(constant):
        axis = AXES[min(part.layout.axes.order[np.array(constant)])]
        name = part.source.names[part.places[axis]]
        raise InputError(f"{part.path}: column {name} ({axis}) is constant")
    return time


def usual_step(steps: Array) -> float:
    """Mean step of time, without gaps: steps of `GAP_RATIO` times the mean or more."""
    kept = steps
    while True:
        mean = float(np.mean(kept))
        without = steps[steps <= GAP_RATIO * mean]
        if len(without) == len(kept):
            return mean
        kept = without
