"""Data sheets from YAML: those of the package, of installed packages, and the user's own."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, UnknownNameError, brief
from accelstudy.basics.plugins import error_as_line, installed_entry_points, label
from accelstudy.basics.units import parse_quantity
from accelstudy.campaign.sensor_type import TYPE_KEYS
from accelstudy.data_sheets.sheet import MOST, QUANTITIES, DataSheet
from accelstudy.files.reading import read_layer

TEXTS = ("name", "title", "source")
LOGS = (".csv", ".txt", ".gz", ".mat", ".parquet", ".log", ".dat")
"""Endings of files that are no data sheets, though one can be made of them."""
DENSITY = "noise_density"
"""Another way to write the white noise: the one-sided density of most data sheets."""
NOISE = (DENSITY, "velocity_random_walk", "position_sigma")
LEAST = {"full_scale": 1.0, **dict.fromkeys(NOISE, 1e-12)}
"""Smallest values, SI, of quantities that cannot be 0."""


def data_sheet_names() -> tuple[str, ...]:
    """Names of the sensors of this package, and of installed ones that have some."""
    return tuple(sorted(_files()))


def get_data_sheet(name_or_path: str | Path) -> DataSheet:
    """Return a sensor by its name, from the user's own YAML file, or from a campaign's folder.

    Raises
    ------
    UnknownNameError
        If there is no such sensor.
    InputError
        If the file cannot be read, or is not a data sheet; for a log the message says how to make
        one of it.
    """
    text, path = str(name_or_path), Path(name_or_path)
    if path.is_dir():
        from accelstudy.data_sheets.measured import sheet_of_campaign

        return sheet_of_campaign(path)
    if path.suffix in LOGS:
        raise InputError(
            f"{text}: a log, not a data sheet; make one of it: accelstudy data-sheet {text} --out "
            f"{path.stem}.yaml, with the options by which import reads it"
        )
    if path.is_file() or text.endswith((".yaml", ".yml")) or os.sep in text or "/" in text:
        return read_data_sheet(text)
    if text not in _files():
        raise UnknownNameError("sensor", text, data_sheet_names())
    return _shipped(text)


def read_data_sheet(path: str | Path) -> DataSheet:
    """Read a data sheet from a YAML file.

    Raises
    ------
    InputError
        One line that names the file, the key, what is wrong and what would be right.
    """
    return parse_data_sheet(read_layer(path), str(path))


def parse_data_sheet(content: Mapping[str, Any], source: str = "data sheet") -> DataSheet:
    """Make a data sheet of the content of a YAML file.

    A quantity is a text with its unit, or a mapping with such a `value` and its `source`. The file
    of a type, which `accelstudy lot` writes, says more, which is left out.

    Raises
    ------
    InputError
        See `read_data_sheet`.
    """
    keys = (*TEXTS, DENSITY, *QUANTITIES)
    values: dict[str, float] = {}
    sources: dict[str, str] = {}
    try:
        for key, entry in content.items():
            if key in TYPE_KEYS:
                continue
            if key not in keys:
                raise UnknownNameError("key", key, keys)
            if key not in TEXTS:
                values[key], sources[key] = _quantity(key, entry)
        texts = {key: str(content[key]) for key in TEXTS if content.get(key) is not None}
        if DENSITY in values:
            if "velocity_random_walk" in values:
                raise InputError(
                    f"{DENSITY} and velocity_random_walk both say how large the white noise is; "
                    "give one of them"
                )
            values["velocity_random_walk"] = values.pop(DENSITY) / math.sqrt(2)
            sources["velocity_random_walk"] = sources.pop(DENSITY)
        content_si: dict[str, Any] = {"name": Path(source).stem, **texts, **values}
        return DataSheet(**content_si, sources=sources)
    except InputError as error:
        raise InputError(f"{source}: {error}") from None


def _quantity(key: str, entry: Any) -> tuple[float, str]:
    """Value and source of a quantity, in SI."""
    unit = QUANTITIES["velocity_random_walk" if key == DENSITY else key][0]
    text, where = entry, ""
    if isinstance(entry, Mapping):
        if extra := set(entry) - {"value", "source"}:
            raise UnknownNameError(f"key of {key}", min(map(str, extra)), ("value", "source"))
        if "value" not in entry:
            raise InputError(f"{key}: value: missing")
        text, where = entry["value"], str(entry.get("source") or "")
    if not isinstance(text, str | int | float) or isinstance(text, bool):
        raise InputError(f"{key}: must be a number with its unit, not {brief(text)}")
    try:
        size = parse_quantity(str(text), unit)
    except InputError as error:
        raise InputError(f"{key}: {error}") from None
    Range(LEAST.get(key, 0.0), MOST[unit], unit).check_key(key, size)
    return size, where


@cache
def _files() -> dict[str, Path]:
    """File of each sensor by its name; a package names the folder of its own as entry point."""
    found = _files_of("accelstudy.data_sheets")
    for point in installed_entry_points("data_sheets"):
        with error_as_line(label(point)):
            own = _files_of(point.module)
            if not own:
                raise InputError("no data sheet (*.yaml) lies in this package")
            if taken := own.keys() & found.keys():
                raise InputError(f"the sensor {min(taken)!r} is there already; choose another name")
            found |= own
    return found


def _files_of(package: str) -> dict[str, Path]:
    return {Path(f.name).stem: Path(str(f)) for f in files(package).iterdir() if ".yaml" in f.name}


@cache
def _shipped(name: str) -> DataSheet:
    return read_data_sheet(_files()[name])
