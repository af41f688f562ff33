"""Dates as people and files write them: ISO 8601."""

from __future__ import annotations

from datetime import UTC, datetime

from accelstudy.basics.errors import InputError, brief


def read_date(text: str) -> datetime:
    """Date of a text, such as 2026-03-01 or 2026-03-01T14:00; in UTC if it names a time zone.

    Raises
    ------
    InputError
        If it is no date, or one at which nobody calibrated.
    """
    try:
        date = datetime.fromisoformat(text)
    except ValueError:
        raise InputError(f"{brief(text)} is no date, such as 2026-03-01") from None
    if not 1900 <= date.year < 2200:
        raise InputError(f"{text}: the year must be from 1900 to 2199")
    return date if date.tzinfo is None else date.astimezone(UTC).replace(tzinfo=None)
