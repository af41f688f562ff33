"""Raw accelerometer logs.

A log is text (comma, semicolon, tab or blanks between numbers, with or without header and comment
lines), a MATLAB file or a Parquet file. It gives times in s since its first sample, and specific
forces in m/s². An error is one line with its place in the file.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import CLOCK_UNITS, SENSOR_UNITS, UNITS
from accelstudy.basics.wording import counted, short_list
from accelstudy.campaign.importing.names import (
    places_by_name,
    unit_in,
    without_unit,
)
from accelstudy.campaign.importing.opening import open_source
from accelstudy.campaign.importing.sources import LogFile, Source, counted_from_first
from accelstudy.sensors.conversion import LARGEST, Conversion, conversion_of
from accelstudy.sensors.frames import FRD, Frame

Array = NDArray[np.float64]

Column = str | int
"""A column by its name in the header, or by its place, counted from 0."""

AXES = ("fx", "fy", "fz")

CONDITIONS = ("temperature", "vibration")
"""Columns of a log besides time and forces."""
ABSURD = 1e4
"""m/s², some 1000 g: what levels gives no larger reading."""
SENTINELS = (2.0**31 - 1, -(2.0**31), 1 - 2.0**31, 2.0**32 - 1)
"""Numbers that stand for a missing reading: the ends of the integers of 32 bits."""
TYPICAL = 1000
"""Rows of a log that tell how large its readings are."""
MANY = 0.05
"""Share of rows without a usable reading from which on a log is refused."""
NAMED = 3
"""Rows that are named of those left out."""
GAP = 5.0
"""A step of time that is this many times the usual one is a gap."""
_NANOSECONDS = re.compile(r"(.*?)n(ano)?(secs?)", re.IGNORECASE)
"""Whole seconds of a stamp of ROS, where there is no other time, and the rest of it."""
_TIME_OR_CONDITION = re.compile(
    r".*(time|date|stamp|secs?|seq|index|temp|vibration|status).*|t|n|id", re.IGNORECASE
)
_USUAL_RATE = 100.0
"""1/s; of several units of time the likely one gives the rate nearest to it."""


class Samples(NamedTuple):
    """Samples of a log, n of them, in their order; rows without a usable reading are left out.

    Attributes
    ----------
    time : (n,) array, s
    forces : (n, 3) array, m/s², in forward, right, down
    conditions : (n, c) array, °C or m/s², NaN where nothing is known
    row : (n,) int array, row of the table that each sample comes from
    recording : (n,) int array, which of several recordings it belongs to
    """

    time: Array
    forces: Array
    conditions: Array
    row: NDArray[np.int_]
    recording: NDArray[np.int_]


def open_log(
    path: LogFile,
    *,
    columns: Mapping[str, Column] | None = None,
    time: Column | None = None,
    rate: float | None = None,
    untimed: bool = False,
    unit: str = "m/s^2",
    scale: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    time_unit: str = "s",
    variable: str | None = None,
    delimiter: str | None = None,
    frame: Frame = FRD,
    source: Source | None = None,
) -> Log:
    """Find out how a log is laid out.

    Parameters
    ----------
    path : anything that `open_source` opens
    columns : mapping of "fx", "fy", "fz", "temperature" and "vibration" to columns; by their names
        in the header if omitted, or the only three columns there are. The last two may be absent.
    time : column of time; by its name in the header if omitted
    rate : float, samples per second, instead of a column of time
    untimed : bool, whether a log may have neither; its times are numbers of samples then
    unit : "m/s^2", "g", "mg" or "counts"
    scale, offset : number or (3,), with counts only: f = (raw − offset) · scale, in m/s²
    time_unit : "s", "ms", "us" or "ns"
    variable : str, which array of a MATLAB file, topic of a bag or sensor of a flight log
    delimiter : str, between the columns of a text, see `LogLayout`
    frame : Frame, the axes of the log
    source : Source, the file if it is open already

    Raises
    ------
    InputError
        If the file cannot be read or lacks a column.
    """
    conversion = conversion_of(unit, scale, offset)
    if time_unit not in CLOCK_UNITS:
        raise UnknownNameError("unit of time", time_unit, CLOCK_UNITS)
    if rate is not None and time is not None:
        raise InputError(f"{path}: give the rate or the column of time, not both")
    if rate is not None and not (np.isfinite(rate) and rate > 0):
        raise InputError(f"{path}: the rate must be positive, not {rate:g}")
    source = source or open_source(path, variable, delimiter)
    given = dict(columns or {})
    for key in given:
        if key not in (*AXES, *CONDITIONS):
            raise UnknownNameError("column", key, (*AXES, *CONDITIONS))
    places = locate(source, {k: v for k, v in given.items() if k in AXES}, AXES)
    if rate is None:
        wanted = {} if time is None else {"time": time}
        try:
            places = {**places, **locate(source, wanted, ("time",))}
        except InputError as error:
            if time is not None:
                raise
            if not untimed:
                raise InputError(
                    f"{error}; give the column of time (--time), or the rate (--rate), or, for a "
                    "log without the moves between positions, the samples of each (--block)"
                ) from None
            rate = 1.0
    for key in CONDITIONS:
        wanted = {key: given[key]} if key in given else {}
        place = locate(source, wanted, (key,), needed=False)
        if key in given or not {*place.values()} & {*places.values()}:
            places |= place
    if len(set(places.values())) < len(places):
        raise InputError(f"{path}: two of {', '.join(places)} name the same column")
    return Log(
        path=source.path,
        source=source,
        places=places | nanoseconds_beside(source, places),
        rate=rate,
        time_factor=time_factor_of(source, places, time_unit),
        conversion=conversion,
        frame=frame,
    )


def locate(
    source: Source, given: Mapping[str, Column], wanted: Sequence[str], needed: bool = True
) -> dict[str, int]:
    """Places of the wanted columns: as given, by their usual names, or the only three columns.

    Raises
    ------
    InputError
        If a column does not exist, is named twice, or (where `needed`) cannot be found.
    """
    for key in given:
        if key not in wanted:
            raise UnknownNameError("column", key, wanted)
    places = {key: _place(source, key, column) for key, column in given.items()}
    for key in wanted:
        matches = places_by_name(source.names, key) or (
            [*source.dates] if key == "time" else []  # whatever its name
        )
        if len(matches) == 1:
            places.setdefault(key, matches[0])
    if not places and tuple(wanted[:3]) == AXES and len(source.names) == 3:
        places = dict(zip(AXES, range(3), strict=True))
    for key, place in places.items():
        if place in source.dates and key != "time":
            name = source.names[place]
            raise InputError(f"{source.path}: column {name} is timestamps, not numbers ({key})")
    missing = [key for key in wanted if key not in places]
    if needed and set(missing) & set(AXES) and _has_two_axes(source):
        raise InputError(
            f"{source.path}: two axes, as of an inclinometer, cannot be calibrated: the length of "
            "the force is compared with gravity, and that takes all three axes"
        )
    if needed and missing:
        raise InputError(
            f"{source.path}: which column is {missing[0]}? "
            f"The columns are {short_list(source.names)}, counted from 0"
        )
    if len(set(places.values())) < len(places):
        raise InputError(f"{source.path}: two of {', '.join(places)} name the same column")
    return places


def _has_two_axes(source: Source) -> bool:
    """Whether a log has two columns besides times and temperatures."""
    if not source.named:
        return len(source.names) == 2
    names = [name for i, name in enumerate(source.names) if i not in source.dates]
    return sum(not _TIME_OR_CONDITION.fullmatch(name) for name in names) == 2


def nanoseconds_beside(source: Source, places: Mapping[str, int]) -> dict[str, int]:
    """Column of the ns that belong to a time in whole seconds: "stamp.nsecs" to "stamp.secs"."""
    if "time" not in places:
        return {}
    seconds = source.names[places["time"]]
    parts = ((i, _NANOSECONDS.fullmatch(name)) for i, name in enumerate(source.names))
    found = [i for i, part in parts if part and part[1] + part[3] == seconds]
    return {"nanoseconds": found[0]} if len(found) == 1 else {}


def told_by_names(
    source: Source, columns: Mapping[str, Column], time: Column | None
) -> Mapping[str, Any]:
    """Keys of `LogLayout` that the names of the columns tell: the units of forces and of time."""
    own: dict[str, Any] = dict(source.layout)
    forces = {key: column for key, column in columns.items() if key in AXES}
    try:
        axes = locate(source, {**forces, **own.get("columns", {})}, AXES, needed=False)
        clock = locate(source, {} if time is None else {"time": time}, ("time",), needed=False)
    except InputError:  # who opens the log says it
        return own
    units = {unit_in(source.names[axes[axis]], axis) for axis in AXES if axis in axes}
    if len(units) == 1 and units & set(SENSOR_UNITS):
        own.setdefault("unit", units.pop())
    dated = clock.get("time") in source.dates or nanoseconds_beside(source, clock)
    if clock and not dated and (unit := unit_in(source.names[clock["time"]], "time")):
        own.setdefault("time_unit", unit)
    return own


def time_factor_of(source: Source, places: Mapping[str, int], time_unit: str) -> float:
    """Seconds per unit of the column of time.

    Raises
    ------
    InputError
        If a column of dates, or of seconds beside ns, gets a unit.
    """
    dated = places.get("time") in source.dates
    known = dated or "nanoseconds" in nanoseconds_beside(source, places)
    if "time" in places and time_unit != "s" and known:
        name = source.names[places["time"]]
        raise InputError(f"{source.path}: column {name} tells its unit; leave --time-unit out")
    return 1e-9 if dated else UNITS["s"][time_unit]


def _place(source: Source, key: str, column: Column) -> int:
    """Place of a column; digits are a place, unless a column has them as its name."""
    names = source.names
    if source.named and isinstance(column, str) and column in names:
        if names.count(column) > 1:
            raise InputError(f"{source.path}: {key}: there are several columns {column!r}")
        return names.index(column)
    # A unit in brackets belongs to the column, and may be in one of the names only.
    plain = [i for i, name in enumerate(names) if without_unit(name) == without_unit(str(column))]
    if source.named and isinstance(column, str) and len(plain) == 1:
        return plain[0]
    if isinstance(column, str) and re.fullmatch(r"[0-9]{1,9}", column):
        column = int(column)
    if isinstance(column, int):
        if 0 <= column < len(names):
            return column
        raise InputError(
            f"{source.path}: {key}: no column {column}; there are {len(names)}, counted from 0"
        )
    raise InputError(f"{source.path}: {key}: no column {column!r}; there are {short_list(names)}")


def absurd(raw: Array, forces: Array, limit: float) -> NDArray[np.bool_]:
    """Which readings are none that a sensor gives; raw and in m/s², `limit` as below."""
    return (np.abs(forces) > limit) | np.isin(raw, SENTINELS)


def absurd_from(raw: Array, conversion: Conversion) -> float:
    """Size, m/s², from which on a reading is absurd: `ABSURD`, and a thousand times the usual one.

    The latter since the unit, which may be wrong, is checked by the means of the holds. `raw` are
    the readings of a log, (n, 3).
    """
    raw = raw[:TYPICAL]
    raw = raw[(np.abs(raw) <= LARGEST).all(axis=1) & ~np.isin(raw, SENTINELS).any(axis=1)]
    usual = np.median(np.linalg.norm(conversion.to_si(raw), axis=1)) if len(raw) else 0.0
    return max(ABSURD, 1000 * float(usual))


@dataclass(frozen=True)
class Losses:
    """Rows of a log that are left out, since a reading is missing or absurd.

    Attributes
    ----------
    rows, count : int, rows of the log, and how many of them are left out
    first : list of (row, key), the first ones, and what is missing there
    """

    rows: int
    count: int
    first: list[tuple[int, str]]


@dataclass(frozen=True)
class Log:
    """A raw log whose layout is known.

    Attributes
    ----------
    path : Path
    source : Source, what gives the numbers as they stand in the file
    places : mapping of "fx", "fy", "fz" and perhaps "time", "nanoseconds" (to be added to a time
        in whole seconds) and `CONDITIONS` to columns
    rate : float, 1/s; None with a column of time
    time_factor : float, s per unit of that column, of whose dates these are ns
    conversion : Conversion, of forces to m/s², in the axes of the log
    frame : Frame, the axes of the log
    lively : bool, whether each channel must change; in a single position, one of a coarse sensor
        may be constant
    beside : mapping of names to columns of other sensors, which lose the same rows
    """

    path: Path
    source: Source
    places: Mapping[str, int]
    rate: float | None
    time_factor: float
    conversion: Conversion
    frame: Frame
    lively: bool = True
    beside: Mapping[str, int] = field(default_factory=dict)

    @property
    def conditions(self) -> tuple[str, ...]:
        """Which of `CONDITIONS` the log has."""
        return tuple(key for key in CONDITIONS if key in self.places)

    @property
    def samples(self) -> Samples:
        """Samples from the beginning to the end; times count from the first one.

        Raises
        ------
        InputError
            If time does not increase, a channel is constant, the log is empty, or many rows lack a
            reading.
        """
        return self._read[0]

    @property
    def losses(self) -> Losses:
        """Rows that are no samples."""
        return self._read[1]

    @cached_property
    def step(self) -> float:
        """Usual time between two samples, s: the mean, without gaps.

        Steps may jitter or be multiples of a clock's tick. So the median may be far from the mean,
        and only the mean fits the number of samples.
        """
        if self.rate is not None:
            return 1.0 / self.rate
        if len(self.samples.time) < 2:
            raise InputError(f"{self.path}: too few samples")
        return usual_step(np.diff(self.samples.time))

    @property
    def start(self) -> float:
        """Time of the first sample as written in the file, s; NaN without a column of time."""
        return self._read[2]

    def likely_unit(self) -> str:
        """Hint at the unit of time that would give a usual rate; empty if the rate is usual."""
        if self.rate is not None:
            return ""
        step = self.step / self.time_factor
        rates = {unit: 1 / (step * UNITS["s"][unit]) for unit in CLOCK_UNITS}
        unit = min(rates, key=lambda unit: abs(np.log(rates[unit] / _USUAL_RATE)))
        if UNITS["s"][unit] == self.time_factor:
            return ""
        return (
            f"; if its times are in {unit}, there are {rates[unit]:.4g} samples per second: give "
            f"--time-unit {unit}"
        )

    @cached_property
    def _read(self) -> tuple[Samples, Losses, float]:
        columns = {**self.places, **self.beside}
        values = dict(zip(columns, self.source.numbers([*columns.values()]), strict=True))
        time, start = np.arange(len(values["fx"])) / (self.rate or 1.0), np.nan
        if self.rate is None:
            values["time"], start = counted_from_first(values["time"])
            time = values["time"] * self.time_factor + 1e-9 * values.get("nanoseconds", 0)
        lost = {key: ~(np.abs(column) <= LARGEST) for key, column in values.items()}
        usual = np.column_stack([values[axis][:TYPICAL] for axis in AXES])
        limit = absurd_from(usual, self.conversion)
        for axes in (AXES, *zip(*[iter(self.beside)] * 3, strict=True)):
            converted = []
            for i, key in enumerate(axes):
                reading = values.pop(key)
                converted.append(self.conversion.of_axis(i).to_si(reading))
                lost[key] |= absurd(reading, converted[i], limit)
            if axes is AXES:
                # Each axis in one piece, as sums along it are faster.
                forces = self.frame.to_frd(np.array(converted).T)
        unknown = [lost.pop(key) for key in self.conditions]
        conditions = np.empty((len(forces), len(unknown)), order="F")
        for i, (key, none) in enumerate(zip(self.conditions, unknown, strict=True)):
            conditions[:, i] = np.where(none, np.nan, values[key])
        usable = ~np.any([*lost.values()], axis=0)
        row = np.flatnonzero(usable)
        if len(row) < len(usable):
            time, forces, conditions = time[row], forces[row], conditions[row]
        first = [
            (int(i), next(key for key, none in lost.items() if none[i]))
            for i in np.flatnonzero(~usable)[:NAMED]
        ]
        losses = Losses(len(usable), len(usable) - len(row), first)
        if self.rate is None and len(row):
            start = start * self.time_factor + time[0]
            time = time - time[0]
        samples = Samples(
            time,
            np.asfortranarray(forces),
            np.asfortranarray(conditions),
            row,
            np.zeros(len(row), dtype=int),
        )
        self._check(samples, losses)
        return samples, losses, start

    def _check(self, samples: Samples, losses: Losses) -> None:
        backward = np.diff(samples.time) <= 0
        if self.rate is None and backward.any():
            row = int(samples.row[1 + np.argmax(backward)])
            where, cell = self.source.look_up(row, self.places["time"])
            raise InputError(
                f"{self.path}: {where}, column {self.source.names[self.places['time']]} (time): "
                f"time does not increase ({cell}); give the rate if it does not count"
            )
        if losses.count > MANY * losses.rows:
            hint = "; give the rate (--rate) instead" if losses.first[0][1] == "time" else ""
            raise InputError(
                f"{self.path}: {self._lost(*losses.first[0])}, not a usable number{hint}; "
                f"{losses.count} of {counted(losses.rows, 'row')} lack one, which are too many"
            )
        if losses.rows < 2:
            raise InputError(f"{self.path}: too few samples ({losses.rows})")
        constant = (samples.forces == samples.forces[:1]).all(axis=0)[np.argsort(self.frame.order)]
        if self.lively and constant.any():
            axis = AXES[int(np.argmax(constant))]
            name = self.source.names[self.places[axis]]
            raise InputError(f"{self.path}: column {name} ({axis}) is constant")

    def warnings(self) -> list[str]:
        """What could not be read."""
        losses = self.losses
        if not losses.count:
            return [*self.source.warnings]
        each = "; ".join(self._lost(*first) for first in losses.first)
        more = "; …" if losses.count > len(losses.first) else ""
        return [
            *self.source.warnings,
            f"{losses.count} of {counted(losses.rows, 'row')} left out, as a reading is missing or "
            f"absurd: {each}{more}",
        ]

    def _lost(self, row: int, key: str) -> str:
        """Say what is missing in a row."""
        place = {**self.places, **self.beside}[key]
        where, cell = self.source.look_up(row, place)
        return f"{where}, column {self.source.names[place]} ({key}): {cell}"


@dataclass(frozen=True)
class LogSeries:
    """Several logs of one sensor, each a recording of its own.

    Attributes
    ----------
    parts : tuple of Log, in their order
    """

    parts: Sequence[Log]

    @property
    def path(self) -> Path:
        """First of the files."""
        return self.parts[0].path

    @property
    def conditions(self) -> tuple[str, ...]:
        """Conditions that all parts have."""
        return tuple(k for k in CONDITIONS if all(k in part.places for part in self.parts))

    @cached_property
    def step(self) -> float:
        """Usual time between two samples, s."""
        steps = [part.step for part in self.parts]
        odd = [i for i, step in enumerate(steps) if not 0.9 < step / steps[0] < 1.1]
        if odd:
            raise InputError(
                f"{self.parts[odd[0]].path}: {1 / steps[odd[0]]:.6g} samples per second, but "
                f"{1 / steps[0]:.6g} in {self.parts[0].path}"
            )
        return float(np.mean(steps))

    @cached_property
    def timed(self) -> bool:
        """Whether the times of the parts count from one zero, so that they follow each other."""
        starts = np.array([part.start for part in self.parts])
        return bool(np.all(np.diff(starts) > 0))

    def likely_unit(self) -> str:
        """See `Log`."""
        return self.parts[0].likely_unit()

    @cached_property
    def samples(self) -> Samples:
        """Samples of all parts; if their times do not tell, each begins where the last one ends."""
        end, parts = 0.0, []
        for i, part in enumerate(self.parts):
            start = part.start - self.parts[0].start if self.timed else end
            if start < end - self.step / 2:  # a clock rounds
                raise InputError(f"{part.path}: begins before the recording before it ends")
            columns = [part.conditions.index(key) for key in self.conditions]
            own = part.samples
            parts.append(
                own._replace(
                    time=own.time + start,
                    conditions=own.conditions[:, columns],
                    recording=own.recording + i,
                )
            )
            end = start + own.time[-1] + self.step
        return Samples(*(np.concatenate(each) for each in zip(*parts, strict=True)))


Recording = Log | LogSeries
"""What the detector of holds takes: a log, or several."""


def usual_step(steps: Array) -> float:
    """Mean step of time, without gaps: steps of `GAP` times the mean or more."""
    kept = steps
    while True:
        mean = float(np.mean(kept))
        without = steps[steps <= GAP * mean]
        if len(without) == len(kept):
            return mean
        kept = without
