"""The sensor of a plan, by whatever a person has of it."""

from __future__ import annotations

from pathlib import Path

from accelstudy.data_sheets import DataSheet, get_data_sheet


def get_sensor(text: str) -> DataSheet:
    """Return a sensor by name, or from a YAML file."""
    if Path(text).is_file():
        from accelstudy.data_sheets import read_data_sheet

        return read_data_sheet(text)
    return get_data_sheet(text)
