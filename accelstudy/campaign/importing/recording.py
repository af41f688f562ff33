"""Raw accelerometer logs.

A log is text (comma, semicolon, tab or blanks between numbers, with or without header and comment
lines), a MATLAB file or a Parquet file. It gives times in s since its first sample, and specific
forces in m/s². An error is one line with its place in the file.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import CLOCK_UNITS, SENSOR_UNITS, UNITS
from accelstudy.basics.wording import counted, short_list
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.names import (
    places_by_name,
    unit_in,
    without_unit,
)
from accelstudy.campaign.importing.opening import open_source
from accelstudy.campaign.importing.sources import LogFile, Source, counted_from_first
from accelstudy.files.reading import overlay
from accelstudy.sensors.conversion import LARGEST, Conversion, conversion_of

if TYPE_CHECKING:
    import pyarrow as pa

Array = NDArray[np.float64]

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


def read_log(
    path: LogFile,
    layout: LogLayout | None = None,
    *,
    like: LogLayout | None = None,
    conditions: Collection[str] = ("time", *CONDITIONS),
    untimed: bool = False,
) -> Log:
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
    chosen = _laid_over(like, given, kind)
    source = open_source(path, chosen.variable, chosen.delimiter)
    if like is None or like.columns.get("fx") not in source.names:
        own = {**told_by_names(source, chosen.columns, chosen.time)}
        if "rate_hz" in given:
            own.pop("time", None)
        chosen = _laid_over(like, overlay(own, given), kind)
    try:
        places = _places(source, chosen, given, conditions, untimed)
    except InputError as error:
        if like is None or "columns" in given:
            raise
        raise InputError(
            f"{error}; the columns are those of the log of the campaign, `columns` and `time` "
            "change them"
        ) from None
    return Log(
        source,
        chosen,
        places,
        time_factor_of(source, places, chosen.time_unit),
        conversion_of(chosen.unit, chosen.scale, chosen.offset),
    )


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
    columns = dict(layout.columns)
    for key in columns:
        if key not in (known := dict.fromkeys((*AXES, *CONDITIONS, *conditions))):
            raise UnknownNameError("column", key, [each for each in known if each != "time"])
    places = locate(source, {k: v for k, v in columns.items() if k in AXES}, AXES)
    if layout.time is not None:
        columns["time"] = layout.time
    for key in conditions:
        if key == "time" and layout.rate_hz is not None:
            continue
        wanted = {key: columns[key]} if key in columns else {}
        needed = key == "time" and not untimed
        try:
            place = locate(source, wanted, (key,), needed)
        except InputError as error:
            if key in given.keys() | given.get("columns", {}).keys():
                raise
            if needed:
                raise InputError(
                    f"{error}; give the column of time (`time`), or the rate (`rate`), or, for a "
                    "log without the moves between positions, the samples of each (`block`)"
                ) from None
            continue
        if key in ("time", *wanted) or not {*place.values()} & {*places.values()}:
            places |= place
    if len({*places.values()}) < len(places):
        raise InputError(f"{source.path}: two of {', '.join(places)} name the same column")
    return places | nanoseconds_beside(source, places)


def locate(
    source: Source, given: Mapping[str, Place], wanted: Sequence[str], needed: bool = True
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
    source: Source, columns: Mapping[str, Place], time: Place | None
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
        raise InputError(f"{source.path}: column {name} tells its unit; leave `time_unit` out")
    return 1e-9 if dated else UNITS["s"][time_unit]


def _place(source: Source, key: str, column: Place) -> int:
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


class Rows(NamedTuple):
    """All rows of a log, n of them; what is no number, or absurd, is NaN.

    Attributes
    ----------
    time : (n,) array, s since the first row that has one; None where nothing tells it
    forces : (n, 3) array, m/s², in forward, right, down
    conditions : mapping of `CONDITIONS`, as far as the log has them, to (n,) arrays, °C or m/s²
    lost : mapping of "time", "fx", … to (n,) bool arrays, where a reading is missing or absurd
    start : float, s, where the times begin in the file; NaN without a column of time
    """

    time: Array | None
    forces: Array
    conditions: dict[str, Array]
    lost: dict[str, NDArray[np.bool_]]
    start: float


@dataclass(frozen=True)
class Log:
    """The log of one sensor in one file.

    Attributes
    ----------
    source : Source, what gives the numbers as they stand in the file
    layout : LogLayout, how they are read
    places : mapping of "fx", "fy", "fz" and perhaps "time", "nanoseconds" (to be added to a time
        in whole seconds) and `CONDITIONS` to columns
    time_factor : float, s per unit of the column of time, of whose dates these are ns
    conversion : Conversion, of forces to m/s², in the axes of the log
    lively : bool, whether each channel must change; in a single position, one of a coarse sensor
        may be constant
    beside : mapping of names to columns of other sensors, which lose the same rows
    """

    source: Source
    layout: LogLayout
    places: Mapping[str, int]
    time_factor: float
    conversion: Conversion
    lively: bool = True
    beside: Mapping[str, int] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """Name of the log in messages."""
        return self.source.path

    @property
    def conditions(self) -> tuple[str, ...]:
        """What the log has besides forces and time."""
        return tuple(key for key in self.places if key not in (*AXES, "time", "nanoseconds"))

    @cached_property
    def table(self) -> pa.Table:
        """Rows as they are in the file, with all their columns; by unique names."""
        import pyarrow as pa

        names = unique_names(self.source)
        return pa.table(self.source.columns(range(len(names))), names=names)

    @cached_property
    def rows(self) -> Rows:
        """All rows; of those of `table`, if that was asked for before."""
        columns = {**self.places, **self.beside}
        places = [*columns.values()]
        cells = [self.table.column(p) for p in places] if "table" in vars(self) else None
        values = dict(zip(columns, self.source.numbers(places, cells), strict=True))
        count, start, time = len(values["fx"]), np.nan, None
        if "time" in self.places:
            values["time"], start = counted_from_first(values["time"])
        lost = {key: ~(np.abs(column) <= LARGEST) for key, column in values.items()}
        if "time" in self.places:
            time = values.pop("time") * self.time_factor + 1e-9 * values.pop("nanoseconds", 0)
            if "nanoseconds" in lost:
                lost["time"] |= lost.pop("nanoseconds")
            known = np.flatnonzero(~lost["time"])
            first = time[known[0]] if len(known) else 0.0
            time, start = time - first, start * self.time_factor + first
        elif self.layout.rate_hz is not None:
            time = np.arange(count) / self.layout.rate_hz
        conversion, frame = self.conversion, self.layout.axes
        usual = np.column_stack([values[axis][:TYPICAL] for axis in AXES])
        limit = absurd_from(usual, conversion)
        # Each axis in one piece, as sums along it are faster.
        forces = np.empty((3, count))
        to = np.argsort(frame.order)
        for i, key in enumerate((*AXES, *self.beside)):
            reading = values.pop(key)
            converted = conversion.of_axis(i % 3).to_si(reading)
            lost[key] |= absurd(reading, converted, limit)
            if key in AXES:
                forces[to[i]] = np.where(lost[key], np.nan, frame.signs[to[i]] * converted)
        conditions = {k: np.where(lost.pop(k), np.nan, values[k]) for k in self.conditions}
        return Rows(time, forces.T, conditions, lost, start)

    @cached_property
    def samples(self) -> Samples:
        """Samples from the beginning to the end; times count from the first one.

        Raises
        ------
        InputError
            If time does not increase, a channel is constant, the log is empty, or many rows lack a
            reading.
        """
        time, forces, known, lost, _ = self.rows
        if time is None:
            time = np.arange(float(len(forces)))
        row = np.flatnonzero(~np.any([*lost.values()], axis=0))
        conditions = np.array([*known.values()]).reshape(len(known), len(forces))
        if len(row) < len(forces):
            time, forces, conditions = time[row], forces.T[:, row].T, conditions[:, row]
        if "time" in self.places and len(row):
            time = time - time[0]
        samples = Samples(time, forces, conditions.T, row, np.zeros(len(row), dtype=int))
        self._check(samples)
        return samples

    @cached_property
    def step(self) -> float:
        """Usual time between two samples, s: the mean, without gaps.

        Steps may jitter or be multiples of a clock's tick. So the median may be far from the mean,
        and only the mean fits the number of samples.
        """
        if "time" not in self.places:
            return 1.0 / (self.layout.rate_hz or 1.0)
        if len(self.samples.time) < 2:
            raise InputError(f"{self.path}: too few samples")
        return usual_step(np.diff(self.samples.time))

    @property
    def start(self) -> float:
        """Time of the first sample as written in the file, s; NaN without a column of time."""
        time = self.rows.time
        return self.rows.start + (0.0 if time is None else float(time[self.samples.row[0]]))

    def likely_unit(self) -> str:
        """Hint at the unit of time that would give a usual rate; empty if the rate is usual."""
        if "time" not in self.places:
            return ""
        step = self.step / self.time_factor
        rates = {unit: 1 / (step * UNITS["s"][unit]) for unit in CLOCK_UNITS}
        unit = min(rates, key=lambda unit: abs(np.log(rates[unit] / _USUAL_RATE)))
        if UNITS["s"][unit] == self.time_factor:
            return ""
        return (
            f"; if its times are in {unit}, there are {rates[unit]:.4g} samples per second: give "
            f"`time_unit` {unit}"
        )

    def _check(self, samples: Samples) -> None:
        rows, frame = len(self.rows.forces), self.layout.axes
        backward = np.diff(samples.time) <= 0
        if "time" in self.places and backward.any():
            row = int(samples.row[1 + np.argmax(backward)])
            where, cell = self.source.look_up(row, self.places["time"])
            raise InputError(
                f"{self.path}: {where}, column {self.source.names[self.places['time']]} (time): "
                f"time does not increase ({cell}); give the rate if it does not count"
            )
        count = rows - len(samples.row)
        if count > MANY * rows:
            key = self._lost_in(first := int(self._unusable[0]))
            hint = "; give the rate (`rate`) instead" if key == "time" else ""
            raise InputError(
                f"{self.path}: {self.describe(first, key)}, not a usable number{hint}; "
                f"{count} of {counted(rows, 'row')} lack one, which are too many"
            )
        if rows < 2:
            raise InputError(f"{self.path}: too few samples ({rows})")
        constant = (samples.forces == samples.forces[:1]).all(axis=0)[np.argsort(frame.order)]
        if self.lively and constant.any():
            axis = AXES[int(np.argmax(constant))]
            name = self.source.names[self.places[axis]]
            raise InputError(f"{self.path}: column {name} ({axis}) is constant")

    def warnings(self) -> list[str]:
        """What could not be read."""
        unusable = self._unusable
        if not len(unusable):
            return [*self.source.warnings]
        named = [int(row) for row in unusable[:NAMED]]
        each = "; ".join(self.describe(row, self._lost_in(row)) for row in named)
        more = "; …" if len(unusable) > len(named) else ""
        return [
            *self.source.warnings,
            f"{len(unusable)} of {counted(len(self.rows.forces), 'row')} left out, as a reading is "
            f"missing or absurd: {each}{more}",
        ]

    @property
    def _unusable(self) -> NDArray[np.int_]:
        return np.flatnonzero(np.any([*self.rows.lost.values()], axis=0))

    def _lost_in(self, row: int) -> str:
        """What is missing in an unusable row."""
        return next(key for key, lost in self.rows.lost.items() if lost[row])

    def describe(self, row: int, key: str) -> str:
        """Say what stands in a row for "time", "fx", …; this reads the file again to find it."""
        place = {**self.places, **self.beside}[key]
        where, cell = self.source.look_up(row, place)
        return f"{where}, column {self.source.names[place]} ({key}): {cell}"


def unique_names(source: Source) -> list[str]:
    """Names of the columns, all different: `column_0` … of a log without names."""
    if not source.named:
        return [f"column_{place}" for place in range(len(source.names))]
    before = [source.names[:place].count(name) for place, name in enumerate(source.names)]
    return [f"{name}.{n}" if n else name for name, n in zip(source.names, before, strict=True)]


@dataclass(frozen=True)
class Recording:
    """The logs of one sensor, often only one, in their order.

    Attributes
    ----------
    parts : tuple of Log
    """

    parts: Sequence[Log]

    @property
    def first(self) -> Log:
        """The first of the logs, which has the layout of all."""
        return self.parts[0]

    @property
    def path(self) -> Path:
        """First of the files."""
        return self.first.path

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
                f"{1 / steps[0]:.6g} in {self.path}"
            )
        return float(np.mean(steps))

    @cached_property
    def timed(self) -> bool:
        """Whether the times of the parts count from one zero, so that they follow each other."""
        return bool(np.all(np.diff([part.start for part in self.parts]) > 0))

    def likely_unit(self) -> str:
        """See `Log`."""
        return self.first.likely_unit()

    @cached_property
    def samples(self) -> Samples:
        """Samples of all parts; if their times do not tell, each begins where the last one ends."""
        if len(self.parts) == 1:
            return self.first.samples
        end, parts = 0.0, []
        for i, part in enumerate(self.parts):
            start = part.start - self.first.start if self.timed else end
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


def usual_step(steps: Array) -> float:
    """Mean step of time, without gaps: steps of `GAP` times the mean or more."""
    kept = steps
    while True:
        mean = float(np.mean(kept))
        without = steps[steps <= GAP * mean]
        if len(without) == len(kept):
            return mean
        kept = without
