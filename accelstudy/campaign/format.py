"""A campaign: one calibration session of one sensor, as a folder with two files."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.units import MGON
from accelstudy.basics.wording import one_line
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import COLUMNS, HEADER, KNOWN, MAX_CELL, TABLE, Header
from accelstudy.campaign.session import Campaign
from accelstudy.files.outputs import whole_file
from accelstudy.files.reading import overlay, read_layer, read_text
from accelstudy.files.validation import validate
from accelstudy.leveling.angles import usual_norm

Array = NDArray[np.float64]
Columns = Mapping[str, Sequence[Any]]
"""The table of positions by name: texts of its file, or numbers that are to be written."""

MOST_NAMED = 5
"""Largest number of unknown columns with a warning each."""
MAX_GRAVITIES = 1000
"""Multiple of gravity beyond which a mean is no measurement."""
_OF_HEADER = {
    "name": "name",
    "sensor": "sensor",
    "date": "date",
    "unit": "unit",
    "gravity": "gravity.value_mps2",
    "sigma_gravity": "gravity.sigma_mps2",
    "sigma_force": "sensor_noise.sigma_mps2",
    "sigma_dof": "sensor_noise.degrees_of_freedom",
    "full_range": "range_mps2",
    "reference": "reference",
    "log": "log",
}
"""Attributes of a campaign that are keys of its header."""


def read_campaign(
    folder: str | Path, given: Mapping[str, Any] | None = None, *, plausible: bool = True
) -> Campaign:
    """Read a campaign folder: `campaign.yaml` and `positions.csv`.

    With ``unit: g`` forces are multiples of standard gravity, 9.80665 m/s². This unit is the same
    everywhere, while `gravity` is the local value. If the data are scaled so that local gravity is
    1, give 9.80665 as the value of gravity.

    With ``unit: counts`` forces are (raw − offset) · scale, and sds are sd · abs(scale).

    Numbers in `position` increase, but some may be missing, as after the removal of a hold. A
    missing yaw of the robot is 0. Unknown columns are left out and named in `warnings`.

    Parameters
    ----------
    folder : path
    given : mapping, optional
        Overlays the header key by key.
    plausible : bool
        Whether to refuse forces that are not as large as gravity, and angles that fit them better
        in another unit. False is for callers that look for such errors themselves.

    Raises
    ------
    InputError
        If a file is missing or incomplete, or a value cannot be right; one line says where.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; a campaign is one with {HEADER} and {TABLE}")
    header, path = read_header(folder, given), folder / TABLE
    columns, warnings = read_positions(path)
    campaign = parse_table(columns, header, path, plausible)
    return replace(campaign, warnings=tuple(warnings))


def read_header(folder: Path, given: Mapping[str, Any] | None = None) -> Header:
    """Header of a campaign folder, overlaid key by key with `given`; errors as `read_campaign`."""
    path = folder / HEADER
    return validate(Header, overlay(read_layer(path), given or {}), path)


def read_positions(path: Path) -> tuple[Columns, list[str]]:
    """Read the columns of a table, and warnings about them.

    Raises
    ------
    InputError
        If the file is missing or incomplete, or a column occurs twice.
    """
    if not path.exists() and path.with_suffix(".parquet").exists():
        raise InputError(f"{path}: no such file; save {path.stem}.parquet as CSV")
    try:
        text = read_text(path)
    except UnicodeDecodeError as error:
        raise _not_whole(path, error) from None
    columns, warnings = columns_of(text, path), []
    # Half a number is a number, too: if the file was cut there, only the line end is missing.
    if not text.endswith(("\n", "\r")):
        warnings = [f"{path}: the last line does not end; check that it is whole"]
    return columns, warnings + ignored_in(columns, path)


def ignored_in(columns: Columns, path: Path) -> list[str]:
    """Warnings about columns that the format does not know."""
    unknown = [name for name in columns if name not in KNOWN]
    if len(unknown) > MOST_NAMED:
        first = ", ".join(one_line(repr(name), 30) for name in unknown[:MOST_NAMED])
        return [f"{path}: {len(unknown)} columns are not known and ignored: {first}, …"]
    said = []
    for name in unknown:
        near = get_close_matches(name[:100], KNOWN, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        said.append(f"{path}: column {one_line(repr(name))} is not known and ignored{hint}")
    return said


def columns_of(text: str, path: Path) -> Columns:
    """Columns of the text of a CSV table; errors name `path`."""
    try:
        reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
        lines = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise _not_whole(path, error) from None
    if not lines:
        raise InputError(f"{path}: empty; expected a line of column names, position, fx, fy, fz …")
    names = [name.strip() for name in lines[0][1]]
    if len(names) == 1 and (mark := next((m for m in ";\t" if m in names[0]), None)):
        raise InputError(f"{path}: columns are separated by {mark!r}; a comma would be right")
    for line, row in lines[1:]:
        if len(row) != len(names):
            raise InputError(
                f"{path}: line {line}: {len(row)} values for {len(names)} columns; "
                "is the file whole?"
            )
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: {name!r}: the column stands twice")
    return {name: [row[i] for _, row in lines[1:]] for i, name in enumerate(names)}


def _not_whole(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: not a whole CSV file in UTF-8 ({one_line(error)})")


def write_campaign(campaign: Campaign, folder: str | Path, plausible: bool = True) -> None:
    """Write a campaign folder, in the unit that the campaign had.

    Parameters
    ----------
    campaign : Campaign
        Its `warnings` are not written.
    folder : path
        Made if it does not exist; other files in it stay.
    plausible : bool
        As in `read_campaign`.

    Raises
    ------
    InputError
        If the campaign could not be read again (nothing is written then), or the folder cannot be
        written.
    """
    folder = Path(folder)
    path = folder / TABLE
    header = validate(Header, _content_of(campaign), folder / HEADER)
    columns = _columns_of(campaign.with_left_out, header)
    parse_table(columns, header, path, plausible)
    try:
        with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))
        with whole_file(folder / HEADER) as temporary:
            content = header.model_dump(mode="json", exclude_none=True)
            text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True)
            temporary.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"{folder}: cannot be written: {error.strerror or error}") from None


def parse_table(columns: Columns, header: Header, path: Path, plausible: bool = True) -> Campaign:
    """Check the columns of the table `path`, and make a campaign of them and the header."""
    given: dict[str, Array] = {}
    labels: list[str] = []
    for attribute, column in COLUMNS.items():
        names = column.names
        if not (column.needed or {*names} & {*columns}):
            continue
        parts = [_numbers(columns, name, labels, path) for name in names]
        if attribute == "positions":
            labels = [f"position {value:.15g}" for value in parts[0]]
        for name, part in zip(names, parts, strict=True):
            _check_column(attribute, name, part, labels, path)
        given[attribute] = np.column_stack(parts) if len(parts) > 1 else parts[0]
    _check_robot(given, header, path)
    values: dict[str, Any] = {}
    with np.errstate(all="ignore"):  # the checks below find what overflows
        for attribute, array in given.items():
            values[attribute] = header.conversion(attribute).to_si(array)
    _check_forces(values["forces"], header, path, labels, plausible)
    if header.robot is not None:
        values.setdefault("yaw", np.zeros(len(labels)))
    for attribute, array in values.items():
        if COLUMNS[attribute].whole:
            values[attribute] = array.astype(np.int64)
    campaign = campaign_of(header, values)
    if plausible:
        check_plausible(campaign, f"{path.with_name(HEADER)} and {path.name}")
    reasons = {entry.position: entry.reason for entry in header.excluded or ()}
    try:
        return campaign.without(reasons)
    except InputError as error:
        raise InputError(f"{path.with_name(HEADER)}: {error}") from None


def _check_column(
    attribute: str, name: str, values: Array, labels: Sequence[str], path: Path
) -> None:
    """Check what must hold for a column in any unit."""

    def complain_of(wrong: NDArray[np.bool_], text: str) -> None:
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InputError(f"{path}: {name}: {labels[i]}: {values[i]:.15g} {text}")

    column = COLUMNS[attribute]
    if column.whole:
        complain_of(values % 1 != 0, "is no whole number")
    within = column.within
    for i in np.flatnonzero((values < within.least) | (values > within.most))[:1]:
        within.check_key(f"{path}: {name}: {labels[i]}", values[i])
    behind = np.diff(values, prepend=-np.inf)
    if attribute == "positions":
        text = "follows no smaller number; number the holds 1, 2, 3 … in order of acquisition"
        complain_of(behind <= 0, text)
    if attribute == "time":
        complain_of(behind < 0, "is before the hold above; rows must be in order of acquisition")
    if attribute == "forces" and len(values) > 1 and np.ptp(values) == 0:
        raise InputError(
            f"{path}: {name}: {values[0]:.15g} in all positions; a channel that works changes"
        )


def _check_robot(given: Mapping[str, Array], header: Header, path: Path) -> None:
    """Check that angles and their sigma come together."""
    roll, pitch = COLUMNS["angles"].names
    key = f"{path.with_name(HEADER)}: robot.angle_sigma_mgon"
    if "yaw" in given and "angles" not in given:
        raise InputError(f"{path}: yaw_robot_gon: goes with {roll} and {pitch}, which are missing")
    if header.reference is not None:
        key = f"{path.with_name(HEADER)}: reference"
    elif "angles" in given and header.robot is None:
        raise InputError(f"{key}: missing, but {path.name} has {roll} and {pitch}")
    if (header.robot or header.reference) is not None and "angles" not in given:
        raise InputError(f"{key}: is given, but {path.name} has no {roll} and {pitch}")


def _check_forces(
    forces: Array, header: Header, path: Path, labels: Sequence[str], plausible: bool
) -> None:
    """Check that forces (n, 3), m/s², can be calculated with and, if asked, that none is absurd."""
    where, gravity = f"{path}: fx, fy, fz", header.gravity.value_mps2
    norm = usual_norm(forces)
    if not (norm > 1 / MAX_CELL and np.max(abs(forces)) < MAX_CELL):
        raise InputError(
            f"{where}: their norm is about {norm:.3g} m/s², which no unit makes gravity, "
            f"{gravity:g} m/s²; correct the columns"
        )
    absurd = np.linalg.norm(forces, axis=1) > MAX_GRAVITIES * max(gravity, norm)
    if plausible and absurd.any():
        label = labels[int(np.argmax(absurd))]
        raise InputError(
            f"{where}: {label}: more than {MAX_GRAVITIES} times gravity; "
            "correct the mean, or leave out the hold"
        )


def campaign_of(header: Header, values: Mapping[str, Any]) -> Campaign:
    """Make a campaign of a header and of columns in SI, by attribute."""
    sigma_angle = None
    if header.robot is not None:
        sigma_angle = header.robot.angle_sigma_mgon * MGON
    elif header.reference is not None:
        sigma_angle = header.reference.sigma_mps2 / header.gravity.value_mps2
    of_header: dict[str, Any] = {}
    for attribute, key in _OF_HEADER.items():
        value: Any = header
        for part in key.split("."):
            value = getattr(value, part, None)
        of_header[attribute] = value
    return Campaign(
        **of_header,
        sigma_angle=sigma_angle,
        nominal=None if header.nominal is None else header.conversion("forces"),
        resolution=None if header.resolution_mps2 is None else np.array(header.resolution_mps2),
        **values,
    )


def _numbers(columns: Columns, name: str, labels: Sequence[str], path: Path) -> Array:
    """Column of finite numbers; `labels` name its rows in errors."""
    if name not in columns:
        lower = {other.lower(): other for other in columns if other not in KNOWN}
        near = get_close_matches(name.lower(), lower, n=1)
        hint = f"; is {lower[near[0]]!r} meant?" if near else ""
        beside = next((c.names for c in COLUMNS.values() if name in c.names), ())
        group = f" (it goes with {', '.join(n for n in beside if n != name)})" if beside[1:] else ""
        raise InputError(f"{path}: {name}: the column is missing{group}{hint}")
    values = columns[name]
    if not len(values):
        raise InputError(f"{path}: no positions; expected one row per hold")
    numbers = np.empty(len(values))
    for i, value in enumerate(values):
        where = f"{path}: {name}: {labels[i] if labels else f'row {i + 1}'}"
        if value == "":
            raise InputError(f"{where}: empty; expected a number")
        try:
            if "_" in str(value):
                raise ValueError
            numbers[i] = float(value)
        except ValueError:
            shown = one_line(repr(value), 60)
            raise InputError(f"{where}: {shown} is no number, such as -9.81") from None
        if not np.isfinite(numbers[i]):
            raise InputError(f"{where}: {value} is not finite; leave out a hold that has no mean")
    return numbers


def _content_of(campaign: Campaign) -> dict[str, Any]:
    """Content of `campaign.yaml` for a campaign."""
    content: dict[str, Any] = {"schema_version": 1}
    for attribute, key in _OF_HEADER.items():
        value = getattr(campaign, attribute)
        block, _, inner = key.rpartition(".")
        if value is not None:
            (content.setdefault(block, {}) if block else content)[inner] = value
    if campaign.sigma_force is None:
        content.pop("sensor_noise", None)
    if campaign.nominal is not None:
        nominal = {"scale": campaign.nominal.scale, "offset": campaign.nominal.offset}
        content["nominal"] = {k: np.asarray(v).tolist() for k, v in nominal.items()}
    if campaign.resolution is not None:
        content["resolution_mps2"] = np.asarray(campaign.resolution).tolist()
    if campaign.left_out:
        content["excluded"] = campaign.exclusions
    if campaign.reference is None and campaign.sigma_angle is not None:
        content["robot"] = {"angle_sigma_mgon": campaign.sigma_angle / MGON}
    return content


def _columns_of(campaign: Campaign, header: Header) -> dict[str, list[Any]]:
    """Columns of a campaign in the units of the files."""
    columns: dict[str, list[Any]] = {}
    for attribute, column in COLUMNS.items():
        values, names = getattr(campaign, attribute), column.names
        if values is None:
            continue
        shape = (campaign.n_positions, len(names)) if len(names) > 1 else (campaign.n_positions,)
        if np.shape(values) != shape:
            raise InputError(f"{campaign.name}: {attribute}: shape {np.shape(values)}, not {shape}")
        if not column.whole:
            values = header.conversion(attribute).from_si(np.asarray(values, dtype=float))
        columns.update(zip(names, np.reshape(values, (-1, len(names))).T.tolist(), strict=True))
    return columns
