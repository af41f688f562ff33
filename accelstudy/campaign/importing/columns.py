"""Find the columns of a file: as given, or by their usual names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.wording import short_list
from accelstudy.campaign.importing.sources import CHUNK, Source
from accelstudy.sensors.conversion import LARGEST

Array = NDArray[np.float64]
Column = str | int
"""A column by its name in the header, or by its place, counted from 0."""

AXES = ("fx", "fy", "fz")

_KNOWN_NAMES = {
    "fx": r"f_?x|a_?x|acc?_?x|acc?el_?x|accelerationx|acceleration_x|x",
    "fy": r"f_?y|a_?y|acc?_?y|acc?el_?y|accelerationy|acceleration_y|y",
    "fz": r"f_?z|a_?z|acc?_?z|acc?el_?z|accelerationz|acceleration_z|z",
    "time": r"t|time|time_m?u?n?s|timestamp|seconds",
    "temperature": r"temp|temperature|temp(erature)?_(deg_?)?c",
    "vibration": r"vibration|vibration_mps2",
    "n_samples": r"n|n_samples|count",
    "sd_fx": r"sd_?f?x|s_?x|sd_a_?x",
    "sd_fy": r"sd_?f?y|s_?y|sd_a_?y",
    "sd_fz": r"sd_?f?z|s_?z|sd_a_?z",
    "roll": r"roll|roll_robot(_gon)?",
    "pitch": r"pitch|pitch_robot(_gon)?",
    "yaw": r"yaw|yaw_robot(_gon)?",
}


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
        if key not in places:
            pattern = _KNOWN_NAMES.get(key, re.escape(key))
            matches = [
                i
                for i, name in enumerate(source.names)
                if re.fullmatch(pattern, re.sub(r"[\s.\-]+", "_", name.strip()), re.IGNORECASE)
            ]
            if len(matches) == 1:
                places[key] = matches[0]
    if not places and tuple(wanted[:3]) == AXES and len(source.names) == 3:
        places = dict(zip(AXES, range(3), strict=True))
    missing = [key for key in wanted if key not in places]
    if needed and missing:
        raise InputError(
            f"{source.path}: which column is {missing[0]}? "
            f"The columns are {short_list(source.names)}, counted from 0"
        )
    if len(set(places.values())) < len(places):
        raise InputError(f"{source.path}: two of {', '.join(places)} name the same column")
    return places


def _place(source: Source, key: str, column: Column) -> int:
    """Place of a column; digits are a place, unless a column has them as its name."""
    names = source.names
    if source.named and isinstance(column, str) and column in names:
        if names.count(column) > 1:
            raise InputError(f"{source.path}: {key}: there are several columns {column!r}")
        return names.index(column)
    if isinstance(column, str) and re.fullmatch(r"[0-9]{1,9}", column):
        column = int(column)
    if isinstance(column, int):
        if 0 <= column < len(names):
            return column
        raise InputError(
            f"{source.path}: {key}: no column {column}; there are {len(names)}, counted from 0"
        )
    raise InputError(f"{source.path}: {key}: no column {column!r}; there are {short_list(names)}")


def check_numbers(
    source: Source, places: Mapping[str, int], raw: Array, row: int = 0, gaps: Sequence[str] = ()
) -> None:
    """Raise `InputError` at the first value that is no usable number.

    Parameters
    ----------
    source : Source
    places : mapping of key to column, in the order of the columns of `raw`
    raw : (k, len(places)) array
    row : int, number of rows before these
    gaps : sequence of str, columns that may have cells without a number
    """
    bad = ~(np.abs(raw) <= LARGEST)
    bad &= ~(np.isnan(raw) & np.isin(list(places), gaps))
    if bad.any():
        i, j = (int(k) for k in np.argwhere(bad)[0])
        key, column = list(places.items())[j]
        where, cell = source.look_up(row + i, column)
        raise InputError(
            f"{source.path}: {where}, column {source.names[column]} ({key}): "
            f"{cell}, not a usable number"
        )


def read_columns(source: Source, places: Mapping[str, int], clock: int | None = None) -> Array:
    """All rows of some columns, (n, len(places)), for small tables; `clock` as in `Source`."""
    chunks = list(source.read(list(places.values()), CHUNK, clock))
    if not chunks:
        raise InputError(f"{source.path}: no row of numbers")
    values = np.concatenate(chunks)
    check_numbers(source, places, values)
    return values
