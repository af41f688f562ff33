"""Raw accelerometer logs, read piece by piece, so that their size does not matter.

A log is text (comma, semicolon, tab or blanks between numbers, with or without header and comment
lines), a MATLAB file or a Parquet file. It gives times in s and specific forces in m/s²; whatever
is wrong with it is said in one line with the place where it stands.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.campaign.log_files import CHUNK, Source, open_source
from accelstudy.campaign.wording import listed
from accelstudy.errors import InputError, UnknownNameError
from accelstudy.units import UNITS

Array = NDArray[np.float64]
Column = str | int
"""A column by its name in the header, or by its place, counted from 0."""

AXES = ("fx", "fy", "fz")
TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
GAP = 5.0
"""A step of time this many times the usual one is a gap."""

_LARGEST = 1e15  # beyond it nothing is an acceleration or a time, and squares overflow
_KNOWN_NAMES = {
    "fx": r"f_?x|a_?x|acc?_?x|acc?el_?x|accelerationx|acceleration_x|x",
    "fy": r"f_?y|a_?y|acc?_?y|acc?el_?y|accelerationy|acceleration_y|y",
    "fz": r"f_?z|a_?z|acc?_?z|acc?el_?z|accelerationz|acceleration_z|z",
    "time": r"t|time|time_s|timestamp|seconds",
    "n_samples": r"n|n_samples|count",
    "sd_fx": r"sd_?f?x|s_?x|sd_a_?x",
    "sd_fy": r"sd_?f?y|s_?y|sd_a_?y",
    "sd_fz": r"sd_?f?z|s_?z|sd_a_?z",
}


def open_log(
    path: str | Path,
    *,
    columns: Mapping[str, Column] | None = None,
    time: Column | None = None,
    rate: float | None = None,
    unit: str = "m/s^2",
    scale: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    time_unit: str = "s",
    variable: str | None = None,
    chunk_size: int = CHUNK,
) -> Log:
    """Find out how a log is laid out.

    Parameters
    ----------
    path : file; .parquet, .mat (binary or ASCII), anything else is text
    columns : mapping of "fx", "fy", "fz" to columns; by their names in the header if omitted, or
        the only three columns there are
    time : column of time; by its name in the header if omitted
    rate : float, samples per second, instead of a column of time
    unit : "m/s^2", "g" or "counts"
    scale, offset : number or (3,), with counts only: f = (raw − offset) · scale, in m/s²
    time_unit : "s", "ms", "us" or "ns"
    variable : str, which array of a MATLAB file
    chunk_size : int, rows held in memory at a time

    Raises
    ------
    InputError
        If the file cannot be read or lacks a column.
    """
    factor, shift = conversion(unit, scale, offset)
    if time_unit not in TIME_UNITS:
        raise UnknownNameError("unit of time", time_unit, TIME_UNITS)
    if rate is not None and time is not None:
        raise InputError(f"{path}: give the rate or the column of time, not both")
    if rate is not None and not (np.isfinite(rate) and rate > 0):
        raise InputError(f"{path}: the rate must be positive, not {rate:g}")
    source = open_source(path, variable)
    places = locate(source, columns or {}, AXES)
    if rate is None:
        wanted = {} if time is None else {"time": time}
        try:
            places = {**places, **locate(source, wanted, ("time",))}
        except InputError as error:
            if time is not None:
                raise
            raise InputError(f"{error}; give the column of time, or the rate") from None
    return Log(Path(path), source, places, rate, TIME_UNITS[time_unit], factor, shift, chunk_size)


@dataclass(frozen=True)
class Log:
    """A raw log whose layout is known.

    Attributes
    ----------
    path : Path
    source : Source, what gives the numbers as they stand in the file
    places : mapping of "fx", "fy", "fz" and perhaps "time" to columns
    rate : float, 1/s; None with a column of time
    time_factor : float, s per unit of that column
    scale, offset : (3,), f = (raw − offset) · scale
    chunk_size : int, rows held in memory at a time
    """

    path: Path
    source: Source
    places: Mapping[str, int]
    rate: float | None
    time_factor: float
    scale: Array
    offset: Array
    chunk_size: int

    @cached_property
    def step(self) -> float:
        """Usual time between two samples, s: the median over the first chunk."""
        if self.rate is not None:
            return 1.0 / self.rate
        time, _ = next(self.chunks(), (np.empty(0), None))
        if len(time) < 2:
            raise InputError(f"{self.path}: too few samples ({len(time)})")
        return float(np.median(np.diff(time)))

    def chunks(self) -> Iterator[tuple[Array, Array]]:
        """Times (k,), s, and specific forces (k, 3), m/s², from the beginning to the end.

        Raises
        ------
        InputError
            At a value that is no finite number, where time does not increase, and at the end if
            there is nothing in the log or a channel is constant.
        """
        keys = list(self.places)
        row, last = 0, -np.inf
        lowest, highest = np.full(3, np.inf), np.full(3, -np.inf)
        for raw in self.source.read([self.places[key] for key in keys], self.chunk_size):
            check_numbers(self.source, self.places, raw, row)
            forces = (raw[:, [keys.index(axis) for axis in AXES]] - self.offset) * self.scale
            if self.rate is None:
                time = raw[:, keys.index("time")] * self.time_factor
                self._check_order(time, last, row)
                last = time[-1]
            else:
                time = np.arange(row, row + len(raw)) / self.rate
            lowest = np.minimum(lowest, forces.min(axis=0))
            highest = np.maximum(highest, forces.max(axis=0))
            row += len(raw)
            yield time, forces
        if row < 2:
            raise InputError(f"{self.path}: too few samples ({row})")
        for axis, constant in zip(AXES, lowest == highest, strict=True):
            if constant:
                name = self.source.names[self.places[axis]]
                raise InputError(f"{self.path}: column {name} ({axis}) is constant")

    def _check_order(self, time: Array, last: float, row: int) -> None:
        backward = np.diff(time, prepend=last) <= 0
        if backward.any():
            i = int(np.argmax(backward))
            where, found = self.source.look_up(row + i, self.places["time"])
            raise InputError(
                f"{self.path}: {where}, column {self.source.names[self.places['time']]} (time): "
                f"time does not increase ({found}); give the rate if it does not count"
            )


def conversion(unit: str, scale: ArrayLike | None, offset: ArrayLike | None) -> tuple[Array, Array]:
    """Scale and offset, (3,) each, that turn numbers in `unit` into m/s²."""
    if unit == "counts":
        if scale is None:
            raise InputError("unit counts needs a nominal scale, in m/s² per count")
        factor = _triple(scale, "scale")
        if not np.all((np.abs(factor) > 0) & (np.abs(factor) <= _LARGEST)):
            raise InputError("scale: must not be 0, and must be finite")
        shift = _triple(0.0 if offset is None else offset, "offset")
        if not np.all(np.abs(shift) <= _LARGEST):
            raise InputError("offset: must be finite")
        return factor, shift
    if scale is not None or offset is not None:
        raise InputError(f"a nominal scale or offset goes with unit counts, not {unit}")
    known = {name: UNITS["m/s^2"][name] for name in ("m/s^2", "g")}
    if unit not in known:
        raise UnknownNameError("unit of a log", unit, (*known, "counts"))
    return np.full(3, known[unit]), np.zeros(3)


def _triple(value: ArrayLike, name: str) -> Array:
    given = np.atleast_1d(np.asarray(value, dtype=float))
    if given.shape not in ((1,), (3,)):
        raise InputError(f"{name}: one number or three, not {given.size}")
    return np.array(np.broadcast_to(given, 3))


# --- Columns -------------------------------------------------------------------------------------


def locate(
    source: Source, given: Mapping[str, Column], wanted: Sequence[str], needed: bool = True
) -> dict[str, int]:
    """Places of the wanted columns: as given, by usual names, or the only three there are.

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
        if key not in places:
            pattern = _KNOWN_NAMES.get(key, re.escape(key))
            found = [
                i
                for i, name in enumerate(source.names)
                if re.fullmatch(pattern, re.sub(r"[\s.\-]+", "_", name.strip()), re.IGNORECASE)
            ]
            if len(found) == 1:
                places[key] = found[0]
    if not places and tuple(wanted[:3]) == AXES and len(source.names) == 3:
        places = dict(zip(AXES, range(3), strict=True))
    missing = [key for key in wanted if key not in places]
    if needed and missing:
        raise InputError(
            f"{source.path}: which column is {missing[0]}? "
            f"The columns are {listed(source.names)}, counted from 0"
        )
    if len(set(places.values())) < len(places):
        raise InputError(f"{source.path}: two of {', '.join(places)} name the same column")
    return places


def _place(source: Source, key: str, column: Column) -> int:
    names = list(source.names)
    if column in names:
        if names.count(str(column)) > 1:
            raise InputError(f"{source.path}: {key}: there are several columns {column!r}")
        return names.index(str(column))
    if isinstance(column, int) or re.fullmatch(r"[0-9]{1,9}", column):
        if 0 <= int(column) < len(names):
            return int(column)
        raise InputError(
            f"{source.path}: {key}: no column {column}; there are {len(names)}, counted from 0"
        )
    raise InputError(f"{source.path}: {key}: no column {column!r}; there are {listed(names)}")


def check_numbers(source: Source, places: Mapping[str, int], raw: Array, row: int = 0) -> None:
    """Raise `InputError` at the first value of the rows from `row` on that is no usable number."""
    bad = ~(np.abs(raw) <= _LARGEST)
    if bad.any():
        i, j = (int(k) for k in np.argwhere(bad)[0])
        key, column = list(places.items())[j]
        where, found = source.look_up(row + i, column)
        raise InputError(
            f"{source.path}: {where}, column {source.names[column]} ({key}): "
            f"{found}, not a usable number"
        )


def read_columns(source: Source, places: Mapping[str, int]) -> Array:
    """All rows of some columns, (n, len(places)); for small tables."""
    chunks = list(source.read(list(places.values()), CHUNK))
    if not chunks:
        raise InputError(f"{source.path}: no row of numbers")
    values = np.concatenate(chunks)
    check_numbers(source, places, values)
    return values
