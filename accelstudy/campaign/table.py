"""The table of a campaign: from the columns of a file to holds in SI, checked, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError, brief, did_you_mean
from accelstudy.campaign.columns import COLUMNS, KEYS, Columns, table_of
from accelstudy.campaign.header import HEADER, Header

Table = Mapping[str, Sequence[Any]]
"""The table of positions by name: texts of its file, or numbers that are to be written."""


def format_columns(holds: pd.DataFrame, header: Header) -> dict[str, list[Any]]:
    """Columns of a table of holds, in the units of the file."""
    table, holds = dict[str, list[Any]](), holds.reset_index()
    for attribute, columns in COLUMNS.items():
        if columns.names[0] in holds:
            values = columns.array(holds)
            if not columns.whole:
                values = header.conversion(attribute).from_si(values)
            table |= zip(columns.keys, values.T.tolist(), strict=True)
    return table


def parse_holds(columns: Table, header: Header, path: Path) -> pd.DataFrame:
    """Check the columns of the table `path`, and make a table of holds of them."""
    if not any(map(len, columns.values())):
        raise InputError(f"{path}: no positions; expected one row per hold")
    rows = [f"row {i}" for i in range(1, 1 + max(map(len, columns.values())))]
    arrays: dict[str, Any] = {}
    for attribute, column in COLUMNS.items():
        if not (column.needed or {*column.keys} & {*columns}):
            continue
        parts = [_numbers(columns, key, column, rows, path) for key in column.keys]
        if attribute == "positions":
            rows = [f"position {value:.0f}" for value in parts[0]]
        array = np.column_stack(parts) if parts[1:] else parts[0]
        array = header.conversion(attribute).to_si(array)
        arrays[attribute] = array.astype(np.int64) if column.whole else array
    _check_together(arrays, header, path)
    return table_of(arrays)


def _numbers(columns: Table, name: str, column: Columns, rows: Sequence[str], path: Path) -> Array:
    """Numbers of a column, checked; errors name the row."""
    if name not in columns:
        rest = ", ".join(other for other in column.keys if other != name)
        group = f" (it goes with {rest})" if rest else ""
        others = [other for other in columns if other not in KEYS]
        raise InputError(
            f"{path}: {name}: the column is missing{group}{did_you_mean(name, others)}"
        )
    values = np.array([*map(_number, columns[name])])

    def refuse(wrong: NDArray[np.bool_], text: str) -> None:
        if wrong.any():
            i = int(np.argmax(wrong))
            raise InputError(f"{path}: {name}: {rows[i]}: {brief(columns[name][i])} {text}")

    refuse(~np.isfinite(values), "is no number, such as -9.81; leave out a hold without a mean")
    for i in np.flatnonzero((values < column.within.least) | (values > column.within.most))[:1]:
        column.within.check_key(f"{path}: {name}: {rows[i]}", values[i])
    if column.whole:
        refuse(values % 1 != 0, "is no whole number")
    behind = np.diff(values, prepend=-np.inf)
    if name == "position":
        refuse(behind <= 0, "follows no smaller number; number the holds 1, 2, 3 … as acquired")
    if name == "time_s":
        refuse(behind < 0, "is before the hold above; rows must be in order of acquisition")
    return values


def _number(cell: Any) -> float:
    """Number of a cell; NaN if it is none. Python would also take 1_0 for one."""
    try:
        return float(str(cell).replace("_", "?"))
    except ValueError:
        return np.nan


def _check_together(arrays: Mapping[str, Array], header: Header, path: Path) -> None:
    """Check that every channel works, and that angles and their sigma come together."""
    for name, channel in zip(COLUMNS["forces"].keys, arrays["forces"].T, strict=True):
        if len(channel) > 1 and np.ptp(channel) == 0:
            raise InputError(
                f"{path}: {name}: the same in all positions; a channel that works changes"
            )
    angles = " and ".join(COLUMNS["angles"].keys)
    if "angles" not in arrays:
        if "yaw" in arrays:
            raise InputError(f"{path}: yaw_robot_gon: goes with {angles}, which are missing")
        for key in ("robot", "reference"):
            if getattr(header, key) is not None:
                raise InputError(
                    f"{path.with_name(HEADER)}: {key}: is given, but {path.name} has no {angles}"
                )
    elif header.robot is None and header.reference is None:
        raise InputError(
            f"{path.with_name(HEADER)}: robot.angle_sigma_mgon: missing, but {path.name} has "
            f"{angles}"
        )
