"""A log: its raw table, and its samples in SI, whatever file or memory it came from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
from accelstudy.basics.errors import InputError
from accelstudy.basics.units import UNITS
from accelstudy.basics.wording import one_line
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.columns import AXES, ORDINARY, resolve_layout
from accelstudy.campaign.importing.formats import open_source
from accelstudy.campaign.importing.sources import Source
from accelstudy.sensors.conversion import MAX_VALUE

Array = NDArray[np.float64]

MAX_FORCE = 1e4
"""m/s², some 1000 g: what levels gives no larger reading."""
SAMPLED_ROWS = 1000
"""Rows of a log that tell how large its readings are."""


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A log of one sensor: its raw table and its samples.

    Attributes
    ----------
    source : Source, the raw table
    given : mapping, keys of `LogLayout` that were said of it
    table : DataFrame, the table in memory, as it was given; None of a file
    like : LogLayout, how another log of the sensor was read; see `resolve_layout`
    wanted : sequence of str, what to look for beside the forces
    untimed : bool, whether it may have neither a time nor a rate
    """

    source: Source
    given: Mapping[str, Any]
    table: pd.DataFrame | None = None
    like: LogLayout | None = None
    wanted: Sequence[str] = ORDINARY
    untimed: bool = False

    @property
    def path(self) -> Path:
        """Name of the log in messages."""
        return self.source.path

    @property
    def name(self) -> str:
        """Name of the file; DataFrame, of a table in memory."""
        return self.path.name

    def __repr__(self) -> str:
        return f"Log({', '.join([repr(self.name), *self.given])})"

    def _repr_html_(self) -> str:
        from accelstudy.pages.notebook import notebook_html

        given = pd.DataFrame(self.given.items(), columns=["setting", "value"], dtype=object)
        return notebook_html("Log", self.name, given)

    @cached_property
    def _resolved(self) -> tuple[LogLayout, dict[str, int]]:
        return resolve_layout(self.source, self.given, self.like, self.wanted, self.untimed)

    @property
    def layout(self) -> LogLayout:
        """How its numbers are read; what was not said is told from the format and the names."""
        return self._resolved[0]

    @property
    def places(self) -> Mapping[str, int]:
        """Places of the columns of "fx", "fy", "fz" and what else is known, by these keys."""
        return self._resolved[1]

    @property
    def timed(self) -> bool:
        """Whether a column or a rate tells the times of the samples."""
        return "time" in self.places or self.layout.rate_hz is not None

    @property
    def dated(self) -> bool:
        """Whether its times are dates or times of day."""
        return self.places.get("time") in self.source.dates

    @property
    def time_factor(self) -> float:
        """S per unit of the column of time."""
        unit = "s" if "nanoseconds" in self.places else self.layout.time_unit
        return UNITS["s"]["ns" if self.dated else unit]

    @property
    def conditions(self) -> tuple[str, ...]:
        """What the log has besides forces and time."""
        return tuple(key for key in self.places if key not in (*AXES, "time", "nanoseconds"))

    @property
    def samples(self) -> pd.DataFrame:
        """All rows in SI; what is no number, or absurd, is NaN.

        The columns are time, s since the first row that has one, by the rate, or the number of the
        row where nothing tells it; fx, fy, fz, m/s², in forward, right, down; and the conditions,
        such as temperature, °C.
        """
        return self._numbers[0]

    @property
    def forces(self) -> Array:
        """Forces of the samples, (n, 3), m/s²; each axis in one piece."""
        return forces_of(self.samples)

    @property
    def start(self) -> float:
        """First time in the file, s; NaN without a column of time."""
        return self._numbers[1]

    @cached_property
    def _numbers(self) -> tuple[pd.DataFrame, float]:
        def raw(key: str) -> NDArray[Any]:
            return self.source.numbers(self.places[key])

        start, columns, count = np.nan, ["time", *AXES, *self.conditions], len(self.source.table)
        values = np.empty((len(columns), count))
        if "time" in self.places:
            time, start = _counted_from_first(raw("time"))
            time = _usable(time) * self.time_factor
            if "nanoseconds" in self.places:
                time += 1e-9 * _usable(raw("nanoseconds"))
            first = next(iter(time[np.isfinite(time)]), 0.0)
            start = start * self.time_factor + first
            np.subtract(time, first, out=values[0])
        else:
            np.divide(np.arange(count), self.layout.rate_hz or 1.0, out=values[0])
        frame, conversion, forces = self.layout.axes, self.layout.conversion, values[1:4]
        for force, sign, i in zip(forces, frame.signs, frame.order, strict=True):
            own = conversion.axis(i)
            np.subtract(raw(AXES[i]), own.offset, out=force)
            force *= sign * own.scale
        # The unit may be wrong, which the means of the holds show, but it is the same in all rows.
        usual = _usable(np.abs(forces[:, :SAMPLED_ROWS]).max(axis=0))
        usual = usual[np.isfinite(usual)]
        limit = max([MAX_FORCE, *([1000 * np.median(usual)] if len(usual) else [])])
        for force in forces:
            _usable(force, limit)
        for column, key in zip(values[4:], self.conditions, strict=True):
            column[:] = _usable(raw(key))
        pa.default_memory_pool().release_unused()
        return pd.DataFrame(values.T, columns=columns, copy=False), start

    @cached_property
    def lost(self) -> NDArray[np.bool_]:
        """Which rows lack a force, or the time that they should have, (n,)."""
        return np.isnan(self.samples.iloc[:, :4].to_numpy()).T.any(axis=0)

    def lacking(self, row: int) -> list[str]:
        """Keys of the readings that a row lacks; axes are those of the log."""
        of_frame = dict(zip(self.layout.axes.order, AXES, strict=True))
        named = {key: of_frame[i] for i, key in enumerate(AXES)}
        lost = {key for key, value in self.samples.iloc[row].items() if np.isnan(value)}
        return [key for key in self.places if named.get(key, key) in lost]

    def describe(self, row: int, key: str | None = None) -> str:
        """Say what stands in a row for "time", "fx", …, by default for the first that it lacks."""
        key = key or self.lacking(row)[0]
        where, cell = self.source.look_up(row, self.places[key])
        return f"{where}, column {self.source.names[self.places[key]]} ({key}): {cell}"


AnyLog = str | PathLike[str] | Source | pd.DataFrame | Log
"""Where a log is: the path of a file, a table in memory, or what was opened before."""


def open_log(log: AnyLog, given: Mapping[str, Any], **how: Any) -> Log:
    """Open a log of any kind.

    Parameters
    ----------
    log : path, table or Log
    given : mapping, keys of `LogLayout`, which go before those of a Log
    how : other fields of `Log`

    Raises
    ------
    InputError
        If it cannot be opened.
    """
    if isinstance(log, pd.DataFrame):
        return _log_in_memory(log, given, **how)
    if isinstance(log, Log):
        how = {**how, "given": {**log.given, **given}}
        if (variable := how["given"].get("variable")) != log.given.get("variable"):
            how["source"] = open_source(log.path, variable)
        same = all(getattr(log, name) == value for name, value in how.items())
        return log if same else replace(log, **how)  # with its samples
    if isinstance(log, Source):
        return Log(log, given, **how)
    like = how.get("like")
    variable = given.get("variable") or (like and like.variable)
    return Log(open_source(path_of("log", log, "a path or a DataFrame"), variable), given, **how)


def _log_in_memory(table: pd.DataFrame, given: Mapping[str, Any], **how: Any) -> Log:
    """Make a log of a table; times of an index of dates or durations become its last column."""
    table = table.copy()  # what its owner changes later is not of this log
    rows, index, name = table, table.index, str(table.index.name or "time")
    timed = isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex)
    if timed and not {"rate_hz", "time"} & {*given} and name not in map(str, table.columns):
        times = index.total_seconds() if isinstance(index, pd.TimedeltaIndex) else index
        rows, given = rows.assign(**{name: times}), {**given, "time": name}
    try:
        typed = pa.Table.from_pandas(rows.rename(columns=str), preserve_index=False)
    except (TypeError, ValueError, NotImplementedError) as error:
        reason = one_line(error.args[-1])
        raise InputError(
            f"log: the DataFrame cannot be a log, which has numbers: {reason}"
        ) from None
    return Log(Source("DataFrame", typed), given, table, **how)


def forces_of(samples: pd.DataFrame) -> Array:
    """Forces (n, 3), m/s², of samples, without a copy."""
    return samples.iloc[:, 1:4].to_numpy()


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
