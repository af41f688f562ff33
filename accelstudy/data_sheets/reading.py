"""Data sheets from YAML: those of the package, of installed packages, and the user's own."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from pydantic import ConfigDict

from accelstudy.basics.arguments import quantity
from accelstudy.basics.errors import InputError, UnknownNameError, locate_errors
from accelstudy.basics.plugins import error_as_line, installed_entry_points, label
from accelstudy.campaign.sensor_type import TYPE_KEYS
from accelstudy.data_sheets.sheet import QUANTITIES, DataSheet
from accelstudy.files.reading import read_layer
from accelstudy.files.validation import ConfigSection, validate

TEXTS = ("name", "title", "source")
LOGS = (".csv", ".txt", ".gz", ".mat", ".parquet", ".log", ".dat")
"""Endings of files that are no data sheets, though one can be made of them."""
DENSITY = "noise_density"
"""Another way to write the white noise, `WALK`: the one-sided density of most data sheets."""
WALK = "velocity_random_walk"


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


class _Entry(ConfigSection):
    """What a file says of a quantity."""

    model_config = ConfigDict(coerce_numbers_to_str=True)

    value: str
    source: str | None = None


def parse_data_sheet(content: Mapping[str, Any], source: str = "data sheet") -> DataSheet:
    """Make a data sheet of the content of a YAML file.

    A quantity is a text with its unit, or a mapping with such a `value` and its `source`. The file
    of a type, which `accelstudy lot` writes, says more, which is left out.

    Raises
    ------
    InputError
        See `read_data_sheet`.
    """
    quantities = {**QUANTITIES, DENSITY: QUANTITIES[WALK]}
    values: dict[str, Any] = {"name": Path(source).stem}
    sources: dict[str, str] = {}
    with locate_errors(source):
        for key in [key for key in content if key not in TYPE_KEYS]:
            entry = content[key]
            if key in quantities:
                stated = validate(
                    _Entry, entry if isinstance(entry, Mapping) else {"value": entry}, key
                )
                values[key] = quantity(key, stated.value, quantities[key])
                sources[key] = stated.source or ""
            elif key not in TEXTS:
                raise UnknownNameError("key", key, (*TEXTS, *quantities))
            elif entry is not None:
                values[key] = str(entry)
        if DENSITY in values:
            if WALK in values:
                raise InputError(
                    f"{DENSITY} and {WALK} both say how large the white noise is; give one of them"
                )
            values[WALK] = values.pop(DENSITY) / math.sqrt(2)
            sources[WALK] = sources.pop(DENSITY)
        return DataSheet(**values, sources=sources)


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
