"""Dates as people and files write them: ISO 8601."""

from __future__ import annotations

from datetime import UTC, date, datetime

from accelstudy.basics.errors import InputError, brief


def read_date(given: str | date) -> datetime:
    """Date of a date or a text, as 2026-03-01 or 2026-03-01T14:00; in UTC if it has a time zone.

    Raises
    ------
    InputError
        If it is no date, or one at which nobody calibrated.
    """
    try:
        read = datetime.fromisoformat(given.isoformat() if isinstance(given, date) else given)
    except ValueError:
        raise InputError(f"{brief(given)} is no date, such as 2026-03-01") from None
    if not 1900 <= read.year < 2200:
        raise InputError(f"{given}: the year must be from 1900 to 2199")
    return read if read.tzinfo is None else read.astimezone(UTC).replace(tzinfo=None)
