"""A campaign that is being measured: read as it is, and followed while its table grows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.campaign.format import (
    campaign_of,
    columns_of,
    ignored_in,
    parse_table,
    read_campaign,
    read_header,
    table_of,
)
from accelstudy.campaign.header import COLUMNS, HEADER, Header
from accelstudy.campaign.session import Campaign
from accelstudy.files.reading import read_text

SETTLED = 3
"""Number of looks after which a last line without an end is taken, as editors may leave it out."""


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
        As `accelstudy.campaign.format.read_campaign`, but not for positions that are not
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
        return Running(_without_positions(header), "")
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
        return Running(_without_positions(header), unfinished)
    columns = columns_of(whole, path)
    if not any(map(len, columns.values())):
        return Running(_without_positions(header), unfinished)
    campaign = parse_table(columns, header, path)
    warnings = tuple(ignored_in(columns, path))
    return Running(replace(campaign, warnings=warnings), unfinished)


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


def _without_positions(header: Header) -> Campaign:
    values = {"positions": np.zeros(0, dtype=np.int64), "forces": np.zeros((0, 3))}
    if (header.robot or header.reference) is not None:
        values["angles"] = np.zeros((0, 2))
    return campaign_of(header, values)


@dataclass(frozen=True)
class News:
    """News of a session.

    Attributes
    ----------
    campaign : Campaign, so far
    remark : str, what else happened to the table; empty if positions were only added
    again : bool, whether earlier positions are gone or have changed
    """

    campaign: Campaign
    remark: str
    again: bool


class Watch:
    """Looks at a campaign folder again and again.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._seen: Campaign | None = None
        self.unfinished, self._rested, self._settled = "", 0, ""
        self._complaint = ""

    def look(self) -> Iterator[News]:
        """Yield what is new since the last look, position by position.

        Raises
        ------
        InputError
            At the first look, if the campaign cannot be read. A table that cannot be read later
            is probably just being written: the error is reported once, as a remark.
        """
        try:
            running = read_running(self.folder, self._settled)
        except InputError as error:
            if self._seen is None:
                raise
            if str(error) != self._complaint:
                self._complaint = str(error)
                yield News(self._seen, f"waiting for a whole table: {error}", False)
            return
        self._complaint = ""
        same = running.unfinished == self.unfinished
        self._rested = self._rested + 1 if running.unfinished and same else 0
        self.unfinished = running.unfinished
        if self._rested >= SETTLED:  # from the next look on
            self._settled = self.unfinished
        yield from self._compare(running.campaign)

    def _compare(self, now: Campaign) -> Iterator[News]:
        before, self._seen = self._seen, now
        if before is None:
            yield News(now, "", False)
            return
        remark = _changes(before, now)
        if remark:
            yield News(now, f"{remark}; starting over", True)
            return
        for n in range(before.n_positions + 1, now.n_positions + 1):
            yield News(_first(now, n), "", False)


def _first(campaign: Campaign, n: int) -> Campaign:
    """Return the campaign as it was with n positions."""
    if n == campaign.n_positions:
        return campaign
    later = {int(p): "later" for p in campaign.positions[n:]}
    reasons, excluded = dict(campaign.reasons), campaign.excluded
    part = campaign.without(later)
    return replace(part, excluded=excluded, reasons=reasons)


def _changes(before: Campaign, now: Campaign) -> str:
    """How earlier positions have changed; empty if they have not."""
    if before.reasons != now.reasons:
        return "campaign.yaml leaves out other positions"
    gone = [str(p) for p in before.positions if p not in now.positions]
    if gone:
        return (
            f"position {gone[0]} is gone"
            if len(gone) == 1
            else (f"positions {', '.join(gone)} are gone")
        )
    n = before.n_positions
    if not np.array_equal(before.positions, now.positions[:n]):
        return "a position came in before the last one"
    for name in COLUMNS:
        old, new = getattr(before, name), getattr(now, name)
        if n and (old is None) != (new is None):
            return f"the columns of {name} came or went"
        if old is not None and new is not None and not np.array_equal(old, new[:n]):
            changed = before.positions[np.any(np.reshape(old != new[:n], (n, -1)), axis=1)]
            return f"position {changed[0]} was changed"
    header = (
        "unit",
        "gravity",
        "sigma_gravity",
        "sigma_force",
        "sigma_angle",
        "reference",
        "full_range",
    )
    if any(getattr(before, name) != getattr(now, name) for name in header):
        return "campaign.yaml was changed"
    return ""
