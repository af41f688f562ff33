"""Which columns of a table are those of a log, and in which units they are.

Loggers write a unit in brackets ("Acc X [g]"), as an ending ("time_ms") or in a row of its own,
which `read_text` puts in brackets behind the names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import CLOCK_UNITS, SENSOR_UNITS
from accelstudy.basics.wording import short_list
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.unit_spellings import parse_unit
from accelstudy.files.reading import overlay

if TYPE_CHECKING:
    from accelstudy.campaign.importing.sources import Source

AXES = ("fx", "fy", "fz")
SDS = ("sd_fx", "sd_fy", "sd_fz")
CONDITIONS = ("temperature", "vibration")
"""Columns of a log besides time and forces."""
ORDINARY = ("time", *CONDITIONS)
"""What is looked for in a log beside the forces."""
_NANOSECONDS = re.compile(r"(.*?)n(ano)?(secs?)", re.IGNORECASE)
"""Whole seconds of a stamp of ROS, where there is no other time, and the rest of it."""

_FORCE = (
    r"f_?{0}|a_?{0}|acc?_?{0}|acc?el_?{0}|acceler(ation|ometer){0}|{0}_?axis|{0}"
    # With the topic or the message before, as .csv of a bag has.
    r"|(_?([a-z0-9]+_)*linear_)?acceleration_{0}"
)
_USUAL = {
    **{f"f{axis}": _FORCE.format(axis) for axis in "xyz"},
    **{f"sd_f{axis}": rf"sd_?f?{axis}|s_?{axis}|sd_a_?{axis}" for axis in "xyz"},
    "time": r"time|timestamp|seconds",
    "temperature": r"_?(field_)?(temp|temperature)",
    "vibration": r"vibration|vibration_mps2",
    "n_samples": r"n|n_samples|count",
    **{angle: rf"{angle}|{angle}_robot(_gon)?" for angle in ("roll", "pitch", "yaw")},
}
_LESS_USUAL = {
    "time": r"t|(.*_)?secs?|(date|sample|sensor|log)_?time|date|elapsed(_time)?",
    "temperature": r".*(?<![a-z])temp(erature)?s?c?(?![a-z]).*",
}
"""Names that count where no column has a usual one."""
_UNITS_OF: Mapping[str, Collection[str]] = {
    **dict.fromkeys((*(k for k in _USUAL if "f" in k), "vibration"), (*SENSOR_UNITS, "counts")),
    "time": CLOCK_UNITS,
    "temperature": ("degC",),
}
_IN_BRACKETS = re.compile(r"(.*?)[\s_]*[(\[{<]([^()\[\]{}<>]*)[)\]}>]")
_AS_ENDING = re.compile(r"(.*[^\W_])[\s_]+([^\W_]+([_/^-]\w+)?)")


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


# --- What names say ------------------------------------------------------------------------------


def unit_of_cell(text: str) -> str | None:
    """Unit in a cell below a name, with or without brackets, as it is spelled; None if none is."""
    unit = text.strip().strip("()[]{}<>")
    return None if parse_unit(unit) is None else unit


def without_unit(name: str) -> str:
    """Name without a unit in brackets."""
    match = _IN_BRACKETS.fullmatch(name.strip())
    return match[1].strip() if match else name.strip()


def unit_in(name: str, key: str) -> str | None:
    """Unit that the name of the column of a key says; None if it says none of this quantity."""
    parts = (pattern.fullmatch(name.strip()) for pattern in (_IN_BRACKETS, _AS_ENDING))
    units = (parse_unit(part[2]) for part in parts if part)
    return next((unit for unit in units if unit in _UNITS_OF.get(key, ())), None)


def places_by_name(names: Sequence[str], key: str) -> list[int]:
    """Places of the columns that may be the one of a key: one, if the names tell it."""
    found: list[int] = []
    for pattern in filter(None, (_USUAL.get(key, re.escape(key)), _LESS_USUAL.get(key))):
        matches = re.compile(pattern).fullmatch
        found = [i for i, name in enumerate(names) if _is_of(name, key, matches)]
        if len(found) == 1:
            break
    return found


def thermometers(names: Sequence[str]) -> list[int]:
    """Places of all columns whose names speak of a temperature, in whatever unit."""
    speaks = re.compile(_LESS_USUAL["temperature"]).fullmatch
    each = enumerate(names)
    return [i for i, name in each if speaks(_plain(name)) or unit_in(name, "temperature")]


def _is_of(name: str, key: str, matches: Callable[[str], Any]) -> bool:
    bracket, own = _IN_BRACKETS.fullmatch(name.strip()), _UNITS_OF.get(key, ())
    unit = parse_unit(bracket[2]) if bracket else ""
    if unit not in ("", *own) and (unit or key != "time"):  # "Time (UTC)"
        return False
    if key == "temperature" and unit_in(name, key) and re.match(r"t[^a-z]", _plain(name)):
        return True
    plain = _plain(without_unit(name))
    ending = _AS_ENDING.fullmatch(plain)
    known = ending is not None and parse_unit(ending[2]) in own
    return bool(matches(plain) or (ending and known and matches(ending[1])))


def _plain(name: str) -> str:
    """Name in small letters, its words apart: "Acc X" and "accX" as "acc_x"."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z][a-z]{2})", "_", name.strip())
    return re.sub(r"[\s.\-/_]+", "_", words).lower()


def layout_by_names(names: Sequence[str]) -> Mapping[str, Any]:
    """What the names of columns say: those of sensor_msgs/Imu stand for axes in flu (REP 103)."""
    of_ros = re.compile(r"(.*[._/])?linear[_.]acceleration[._/]x", re.IGNORECASE)
    return {"frame": "flu"} if any(map(of_ros.fullmatch, names)) else {}
