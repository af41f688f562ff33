"""Which columns of a table are those of a log, and in which units they are.

Loggers write a unit in brackets ("Acc X [g]"), as an ending ("time_ms") or in a row of its own,
which `TextTable` puts in brackets behind the names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import CLOCK_UNITS, SENSOR_UNITS
from accelstudy.basics.wording import comma_list, short_list
from accelstudy.campaign.header import LogLayout, Place
from accelstudy.campaign.unit_spellings import parse_unit
from accelstudy.files.reading import overlay

if TYPE_CHECKING:
    from accelstudy.campaign.importing.raw_table import RawTable

AXES = ("fx", "fy", "fz")
SDS = ("sd_fx", "sd_fy", "sd_fz")
CONDITIONS = ("temperature", "vibration")
"""Columns of a log besides time and forces."""
NONE = "none"
"""In place of the column of a condition: there is none, whatever the names say."""
ANGLES = ("roll", "pitch", "yaw")
MEANS = ("n_samples", *SDS, *ANGLES)
"""Columns that a table of means may have besides those of a log."""
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
    **{angle: rf"{angle}|{angle}_robot(_gon)?" for angle in ANGLES},
    "serial": r"((sensor|device)_?)?(s_?n|(serial|serien)_?(no|nr|num(ber|mer)?)?)_?"
    r"|(sensor|device)_?(id|no|nr|num(ber|mer)?|name)_?",
}
_LESS_USUAL = {
    "time": r"(.*_)?secs?|(date|sample|sensor|log)_?time|date|elapsed(_time)?|time[mun]s",
    "temperature": r".*(?<![a-z])temp(erature)?s?c?(?![a-z]).*",
}
"""Names that count where no column has a usual one."""
_LEAST_USUAL = {"time": r"t|[mun]s|milli(s|seconds?)|micro(s|seconds?)"}
"""Names that count after these: a letter that may be a temperature, and units, as of millis() of a
microcontroller."""
_UNITS_OF: Mapping[str, Collection[str]] = {
    **dict.fromkeys((*(k for k in _USUAL if "f" in k), "vibration"), (*SENSOR_UNITS, "counts")),
    "time": CLOCK_UNITS,
    "temperature": ("degC",),
}
_IN_BRACKETS = re.compile(r"(.*?)[\s_]*[(\[{<]([^()\[\]{}<>]*)[)\]}>]")
_AS_ENDING = re.compile(r"(.*[^\W_])[\s_]+([^\W_]+([_/^-]\w+)?)")


def resolve_layout(
    raw: RawTable,
    given: Mapping[str, Any],
    like: LogLayout | None = None,
    more: Collection[str] = (),
) -> tuple[LogLayout, dict[str, int]]:
    """Find out how a log is laid out.

    What is given counts before what the format of the file and the names of its columns say, and
    this before how another log of the sensor was read. Of a log with the columns of that other one
    names say nothing more, unless other columns are given.

    Parameters
    ----------
    raw : RawTable
    given : mapping, keys of `LogLayout` that were said
    like : LogLayout, how another log of the sensor was read
    more : keys that are looked for besides those of a log, as of a table of means

    Returns
    -------
    layout : LogLayout, with all columns that were found, by name if they have one of their own
    places : dict of places of columns: of "fx", "fy", "fz" and perhaps "time", "nanoseconds" (to be
        added to a time in whole seconds), conditions, and `more`

    Raises
    ------
    InputError
        If the table lacks a force, or has rows of several sensors.
    """
    for place in places_by_name(raw.names, "serial"):
        cells = raw.content.column(place)
        sensors = cells.unique().drop_null().to_pylist()
        if 1 < len(sensors) < len(cells) / 2:  # with more it is the number of the sample
            each = f"column {raw.names[place]} has {short_list([*map(str, sensors)])}"
            raise InputError(f"{raw.path}: {each}; give the rows of each sensor by themselves")
    if {"time", "rate"} <= given.keys():
        raise InputError(f"{raw.path}: give the rate or the column of time, not both")
    usual = {} if like is None else {**like.columns, "time": like.time}
    said = {**given.get("columns", {}), "time": given.get("time", usual.get("time"))}
    another = usual.get("fx") not in raw.names or {**usual, **said} != usual
    inferred = {**layout_by_names(raw.names), **raw.layout} if another else {}
    if raw.frame is not None:
        inferred |= raw.layout  # the times of its index
    chosen = _overlaid(like, inferred, given)
    columns = chosen.columns | ({} if chosen.time is None else {"time": chosen.time})
    known = (*AXES, *CONDITIONS, *more)
    wanted = known if chosen.rate is not None else (*AXES, "time", *CONDITIONS, *more)
    for name in chosen.columns.keys() - {*known}:
        raise UnknownNameError("column", name, known)
    try:
        places = _find_places(raw, columns, {*given, *given.get("columns", ())}, wanted)
    except InputError as error:
        if like is None or "columns" in given:
            raise
        raise InputError(
            f"{error}; the columns are those of the log of the campaign, `columns` and `time` "
            "change them"
        ) from None
    if another:
        chosen = _overlaid(like, {**_units(raw, places, given), **inferred}, given)
    by_name = {
        key: raw.names[i] if raw.named and raw.names.count(raw.names[i]) == 1 else i
        for key, i in places.items()
        if key != "nanoseconds"
    }
    by_name |= {key: NONE for key, column in chosen.columns.items() if column == NONE}
    found = {"time": by_name.pop("time", None), "columns": by_name}
    return chosen.model_copy(update=found), places


def _overlaid(
    like: LogLayout | None, inferred: Mapping[str, Any], given: Mapping[str, Any]
) -> LogLayout:
    """Layout of another log overlaid with what a log tells and what is given of it.

    If all three columns of the forces are known, they replace all others, since then the log is
    another one. A column of time replaces a rate and the unit of another one, and a unit the scale
    of counts.
    """
    layout = {} if like is None else like.model_dump(exclude_none=True)
    if {**layout, **inferred, **given}.get("time") != layout.get("time"):
        layout.pop("time_unit", None)
    for layer in (inferred, given):
        replaced = {"time", "rate"} if layer.keys() & {"time", "rate"} else set()
        if layer.get("unit", "counts") != "counts":
            replaced |= {"scale", "offset"}
        if {*AXES} <= layer.get("columns", {}).keys():
            replaced |= {"columns"}
        layout = overlay({k: v for k, v in layout.items() if k not in replaced}, layer)
    return LogLayout.model_validate(layout)


def _find_places(
    raw: RawTable, columns: Mapping[str, Place], said: Collection[str], wanted: Collection[str]
) -> dict[str, int]:
    """Places of the columns of a log; those of another log of the sensor may be missing."""
    if len(raw.names) == 3 and not any(
        find_column(raw, k, columns.get(k)) is not None for k in AXES
    ):
        columns = {**columns, **dict(zip(AXES, range(3), strict=True))}
    places: dict[str, int] = {}
    for key in wanted:
        if key in CONDITIONS and columns.get(key) == NONE:
            continue
        try:
            place = find_column(raw, key, columns.get(key))
        except InputError:
            if key in said or key in AXES:
                raise
            continue
        if place is None and key in AXES:
            raise InputError(f"{which_column(raw, key)}; give `columns` {key}=NAME, or its number")
        by_name = key not in columns and key not in (*AXES, "time")
        if place is not None and not (by_name and place in places.values()):
            places[key] = place
    for place in places.values():
        if len(keys := [key for key, other in places.items() if other == place]) > 1:
            raise InputError(f"{raw.path}: {comma_list(keys)} name the same column")
    if "time" in places:  # in whole seconds, "stamp.secs", it has a column of ns, "stamp.nsecs"
        parts = ((i, _NANOSECONDS.fullmatch(name)) for i, name in enumerate(raw.names))
        whole = raw.names[places["time"]]
        rest = [i for i, part in parts if part and part[1] + part[3] == whole]
        if len(rest) == 1:
            places["nanoseconds"] = rest[0]
    return places


def which_column(raw: RawTable, key: str) -> str:
    """Ask which column is that of a key."""
    there = short_list(raw.names) or "none"
    return f"{raw.path}: which column is {key}? The columns are {there}, counted from 0"


def find_column(raw: RawTable, key: str, column: Place | None = None) -> int | None:
    """Place of the column of a key: as given, or by its usual names; None if no name tells it.

    Digits are a place, unless a column has them as its name.

    Raises
    ------
    InputError
        If the column that is given does not exist.
    """
    names, said = raw.names, str(column)
    if column is None:
        places = places_by_name(names, key)
        if key == "time" and not places:
            places = sorted(raw.dates)
    elif raw.named and said in names:
        if names.count(said) > 1:
            raise InputError(f"{raw.path}: {key}: there are several columns {column!r}")
        places = [names.index(said)]
    else:
        # A unit in brackets belongs to the column, and may be in one of the names only.
        plain = without_unit(said)
        places = [i for i, name in enumerate(names) if without_unit(name) == plain]
        if not (raw.named and len(places) == 1):
            if not re.fullmatch(r"[0-9]{1,9}", said) or int(said) >= len(names):
                raise InputError(
                    f"{raw.path}: {key}: no column {column!r}; there are {short_list(names)}, "
                    "counted from 0"
                )
            places = [int(said)]
    return places[0] if len(places) == 1 else None


def _units(raw: RawTable, places: Mapping[str, int], given: Mapping[str, Any]) -> dict[str, str]:
    """Units of forces and time, as far as names or a scale of counts tell them."""
    units: dict[str, str] = {"unit": "counts"} if given.keys() & {"scale", "offset"} else {}
    of_axes = {unit_in(raw.names[places[axis]], axis) for axis in AXES}
    if len(of_axes) == 1 and (unit := of_axes.pop()) in SENSOR_UNITS:
        units["unit"] = unit
    dated = "nanoseconds" in places or places.get("time") in raw.dates
    if "time" in places and not dated and (unit := unit_in(raw.names[places["time"]], "time")):
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
    # A unit may be all of a name, as "ms", or end it, as in "TimeUS" of ArduPilot.
    alone = [name.strip().lower().removeprefix("time")] if key == "time" else []
    words = [part[2] for part in parts if part] + alone
    units = map(parse_unit, words)
    return next((unit for unit in units if unit in _UNITS_OF.get(key, ())), None)


def places_by_name(names: Sequence[str], key: str) -> list[int]:
    """Places of the columns that may be the one of a key: one, if the names tell it."""
    if names.count(key) == 1:
        return [names.index(key)]
    found: list[int] = []
    usual = (names_of.get(key) for names_of in (_USUAL, _LESS_USUAL, _LEAST_USUAL))
    for pattern in filter(None, usual):
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
    suffix = parse_unit(ending[2]) if ending else None
    if own and suffix not in (None, "", *own):  # "temp_F"
        return False
    return bool(matches(plain) or (ending and suffix in own and matches(ending[1])))


def _plain(name: str) -> str:
    """Name in small letters, its words apart: "Acc X" and "accX" as "acc_x"."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z][a-z]{2})", "_", name.strip())
    return re.sub(r"[\s.\-/_]+", "_", words).lower()


def layout_by_names(names: Sequence[str]) -> Mapping[str, Any]:
    """What the names of columns say: those of sensor_msgs/Imu stand for axes in flu (REP 103)."""
    of_ros = re.compile(r"(.*[._/])?linear[_.]acceleration[._/]x", re.IGNORECASE)
    return {"frame": "flu"} if any(map(of_ros.fullmatch, names)) else {}
