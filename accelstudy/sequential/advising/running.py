"""A campaign that is being measured: its folder may have few positions, or none yet."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.files.format import (
    campaign_of,
    columns_of,
    ignored_in,
    parse_table,
    read_campaign,
    read_header,
    table_of,
)
from accelstudy.campaign.files.header import HEADER, Header
from accelstudy.campaign.files.session import Campaign
from accelstudy.files.reading import read_text


@dataclass(frozen=True)
class Running:
    """A session so far.

    Attributes
    ----------
    campaign : Campaign, with its complete positions
    unfinished : str, a last line that is still being written; empty if there is none
    """

    campaign: Campaign
    unfinished: str


def read_running(folder: str | Path, settled: str = "") -> Running:
    """Read a session so far.

    Parameters
    ----------
    folder : path
    settled : str
        A last line without an end that is taken all the same, because it has not changed lately.

    Raises
    ------
    InputError
        As `accelstudy.campaign.files.format.read_campaign`, but not for positions that are not
        there yet.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; a running session has one with {HEADER}, and its positions "
            "in positions.csv"
        )
    header, path = read_header(folder), table_of(folder)
    if path is None:
        return Running(_without_positions(header, folder), "")
    if path.suffix != ".csv":
        return Running(read_campaign(folder), "")
    try:
        text = read_text(path)
    except UnicodeDecodeError as error:  # the last character may be incomplete
        raise InputError(f"{path}: not a CSV file in UTF-8 ({error.reason})") from None
    whole, unfinished = _split(text)
    if unfinished and unfinished == settled:
        whole, unfinished = text, ""
    if not whole.strip():
        return Running(_without_positions(header, folder), unfinished)
    columns = columns_of(whole, path)
    if not any(map(len, columns.values())):
        return Running(_without_positions(header, folder), unfinished)
    campaign = parse_table(columns, header, path)
    warnings = tuple(ignored_in(columns, path))
    return Running(replace(campaign, warnings=warnings, source=folder), unfinished)


def read_as_it_is(folder: str | Path) -> Running:
    """Read a session once, as it is: a last line without an end counts if it has all cells.

    Errors are those of `read_running`.
    """
    running = read_running(folder)
    if not running.unfinished:
        return running
    try:
        whole = read_running(folder, running.unfinished).campaign
    except InputError:  # it is half a line
        return running
    odd = f"{folder}: the last line of the table does not end; check that it is whole"
    return Running(replace(whole, warnings=(*whole.warnings, odd)), "")


def _split(text: str) -> tuple[str, str]:
    """Complete lines, and the text after them."""
    end = max(text.rfind("\n"), text.rfind("\r")) + 1
    return text[:end], text[end:]


def _without_positions(header: Header, folder: Path) -> Campaign:
    values = {"positions": np.zeros(0, dtype=np.int64), "forces": np.zeros((0, 3))}
    if header.robot is not None:
        values["angles"] = np.zeros((0, 2))
    return replace(campaign_of(header, values), source=folder)
