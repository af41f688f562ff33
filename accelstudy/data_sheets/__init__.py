"""Data sheets of sensors: noise, drift, temperature dependence and usual errors.

The YAML files next to this module are the sensors of the package; each value has its source. The
user's own files have the same form.
"""

from accelstudy.data_sheets.reading import (
    data_sheet_names,
    get_data_sheet,
    parse_data_sheet,
    read_data_sheet,
)
from accelstudy.data_sheets.sheet import QUANTITIES, DataSheet, sheet_of_sigma

__all__ = [
    "QUANTITIES",
    "DataSheet",
    "data_sheet_names",
    "get_data_sheet",
    "parse_data_sheet",
    "read_data_sheet",
    "sheet_of_sigma",
]
