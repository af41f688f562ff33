"""What the names of columns say: which column is which, and in which unit it is.

Loggers write a unit in brackets ("Acc X [g]"), as an ending ("time_ms") or in a row of its own,
which `TextSource` puts in brackets behind the names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from accelstudy.basics.units import CLOCK_UNITS, SENSOR_UNITS
from accelstudy.campaign.unit_spellings import parse_unit

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
