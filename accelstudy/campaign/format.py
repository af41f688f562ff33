"""A campaign: one calibration session of one sensor, as a folder with two files."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from accelstudy.basics.errors import InputError, brief, did_you_mean, locate_errors
from accelstudy.basics.wording import one_line, short_list
from accelstudy.campaign.columns import KEYS, table_of
from accelstudy.campaign.gross_errors.recognition import check_plausible
from accelstudy.campaign.header import HEADER, TABLE, Header
from accelstudy.campaign.session import Campaign
from accelstudy.campaign.table import Table, format_columns, parse_holds
from accelstudy.files.outputs import write_text, write_yaml
from accelstudy.files.reading import read_layer, read_text
from accelstudy.files.validation import validate


def read_campaign(folder: str | Path, *, plausible: bool = True, running: bool = False) -> Campaign:
    """Read a campaign folder: `campaign.yaml` and `positions.csv`.

    With ``unit: g`` forces are multiples of standard gravity, 9.80665 m/s². This unit is the same
    everywhere, while `gravity` is the local value. If the data are scaled so that local gravity is
    1, give 9.80665 as the value of gravity.

    With ``unit: counts`` forces are (raw − offset) · scale, and sds are sd · abs(scale).

    Numbers in `position` increase, but some may be missing, as after the removal of a hold.
    Unknown columns are left out and named in `warnings`.

    Parameters
    ----------
    folder : path
    plausible : bool
        Whether to refuse forces that are not as large as gravity, and angles that fit them better
        in another unit. False is for callers that look for such errors themselves.
    running : bool
        Whether the session still runs: there may be no position yet, and a last line without an
        end is not there yet.

    Raises
    ------
    InputError
        If a file is missing or incomplete, or a value cannot be right; one line says where.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; a campaign is one with {HEADER} and {TABLE}")
    header, path = validate(Header, read_layer(folder / HEADER), folder / HEADER), folder / TABLE
    text, warnings = "" if running and not path.exists() else _text_of(path), []
    # Half a number is a number, too: if the file was cut there, only the line end is missing.
    if text and not text.endswith("\n") and running:
        text = text[: text.rfind("\n") + 1]
        warnings = [f"{folder}: the last line of the table has no end yet; it is not counted"]
    elif text and not text.endswith("\n"):
        warnings = [f"{path}: the last line does not end; check that it is whole"]
    columns = {} if running and not text.strip() else _columns_of(text, path)
    if running and not any(columns.values()):
        angles = None if header.sigma_angle is None else np.zeros((0, 2))
        campaign = Campaign(header, table_of({"forces": np.zeros((0, 3)), "angles": angles}))
    else:
        campaign = _campaign_of(columns, header, path, plausible)
        if unknown := [name for name in columns if name not in KEYS]:
            hints = dict.fromkeys(did_you_mean(name, KEYS) for name in unknown)
            said = f"{path}: not known and ignored: {short_list(unknown)}{''.join(hints)}"
            warnings = [said, *warnings]
    return replace(campaign, warnings=tuple(warnings))


def _text_of(path: Path) -> str:
    """Text of a table."""
    try:
        return read_text(path)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a CSV file in UTF-8 ({error.reason})") from None


def _columns_of(text: str, path: Path) -> Table:
    """Columns of the text of a CSV table; errors name `path`."""
    head = text.lstrip().partition("\n")[0].strip()
    if head and "," not in head:
        raise InputError(
            f"{path}: one column, {brief(head)}; expected columns between commas, and numbers "
            "with a decimal point"
        )
    try:
        rows = pd.read_csv(
            io.StringIO(text), header=None, dtype=str, na_filter=False, skipinitialspace=True
        )
    except pd.errors.EmptyDataError:
        raise InputError(
            f"{path}: empty; expected a line of column names, position, fx, fy, fz …"
        ) from None
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: not a whole CSV file ({one_line(error)})") from None
    names = [name.strip() for name in rows.iloc[0]]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path}: {name!r}: the column stands twice")
    return {name: rows[i][1:].tolist() for i, name in enumerate(names)}


def write_campaign(campaign: Campaign, folder: str | Path, plausible: bool = True) -> None:
    """Write a campaign folder, in the unit that the campaign had.

    Parameters
    ----------
    campaign : Campaign
        Its `warnings` are not written.
    folder : path
        Made if it does not exist; other files in it stay.
    plausible : bool
        As in `read_campaign`.

    Raises
    ------
    InputError
        If the campaign could not be read again; nothing is written then.
    """
    folder = Path(folder)
    header, path = campaign.header, folder / TABLE
    if campaign.reasons:
        header = campaign.with_header(excluded=campaign.exclusions).header
    columns = format_columns(campaign.holds, header)
    _campaign_of(columns, header, path, plausible)
    write_text(path, pd.DataFrame(columns).to_csv(index=False, lineterminator="\n"))
    write_yaml(folder / HEADER, header.model_dump(mode="json", exclude_none=True, by_alias=True))


def _campaign_of(columns: Table, header: Header, path: Path, plausible: bool) -> Campaign:
    """Check the columns of the table `path`, and make a campaign of them and the header."""
    campaign = Campaign(header, parse_holds(columns, header, path))
    if plausible:
        check_plausible(campaign, f"{path.with_name(HEADER)} and {path.name}")
    with locate_errors(path.with_name(HEADER)):
        return campaign.without_excluded()
