"""Logs of a program: a file, or a table in memory, and how it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from accelstudy.api.given import for_programs, of_type, path_of
from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.opening import open_source
from accelstudy.campaign.importing.sources import LogFile, TableSource
from accelstudy.files.validation import checked
from accelstudy.pages.notebook import notebook_html


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A log, and how it is read; the numbers of a file stay there until they are needed.

    Attributes
    ----------
    file : path, or the columns of a table in memory
    layout : dict, keys of the settings of `import` that were given
    table : DataFrame, the table in memory, as it was given; None of a file
    """

    file: LogFile
    layout: dict[str, Any]
    table: pd.DataFrame | None = None

    @property
    def name(self) -> str:
        """Name of the file; DataFrame, of a table in memory."""
        return Path(str(self.file)).name

    def __repr__(self) -> str:
        return f"Log({self.name!r}, {', '.join(self.layout) or 'nothing given'})"

    def _repr_html_(self) -> str:
        given = pd.DataFrame(self.layout.items(), columns=["setting", "value"], dtype=object)
        return notebook_html("Log", self.name, given)


@for_programs
def read_log(
    log: str | PathLike[str] | pd.DataFrame,
    *,
    rate: float | None = None,
    columns: Mapping[str, str | int] | None = None,
    **layout: Any,
) -> Log:
    """Say which log to read, and how.

    Parameters
    ----------
    log : path or DataFrame
        Text (CSV or columns, perhaps .gz), MATLAB, Parquet, a bag of ROS, a ULog of
        PX4, or a table in memory, of which an index of dates is the time.
    rate : float, Hz, optional
        Samples per second, where there is no column of time.
    columns : mapping, optional
        ``fx``, ``fy``, ``fz``, ``temperature`` and ``vibration`` to the name of a column, or its
        number from 0.
    layout
        Other keys of the settings of ``accelstudy import`` that say how a log is read: ``time``,
        ``time_unit``, ``unit``, ``scale``, ``offset``, ``frame``, ``variable``,
        ``delimiter``.

    Returns
    -------
    Log

    Raises
    ------
    InputError
        If there is no such file, or a key or a value is wrong.
    """
    if columns is not None:
        of_type("columns", columns, Mapping, expected="a mapping, as {'fx': 'ax'}")
        columns = dict(columns)
    given = {"rate_hz": rate, "columns": columns, **layout}
    given = {key: value for key, value in given.items() if value is not None}
    known = checked(LogLayout, given, "read_log")
    if not isinstance(log, pd.DataFrame):
        path = path_of("log", log, "a path or a DataFrame")
        open_source(path, given.get("variable"), known.delimiter)
        return Log(path, given)
    table = log.copy()  # what its owner changes later is not of this log
    rows = table
    if "rate_hz" not in given and "time" not in given:
        rows, given = _with_time(table, given)
    try:
        typed = pa.Table.from_pandas(rows.rename(columns=str), preserve_index=False)
    except (TypeError, ValueError, NotImplementedError) as error:
        reason = one_line(error.args[-1])
        raise InputError(
            f"log: the DataFrame cannot be a log, which has numbers: {reason}"
        ) from None
    return Log(TableSource("DataFrame", typed), given, table)


def _with_time(log: pd.DataFrame, given: dict[str, Any]) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Take the times of an index of dates or durations, as a last column."""
    index, name = log.index, str(log.index.name or "time")
    if not isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex) or name in map(str, log.columns):
        return log, given
    times = index.total_seconds() if isinstance(index, pd.TimedeltaIndex) else index
    return log.assign(**{name: times}), {**given, "time": name}


def log_of(log: Any) -> Log:
    """Return a log as such, whatever way it was given."""
    return log if isinstance(log, Log) else read_log(log)
