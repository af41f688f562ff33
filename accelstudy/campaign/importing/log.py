"""The result of `accelstudy.read_log`: a file or a table in memory, and its layout."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa

from accelstudy.basics.arguments import path_of, tidy
from accelstudy.basics.errors import InputError, key
from accelstudy.basics.units import MGON
from accelstudy.basics.wording import one_line
from accelstudy.campaign.header import LogLayout
from accelstudy.campaign.importing.sources import LogFile, Source
from accelstudy.files.validation import validate
from accelstudy.pages.notebook import notebook_html


@dataclass(frozen=True, eq=False, repr=False)
class Log:
    """A log with its layout; the numbers of a file are read when they are needed.

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
        return f"Log({', '.join([repr(self.name), *self.layout])})"

    def _repr_html_(self) -> str:
        given = pd.DataFrame(self.layout.items(), columns=["setting", "value"], dtype=object)
        return notebook_html("Log", self.name, given)


def log_of(log: Any, given: Mapping[str, Any]) -> Log:
    """Return a log with the keywords that say how it is read; they go before its own."""
    layout = layout_of(given)
    if isinstance(log, Log):
        return replace(log, layout=log.layout | layout)
    if not isinstance(log, pd.DataFrame):
        return Log(path_of("log", log, "a path or a DataFrame"), layout)
    table = log.copy()  # what its owner changes later is not of this log
    rows = table
    if "rate_hz" not in layout and "time" not in layout:
        rows, layout = _with_time(table, layout)
    try:
        typed = pa.Table.from_pandas(rows.rename(columns=str), preserve_index=False)
    except (TypeError, ValueError, NotImplementedError) as error:
        reason = one_line(error.args[-1])
        raise InputError(
            f"log: the DataFrame cannot be a log, which has numbers: {reason}"
        ) from None
    return Log(Source("DataFrame", typed), layout, table)


def _with_time(log: pd.DataFrame, given: dict[str, Any]) -> tuple[pd.DataFrame, dict[str, Any]]:
    """Take the times of an index of dates or durations, as a last column."""
    index, name = log.index, str(log.index.name or "time")
    if not isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex) or name in map(str, log.columns):
        return log, given
    times = index.total_seconds() if isinstance(index, pd.TimedeltaIndex) else index
    return log.assign(**{name: times}), {**given, "time": name}


def layout_of(given: Mapping[str, Any]) -> dict[str, Any]:
    """Keys of a layout that keywords say, checked; other keywords do not count."""
    fields = LogLayout.model_fields
    content, names = keys_of({k: given[k] for k in given if KEYS.get(k, k) in fields})
    return validate(LogLayout, content, "log", names=names).model_dump(exclude_unset=True)


KEYS = {
    "rate": "rate_hz",
    "range": "range_mps2",
    "threshold": "threshold_mps2",
    "window": "window_s",
    "trim": "trim_s",
    "shortest": "shortest_s",
    "gravity": "gravity.value_mps2",
    "robot_sigma": "robot.angle_sigma_mgon",
    "robot_unit": "robot.unit",
}
"""Keywords whose keys in a file have other names, of which some say a unit."""


def keys_of(given: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
    """Content of a file of settings that says the same as keywords; its keys, and their names."""
    content: dict[str, Any] = {}
    names = {}
    for name, value in given.items():
        if value is None or value == ():
            continue
        place = KEYS.get(name, name)
        names[place] = key(name)
        block, _, inner = place.rpartition(".")
        part = content.setdefault(block, {}) if block else content
        value = tidy(value / MGON) if name == "robot_sigma" else value
        part[inner] = list(value) if isinstance(value, tuple) else value
    return content, names
