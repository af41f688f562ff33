"""A campaign that is being measured, read as it is."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import (
    campaign_of,
    columns_of,
    ignored_in,
    parse_table,
    read_header,
)
from accelstudy.campaign.header import TABLE, Header
from accelstudy.campaign.session import Campaign
from accelstudy.files.reading import read_text


def read_running(folder: str | Path) -> Campaign:
    """Read a session so far; a last line without an end is not there yet.

    Raises
    ------
    InputError
        As `accelstudy.campaign.format.read_campaign`, but not for positions that are not
        there yet.
    """
    folder = Path(folder)
    header, path = read_header(folder), folder / TABLE
    try:
        text = read_text(path) if path.exists() else ""
    except UnicodeDecodeError as error:  # the last character may be incomplete
        raise InputError(f"{path}: not a CSV file in UTF-8 ({error.reason})") from None
    whole = text[: max(text.rfind("\n"), text.rfind("\r")) + 1]
    campaign = _session(whole, header, path)
    if whole == text:
        return campaign
    warning = f"{folder}: the last line of the table has no end yet; it is not counted"
    return replace(campaign, warnings=(*campaign.warnings, warning))


def _session(text: str, header: Header, path: Path) -> Campaign:
    """The session of a table; it may have no positions."""
    columns = columns_of(text, path) if text.strip() else {}
    if any(map(len, columns.values())):
        campaign = parse_table(columns, header, path)
        return replace(campaign, warnings=tuple(ignored_in(columns, path)))
    values = {"positions": np.zeros(0, dtype=np.int64), "forces": np.zeros((0, 3))}
    if (header.robot or header.reference) is not None:
        values["angles"] = np.zeros((0, 2))
    return campaign_of(header, values)
