"""Which columns of a table are those of a log, and in which units they are."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from typing import Any

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import SENSOR_UNITS
from accelstudy.basics.wording import short_list
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.importing.names import places_by_name, unit_in, without_unit
from accelstudy.campaign.importing.sources import Source
from accelstudy.files.reading import overlay

AXES = ("fx", "fy", "fz")
SDS = ("sd_fx", "sd_fy", "sd_fz")
CONDITIONS = ("temperature", "vibration")
"""Columns of a log besides time and forces."""
ORDINARY = ("time", *CONDITIONS)
"""What is looked for in a log beside the forces."""
_NANOSECONDS = re.compile(r"(.*?)n(ano)?(secs?)", re.IGNORECASE)
"""Whole seconds of a stamp of ROS, where there is no other time, and the rest of it."""


def resolve_layout(
    source: Source,
    given: Mapping[str, Any],
    like: LogLayout | None = None,
    wanted: Collection[str] = ORDINARY,
    untimed: bool = False,
) -> tuple[LogLayout, dict[str, int]]:
    """Find out how a log is laid out.

    What is given counts before what the format of the file and the names of its columns say, and
    this before how another log of the sensor was read. A log with the columns of that other one is
    read as it was.

    Parameters
    ----------
    source : Source
    given : mapping, keys of `LogLayout` that were said
    like : LogLayout, how another log of the sensor was read
    wanted : what to look for beside the forces; columns of a table of means as well
    untimed : bool, whether a log may have neither a time nor a rate

    Returns
    -------
    layout : LogLayout
    places : dict of places of columns: of "fx", "fy", "fz" and perhaps "time", "nanoseconds" (to be
        added to a time in whole seconds) and what is wanted

    Raises
    ------
    InputError
        If the table lacks a column.
    """
    if {"time", "rate_hz"} <= given.keys():
        raise InputError(f"{source}: give the rate or the column of time, not both")
    another = like is None or like.columns.get("fx") not in source.names
    of_format = source.layout if another else {}
    told = {k: v for k, v in of_format.items() if k != "time" or "rate_hz" not in given}
    chosen = _laid_over(like, overlay(told, given))
    try:
        places = _places(source, chosen, given, wanted, untimed)
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
    return _laid_over(like, overlay(told, given)), places


def _laid_over(like: LogLayout | None, given: Mapping[str, Any]) -> LogLayout:
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
    return LogLayout.model_validate(overlay(kept, given))


def _places(
    source: Source,
    layout: LogLayout,
    given: Mapping[str, Any],
    wanted: Collection[str],
    untimed: bool,
) -> dict[str, int]:
    """Places of the columns of a log; those of another log of the sensor may be missing."""
    known = dict.fromkeys((*AXES, *CONDITIONS, *wanted))
    for key in layout.columns:
        if key not in known:
            raise UnknownNameError("column", key, [each for each in known if each != "time"])
    columns = layout.columns | ({} if layout.time is None else {"time": layout.time})
    known_axes = [k for k in AXES if find_column(source, k, columns.get(k)) is not None]
    if len(source.names) == 3 and not known_axes:
        columns |= dict(zip(AXES, range(3), strict=True))
    said = given.keys() | given.get("columns", {}).keys()
    needed = {*AXES, *(() if untimed or layout.rate_hz is not None else ("time",))}
    places: dict[str, int] = {}
    for key in (*AXES, *wanted):
        if key == "time" and layout.rate_hz is not None:
            continue
        try:
            place = find_column(source, key, columns.get(key))
            if place is None and key in needed:
                how = "" if key == "time" else f"; give `columns` {key}=NAME, or its number"
                raise InputError(
                    f"{source}: which column is {key}? The columns are "
                    f"{short_list(source.names) or 'none'}, counted from 0{how}"
                )
        except InputError as error:
            if key in said or key in AXES:
                raise
            if key in needed:
                raise InputError(
                    f"{error}; give the column of time (`time`), or the rate (`rate`), or, for a "
                    "log without the moves between positions, the samples of each (`block`)"
                ) from None
            continue
        by_name = key not in columns and key not in (*AXES, "time")
        if place is not None and not (by_name and place in places.values()):
            places[key] = place
    if len({*places.values()}) < len(places):
        raise InputError(f"{source}: two of {', '.join(places)} name the same column")
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
            raise InputError(f"{source}: {key}: there are several columns {column!r}")
        found = [names.index(column)]
    else:
        # A unit in brackets belongs to the column, and may be in one of the names only.
        plain = without_unit(str(column))
        found = [i for i, name in enumerate(names) if without_unit(name) == plain]
        if not (source.named and isinstance(column, str) and len(found) == 1):
            if not re.fullmatch(r"[0-9]{1,9}", str(column)) or int(column) >= len(names):
                raise InputError(
                    f"{source}: {key}: no column {column!r}; there are {short_list(names)}, "
                    "counted from 0"
                )
            found = [int(column)]
    if len(found) != 1:
        return None
    if found[0] in source.dates and key != "time":
        name = names[found[0]]
        raise InputError(f"{source}: column {name} is timestamps, not numbers ({key})")
    return found[0]


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
