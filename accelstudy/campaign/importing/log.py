"""A log: its raw table, and its samples in SI, whatever file or memory it came from."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from numpy.typing import NDArray

from accelstudy.basics.arguments import path_of
from accelstudy.basics.arrays import Array, CachedTable
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import CLOCK_UNITS, UNITS
from accelstudy.basics.wording import plural
from accelstudy.campaign.columns import COLUMNS
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.columns import (
    AXES,
    CONDITIONS,
    MEANS,
    NONE,
    find_column,
    resolve_layout,
    unit_in,
    which_column,
)
from accelstudy.campaign.importing.formats import read_table, table_in_memory
from accelstudy.campaign.importing.raw_table import RawTable
from accelstudy.sensors.conversion import MAX_VALUE

MAX_FORCE = 1e4
"""m/s², some 1000 g: what levels gives no larger reading."""
SAMPLED_ROWS = 1000
"""Rows of a log that tell how large its readings are."""
MAX_BAD_SHARE = 0.05
"""Share of rows without a usable reading from which on no holds are looked for in a log."""
MAX_NAMED = 3
"""Rows that are named of those left out."""
GAP_RATIO = 5.0
"""A step of time that is this many times the usual one is a gap."""
MAX_RATE_ERROR = 0.05
"""Relative difference between a given rate and that of a column of time from which on a warning
says so."""
CLOCK_ENDS = (2**32, 86_400 * 10**9)
"""Ticks after which a clock begins anew: a counter of 32 bits, and a time of day in ns."""
_USUAL_RATE = 100.0
"""1/s; of several units of time the likely one gives the rate nearest to it."""


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A log of one sensor: its raw table and its samples.

    Attributes
    ----------
    raw : RawTable
    settings : mapping, keys of `LogLayout` that were said of it
    layout : LogLayout, how its numbers are read; what was not said is told from the format and the
        names
    places : mapping, places of the columns of "fx", "fy", "fz" and what else is known
    samples : DataFrame, all rows in SI; what is no number, or absurd, is NaN. The columns are time,
        s since the first row that has one, by the rate, or the number of the row where nothing
        tells it; fx, fy, fz, m/s², in forward, right, down; and the conditions, such as
        temperature, °C
    tick : float, s, unit of its times in the file
    start : float, s, first time in the file; NaN without a column of time
    wrap : int, row at which its clock first began anew, and was counted on; None if it did not
    parts : tuple of Log, of which this one is joined; see `join`
    """

    raw: RawTable
    settings: Mapping[str, Any]
    layout: LogLayout
    places: Mapping[str, int]
    samples: CachedTable = CachedTable()  # noqa: RUF009
    tick: float = 1.0
    start: float = np.nan
    wrap: int | None = None
    parts: tuple[Log, ...] = ()

    @property
    def path(self) -> Path:
        """Name of the log in messages."""
        return self.raw.path

    def __repr__(self) -> str:
        return f"Log({', '.join([repr(self.path.name), *self.settings])})"

    def _repr_html_(self) -> str:
        from accelstudy.pages.notebook import notebook_html

        given = pd.DataFrame(self.settings.items(), columns=["setting", "value"], dtype=object)
        return notebook_html("Log", self.path.name, given)

    @property
    def timed(self) -> bool:
        """Whether a column or a rate tells the times of the samples."""
        return "time" in self.places or self.layout.rate is not None

    @property
    def conditions(self) -> tuple[str, ...]:
        """What the log has besides forces and time."""
        return tuple(key for key in self.places if key in CONDITIONS)

    @property
    def used(self) -> dict[str, str]:
        """Labels of the columns that are read, by their keys, such as "fx"."""
        return {key: self.raw.labels[place] for key, place in self.places.items()}

    @property
    def unused(self) -> list[str]:
        """Labels of the other columns."""
        used = {*self.places.values()}
        return [label for place, label in enumerate(self.raw.labels) if place not in used]

    @cached_property
    def forces(self) -> Array:
        """Forces of the samples, (n, 3), m/s²; each axis in one piece."""
        return self.samples.iloc[:, 1:4].to_numpy()

    def column(self, key: str) -> Array:
        """Numbers of the column of a key as they are in the file, (n,); NaN where there is none."""
        return _usable(self.raw.numbers(self.places[key]))

    # --- rows that lack a reading ----------------------------------------------------------------

    @cached_property
    def lost(self) -> NDArray[np.bool_]:
        """Which rows lack a force, or the time that they should have, (n,)."""
        return np.isnan(self.samples.iloc[:, :4].to_numpy()).T.any(axis=0)

    def unreadable(self, row: int) -> list[str]:
        """Keys of the readings that a row lacks; axes are those of the log."""
        of_frame = dict(zip(self.layout.axes.order, AXES, strict=True))
        named = {key: of_frame[i] for i, key in enumerate(AXES)}
        lost = {key for key, value in self.samples.iloc[row].items() if np.isnan(value)}
        lost |= {key for key in self.places if key in MEANS and np.isnan(self.column(key)[row])}
        return [key for key in self.places if named.get(key, key) in lost]

    def describe(self, row: int, key: str | None = None) -> str:
        """Say what stands in a row for "time", "fx", …, by default for the first that it lacks."""
        key = key or self.unreadable(row)[0]
        where, cell = self.raw.look_up(row, self.places[key])
        return f"{where}, column {self.raw.names[self.places[key]]} ({key}): {cell}"

    def check_units(self, conditions: Collection[str]) -> None:
        """Refuse conditions that look like another unit, by the median of the first rows."""
        for key in [key for key in self.conditions if key in conditions]:
            usual = float(self.samples[key][:SAMPLED_ROWS].median())
            if np.isfinite(usual):
                column = f"{self.used[key]} ({key}; `columns` {key}={NONE} takes none)"
                COLUMNS[key].within.check_key(f"{self.path}: column {column}", usual)

    def warnings(self) -> list[str]:
        """What could not be read."""
        if self.parts:
            return [line for part in self.parts for line in part.warnings()]
        said = [*self.raw.warnings, *self._contradicted_rate()]
        if self.wrap is not None:
            where = self.describe(self.wrap, "time")
            said.append(f"the clock wraps around, and is counted on: {where}")
        if self.lost.any():
            rows = np.flatnonzero(self.lost)
            each = "; ".join(self.describe(row) for row in rows[:MAX_NAMED].tolist())
            more = "; …" if len(rows) > MAX_NAMED else ""
            said.append(
                f"{len(rows)} of {plural(len(self.lost), 'row')} left out, as a reading is missing "
                f"or absurd: {each}{more}"
            )
        return said

    def _contradicted_rate(self) -> list[str]:
        """Say that times of a known unit tell another rate than the one that was given."""
        raw, rate = self.raw, self.layout.rate
        place = None if rate is None else find_column(raw, "time")
        if rate is None or place is None:
            return []
        unit = "ns" if place in raw.dates else unit_in(raw.names[place], "time")
        if unit is None:
            return []
        ticks, tick = _ticks(raw, unit, {"time": place})
        step = tick * float(np.median(np.diff(ticks)))
        if step <= 0 or abs(step * rate - 1) <= MAX_RATE_ERROR:
            return []
        told = f"{1 / step:.6g} samples per second"
        return [f"column {raw.names[place]} tells {told}, and `rate` {rate:g} was taken"]

    # --- what holds are looked for in ------------------------------------------------------------

    def check_timed(self) -> None:
        """Raise `InputError` unless something tells the times of the samples."""
        if not self.timed and (unclear := self.raw.unclear_dates):
            raise InputError(
                f"{self.path}: column {unclear[0]}: dates as 3/1/2024 do not tell month and day "
                "apart; write 2024-03-01, or give the rate (`rate`)"
            )
        if not self.timed:
            raise InputError(
                f"{which_column(self.raw, 'time')}; give the column of time (`time`), or the rate "
                "(`rate`), or, for a log without the moves between positions, the samples of each "
                "(`block`)"
            )

    @cached_property
    def whole_samples(self) -> pd.DataFrame:
        """Samples that lack nothing, by their rows.

        Raises
        ------
        InputError
            If time does not increase, they are few, or many rows lack a reading.
        """
        lost = self.lost
        samples = self.samples[~lost] if lost.any() else self.samples
        self.check_order(samples["time"])
        if lost.sum() > MAX_BAD_SHARE * len(lost):
            row = int(np.argmax(lost))
            hint = "; give the rate (`rate`) instead" if self.unreadable(row)[0] == "time" else ""
            raise InputError(
                f"{self.path}: {self.describe(row)}, not a usable number{hint}; {lost.sum()} of "
                f"{plural(len(lost), 'row')} lack one, which are too many"
            )
        if len(samples) < 2:
            raise InputError(f"{self.path}: too few samples ({len(samples)})")
        return samples

    def check_order(self, time: pd.Series[float], *, coarse: bool = False) -> None:
        """Raise `InputError` if times of rows go back or, unless the clock may be coarse, stay."""
        backward = np.diff(time) < 0 if coarse else np.diff(time) <= 0
        if self.places.get("time") is not None and backward.any():
            row = int(time.index[1 + int(np.argmax(backward))])
            raise InputError(
                f"{self.path}: {self.describe(row, 'time')}, not after the row above; sort the "
                "rows by time, take those of one sensor, or, if its clock is coarse or began anew, "
                "give `rate`"
            )

    @cached_property
    def step(self) -> float:
        """Usual time between two samples, s: the mean, without gaps.

        Steps may jitter or be multiples of a clock's tick. So the median may be far from the mean,
        and only the mean fits the number of samples.
        """
        if self.parts:
            return float(np.mean([part.step for part in self.parts]))
        if "time" not in self.places:
            return 1.0 / (self.layout.rate or 1.0)
        steps = kept = np.diff(self.whole_samples["time"])
        while True:
            mean = float(np.mean(kept))
            without = steps[steps <= GAP_RATIO * mean]
            if len(without) == len(kept):
                return mean
            kept = without

    def unit_hint(self) -> str:
        """Hint at the unit of time that would give a usual rate; empty if the rate is usual.

        Recordings have a unit of their own, whatever the rate.
        """
        of_format = self.raw.layout.get("time_unit") == self.layout.time_unit
        if "time" not in self.places or of_format:
            return ""
        rates = {unit: self.tick / (self.step * UNITS["s"][unit]) for unit in CLOCK_UNITS}
        unit = min(rates, key=lambda unit: abs(np.log(rates[unit] / _USUAL_RATE)))
        if UNITS["s"][unit] == self.tick:
            return ""
        return (
            f"; if its times are in {unit}, there are {rates[unit]:.4g} samples per second: give "
            f"`time_unit` {unit}"
        )

    # --- what is joined of parts -----------------------------------------------------------------

    @cached_property
    def time(self) -> Array:
        """Times of the samples, (n,), s."""
        return self.samples["time"].to_numpy()

    @property
    def part(self) -> NDArray[np.int_]:
        """Number of the part of each sample, from 0, (n,)."""
        lengths = [len(part.whole_samples) for part in self.parts]
        return np.repeat(np.arange(len(lengths)), lengths)

    @property
    def starts(self) -> Array:
        """Time of the first sample of each part as written in its file, s; NaN without any."""
        return np.array([p.start + p.whole_samples["time"].iloc[0] for p in self.parts])

    @property
    def has_one_clock(self) -> bool:
        """Whether the times of the parts count from one zero, so that they follow each other."""
        return bool(np.all(np.diff(self.starts) > 0))


AnyLog = str | PathLike[str] | pd.DataFrame | Log
"""Where a log is: the path of a file, a table in memory, or what was read before."""


def read_log(
    log: AnyLog,
    given: Mapping[str, Any],
    like: LogLayout | None = None,
    more: Collection[str] = (),
) -> Log:
    """Read a log of any kind.

    Parameters
    ----------
    log : path, table or Log
    given : mapping, keys of `LogLayout`, which go before those of a Log
    like : LogLayout, how another log of the sensor was read; see `resolve_layout`
    more : columns that are looked for besides those of a log, as of a table of means

    Raises
    ------
    InputError
        If it cannot be read.
    """
    known = log.settings if isinstance(log, Log) else {}
    usual = None if like is None else like.variable
    given, variable = {**known, **given}, given.get("variable", usual)
    if isinstance(log, pd.DataFrame):
        raw = table_in_memory(log)
    elif isinstance(log, Log) and given.get("variable") == known.get("variable"):
        raw = log.raw
    else:
        path = log.path if isinstance(log, Log) else log
        raw = read_table(path_of("log", path, "a path or a DataFrame"), variable)
    layout, places = resolve_layout(raw, given, like, more)
    return Log(raw, given, layout, places, *_convert(raw, layout, places))


def _convert(
    raw: RawTable, layout: LogLayout, places: Mapping[str, int]
) -> tuple[pd.DataFrame, float, float, int | None]:
    """Convert the columns of a log to SI; also `tick`, `start` and `wrap` of the `Log`."""
    conditions = [key for key in places if key in CONDITIONS]
    tick, start, wrap, count = 1.0, np.nan, None, len(raw.content)
    columns = ["time", *AXES, *conditions]
    values = np.empty((len(columns), count))
    if "time" in places:
        ticks, tick = _ticks(raw, layout.time_unit, places)
        ticks, start = _counted_from_first(ticks)
        ticks, wrap = _count_on(ticks)
        start *= tick
        np.multiply(_usable(ticks), tick, out=values[0])
    else:
        np.divide(np.arange(count), layout.rate or 1.0, out=values[0])
    frame, conversion, forces = layout.axes, layout.conversion, values[1:4]
    for force, sign, i in zip(forces, frame.signs, frame.order, strict=True):
        own = conversion.axis(i)
        np.subtract(raw.numbers(places[AXES[i]]), own.offset, out=force)
        force *= sign * own.scale
    # The unit may be wrong, which the means of the holds show, but it is the same in all rows.
    usual = _usable(np.abs(forces[:, :SAMPLED_ROWS]).max(axis=0))
    usual = usual[np.isfinite(usual)]
    limit = max([MAX_FORCE, *([1000 * np.median(usual)] if len(usual) else [])])
    for force in forces:
        _usable(force, limit)
    for condition, key in zip(values[4:], conditions, strict=True):
        condition[:] = _usable(raw.numbers(places[key]))
    pa.default_memory_pool().release_unused()
    return pd.DataFrame(values.T, columns=columns, copy=False), tick, start, wrap


def _ticks(raw: RawTable, unit: str, places: Mapping[str, int]) -> tuple[NDArray[Any], float]:
    """Times of a log, (n,), in ticks, and a tick, s: a unit, or 1 ns of dates and stamps of ROS."""
    if places["time"] in raw.dates:
        return raw.nanoseconds(places["time"]), 1e-9
    times = raw.numbers(places["time"])
    if "nanoseconds" not in places:
        return times, UNITS["s"][unit]
    seconds = times.astype(np.int64) if times.dtype.kind in "iu" else times
    return seconds * 10**9 + raw.numbers(places["nanoseconds"]), 1e-9


def _count_on(ticks: Array) -> tuple[Array, int | None]:
    """Ticks (n,) of a clock that never begins anew, and the row at which it first did."""
    steps = np.diff(ticks)
    if not (steps < 0).any():
        return ticks, None
    added, usual = np.zeros(len(ticks)), np.nanmedian(steps)
    for end in CLOCK_ENDS:
        added[1:] += end * np.cumsum((steps + end > 0) & (steps + end <= GAP_RATIO * usual))
    return ticks + added, int(np.argmax(added > 0)) if added.any() else None


def join(logs: Sequence[Log]) -> Log:
    """Join the logs of one sensor, often only one, in their order: all rows that lack nothing.

    Times count from the first sample and, if those of the logs do not tell, each begins where the
    last one ends.

    Raises
    ------
    InputError
        If the logs differ in rate or overlap, or a channel is constant; see `Log.whole_samples`.
    """
    first, samples = logs[0], [log.whole_samples for log in logs]
    joined = replace(first, parts=tuple(logs))
    end = 0.0
    for i, log in enumerate(logs):
        if not 0.9 < log.step / first.step < 1.1:
            raise InputError(
                f"{log.path}: {1 / log.step:.6g} samples per second, but {1 / first.step:.6g} in "
                f"{first.path}"
            )
        start = joined.starts[i] - joined.starts[0] if i and joined.has_one_clock else end
        if i and start < end - joined.step / 2:  # a clock rounds
            raise InputError(f"{log.path}: begins before the recording before it ends")
        shift = start - (samples[i]["time"].iloc[0] if "time" in log.places else 0.0)
        if shift:
            samples[i] = samples[i].assign(time=samples[i]["time"] + shift)
        end = samples[i]["time"].iloc[-1] + joined.step
    whole = pd.concat(samples, join="inner") if samples[1:] else samples[0]
    joined = replace(joined, samples=whole)
    # In a single position, a channel of a coarse sensor may be constant.
    if len(logs) == 1 and (constant := np.ptp(joined.forces, axis=0) == 0).any():
        axis = AXES[min(first.layout.axes.order[constant])]
        name = first.raw.names[first.places[axis]]
        raise InputError(f"{first.path}: column {name} ({axis}) is constant")
    return joined


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
    if len(values) and values.min() >= -largest and values.max() <= largest:  # not if one is NaN
        return np.asarray(values, dtype=float)
    numbers = np.require(values, float, "W")
    numbers[~((numbers >= -largest) & (numbers <= largest))] = np.nan
    return numbers
