"""From the options of `accelstudy import` to its settings and its files."""

from __future__ import annotations

import glob
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import UNITS
from accelstudy.campaign.importing.settings import ImportSettings, parse_settings, read_settings

_RANGE = re.compile(r"\s*([0-9.eE+-]+)\s*(.*?)\s*")


def settings_of(
    path: Path | None,
    *,
    columns: str | None,
    sensor: Sequence[str],
    scale: str | None,
    offset: str | None,
    full_range: str | None,
    rate: float | None,
    gravity: float | None,
    threshold: float | None,
    robot_sigma: float | None,
    robot_unit: str | None,
    exclude: Sequence[str],
    join: Sequence[str],
    **others: Any,
) -> ImportSettings:
    """Settings from a YAML file, overlaid with the options that were given.

    Raises
    ------
    InputError
        If an option or a key is wrong.
    """
    robot = {"angle_sigma_mgon": robot_sigma, "unit": robot_unit}
    content: dict[str, Any] = {
        **others,
        "columns": None if columns is None else parse_columns(columns),
        "sensors": dict(_sensor(text) for text in sensor) or None,
        "scale": None if scale is None else _numbers("--scale", scale),
        "offset": None if offset is None else _numbers("--offset", offset),
        "rate_hz": rate,
        "threshold_mps2": threshold,
        "gravity": None if gravity is None else {"value_mps2": gravity},
        "robot": {k: v for k, v in robot.items() if v is not None} or None,
        "exclude": list(exclude) or None,
        "join": list(join) or None,
    }
    given = {key: value for key, value in content.items() if value is not None}
    settings = read_settings(path, given)
    if full_range is None:
        return settings
    range_mps2 = _range(full_range, settings)
    return parse_settings({**settings.model_dump(), "range_mps2": range_mps2}, "--range")


def files_of(given: Sequence[Path]) -> list[Path]:
    """Files that are meant by files, folders and patterns.

    Those of a folder or a pattern come in the order of their names, and pos2 before pos10. So do
    files in the order of the alphabet, which is how a shell lists them.

    Raises
    ------
    InputError
        If there is none.
    """
    files: list[Path] = []
    for path in given:
        if path.is_dir():
            inside = [p for p in path.iterdir() if p.is_file() and not p.name.startswith(".")]
        elif glob.has_magic(str(path)) and not path.exists():
            inside = [Path(p) for p in glob.glob(str(path)) if Path(p).is_file()]
        else:
            files.append(path)
            continue
        if not inside:
            raise InputError(f"{path}: no file there")
        files += sorted(inside, key=_natural)
    if files == sorted(files):
        files.sort(key=_natural)
    twice = [path for path in files if files.count(path) > 1]
    if twice:
        raise InputError(f"{twice[0]}: the file is given twice")
    return files


def _natural(path: Path) -> list[tuple[int, str]]:
    """Key by which numbers in names count as such."""
    parts = re.split(r"([0-9]+)", str(path))
    return [(int(part), "") if part.isdigit() else (0, part) for part in parts]


def parse_columns(text: str) -> dict[str, str]:
    """Columns as an option gives them: fx=1,fy=2,fz=3."""
    pairs = [part.split("=", 1) for part in text.split(",")]
    if any(len(pair) != 2 for pair in pairs):
        raise InputError(f"--columns: expected fx=1,fy=2,fz=3 or names, not {text!r}")
    return {key.strip(): column.strip() for key, column in pairs}


def _sensor(text: str) -> tuple[str, list[str]]:
    name, _, columns = text.partition("=")
    places = [column.strip() for column in columns.split(",")]
    if len(places) != 3 or not all(places):
        raise InputError(f"--sensor: expected a name and three columns, as a=1,2,3, not {text!r}")
    return name.strip(), places


def _numbers(option: str, text: str) -> list[float]:
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise InputError(f"{option}: expected numbers, as 1.5 or 1,2,3, not {text!r}") from None


def _range(text: str, settings: ImportSettings) -> float:
    """Range in m/s², of a number with or without a unit."""
    match = _RANGE.fullmatch(text)
    unit = match[2] or "m/s^2" if match else ""
    known = {**UNITS["m/s^2"], "m/s²": 1.0}
    if unit == "counts" and settings.scale is not None:
        known["counts"] = float(np.max(np.abs(settings.scale)))
    if match is None or unit not in known:
        raise InputError(f"--range: expected a number in m/s², g or counts, as 4g, not {text!r}")
    (number,) = _numbers("--range", match[1])
    return number * known[unit]
