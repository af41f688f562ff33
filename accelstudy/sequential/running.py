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
    read_header,
)
from accelstudy.campaign.header import HEADER, TABLE, Header
from accelstudy.campaign.session import Campaign
from accelstudy.files.reading import read_text

MIN_LOOKS = 3
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


def read_running(folder: str | Path, settled: bool = False) -> Running:
    """Read a session so far.

    Parameters
    ----------
    folder : path
    settled : bool, whether a last line without an end is taken all the same

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
    header, path = read_header(folder), folder / TABLE
    try:
        text = read_text(path) if path.exists() else ""
    except UnicodeDecodeError as error:  # the last character may be incomplete
        raise InputError(f"{path}: not a CSV file in UTF-8 ({error.reason})") from None
    end = len(text) if settled else max(text.rfind("\n"), text.rfind("\r")) + 1
    whole, unfinished = text[:end], text[end:]
    columns = columns_of(whole, path) if whole.strip() else {}
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
        whole = read_running(folder, settled=True).campaign
    except InputError:  # it is half a line
        return running
    odd = f"{folder}: the last line of the table does not end; check that it is whole"
    return Running(replace(whole, warnings=(*whole.warnings, odd)), "")


def _without_positions(header: Header) -> Campaign:
    values = {"positions": np.zeros(0, dtype=np.int64), "forces": np.zeros((0, 3))}
    if (header.robot or header.reference) is not None:
        values["angles"] = np.zeros((0, 2))
    return campaign_of(header, values)


class Watch:
    """Looks at a campaign folder again and again.

    Parameters
    ----------
    folder : Path
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._files: bytes | None = None
        self._whole, self._count = b"", -1
        self._rested, self._complaint = 0, ""

    def look(self) -> Iterator[Campaign]:
        """Yield the session if it has changed since the last look, position by position.

        Raises
        ------
        InputError
            If the campaign cannot be read. After the first look the table is probably just being
            written: the error is raised once, and again when it is another one.
        """
        files = b"".join(path.read_bytes() for path in _files(self.folder))
        self._rested = self._rested + 1 if files == self._files else 0
        self._files, first_look = files, self._count < 0
        if self._rested not in (0, MIN_LOOKS):
            return
        try:
            now = read_running(self.folder, settled=self._rested > 0)
        except InputError as error:
            if not first_look and str(error) == self._complaint:
                return
            self._complaint = str(error)
            raise
        whole, count = files.removesuffix(now.unfinished.encode()).strip(), now.campaign.n_positions
        changed, before = whole != self._whole, self._count
        self._whole, self._count, self._complaint = whole, count, ""
        if first_look:
            yield now.campaign
        elif changed and (count or before):
            for n in range(min(before + 1, count), count + 1):
                yield _first(now.campaign, n)


def _files(folder: Path) -> list[Path]:
    """Files of a campaign that exist."""
    return [path for path in (folder / HEADER, folder / TABLE) if path.is_file()]


def _first(campaign: Campaign, n: int) -> Campaign:
    """Return the campaign as it was with n positions."""
    if n == campaign.n_positions:
        return campaign
    later = {int(p): "later" for p in campaign.positions[n:]}
    part = campaign.without(later)
    return replace(part, left_out=campaign.left_out)
