"""Dates with times, and times of day, as loggers write them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

_CLOCK = r"\d{1,2}:\d\d(:\d\d([.,:]\d+)?)?"
_ISO = r"\d{4}-?\d\d-?\d\d[T ]\d\d(:?\d\d.*)?"
_DAY = r"(\d{4}(?P<of>[-/.])\d{1,2}(?P=of)\d{1,2}|\d{1,2}\.\d{1,2}\.\d{4})"
_STAMP = re.compile(rf"{_ISO}|{_DAY}[T ]+{_CLOCK}|{_CLOCK}")
"""The order of day and month is plain in 31.1.2024, but not in 3/1/2024."""
_AS_ISO = (
    (r"(:\d\d:\d\d)[,:](\d+)$", r"\1.\2"),  # "12:30:05:500", as LabVIEW and others write it
    (r"^(\d{1,2})\.(\d{1,2})\.(\d{4})", r"\3-\2-\1"),
    (r"^(\d{1,2}:)", r"1970-01-01 \1"),
    (r"[T ]+(\d):", r" 0\1:"),
)


def is_stamp(text: str) -> bool:
    """Whether a text is a date with a time, or a time of day, that `nanoseconds` reads."""
    return _STAMP.fullmatch(text.strip()) is not None


def nanoseconds(column: pd.Series) -> NDArray[Any]:
    """Dates with times as ns since 1970, NaN where there is none; of a time of day, since midnight.

    One without a zone is in UTC, so that all of a column go together. Years that do not fit into
    ns (before 1678 and after 2261) are no dates of a log.
    """
    import pandas as pd

    dates = pd.to_datetime(column, format="ISO8601", utc=True, errors="coerce")
    if dates.isna().any() and not pd.api.types.is_datetime64_any_dtype(column):
        text = column.astype("str").str.strip()
        for pattern, iso in _AS_ISO:
            text = text.str.replace(pattern, iso, regex=True)
        dates = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
    dates = dates.where((dates.dt.year > 1677) & (dates.dt.year < 2262))
    numbers = dates.dt.as_unit("ns").astype("int64").to_numpy()
    return np.where(dates.isna(), np.nan, numbers) if dates.isna().any() else numbers
