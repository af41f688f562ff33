"""What a sensor is, as its data sheet says: noise, drift, temperature, and its usual errors.

The files beside this module are sensors that come along, each value with its source. A file of a
user's own has the same form.
"""

from accelstudy.data_sheets.reading import (
    data_sheet_names,
    get_data_sheet,
    parse_data_sheet,
    read_data_sheet,
)
from accelstudy.data_sheets.sheet import QUANTITIES, DataSheet, of_sigma

__all__ = [
    "QUANTITIES",
    "DataSheet",
    "data_sheet_names",
    "get_data_sheet",
    "of_sigma",
    "parse_data_sheet",
    "read_data_sheet",
]
