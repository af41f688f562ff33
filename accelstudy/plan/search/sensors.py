"""The sensor of a plan, from whatever the user has of it."""

from __future__ import annotations

from pathlib import Path

from accelstudy.basics.errors import InputError
from accelstudy.data_sheets import DataSheet, get_data_sheet, read_data_sheet

LOGS = (".csv", ".txt", ".gz", ".mat", ".parquet", ".log", ".dat")


def get_sensor(text: str) -> DataSheet:
    """Return a sensor by its name, from a YAML file, or from the folder of a campaign.

    Raises
    ------
    InputError
        If there is no such sensor; for a log the message says how to make a data sheet of it.
    """
    path = Path(text)
    if path.is_dir():
        from accelstudy.data_sheets.measured import sheet_of_campaign

        return sheet_of_campaign(path)
    if path.suffix in LOGS:
        raise InputError(
            f"{text}: a log, not a data sheet; make one of it: accelstudy data-sheet {text} --out "
            f"{path.stem}.yaml, with the options by which import reads it"
        )
    return read_data_sheet(path) if path.is_file() else get_data_sheet(text)
