"""Raw tables of files and of memory, told apart by endings and first bytes."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.importing import bags
from accelstudy.campaign.importing.columns import AXES
from accelstudy.campaign.importing.raw_table import RawTable, choose, unless_damaged
from accelstudy.campaign.importing.text import GZIP, TextTable
from accelstudy.files.reading import readable
from accelstudy.files.tables import open_parquet

_CONTROLS = re.compile(rb"[\x01-\x08\x0e-\x1a\x1c-\x1f]")
"""Bytes that no text has, in UTF-16 either."""
_IS_NUMBER = re.compile("double|single|u?int[0-9]+")
"""Classes of MATLAB arrays."""
_NO_TABLE = re.compile(rb"BZh|%PDF|(\xef\xbb\xbf)?\s*[\[{]\s*[\[{\"}]")
"""What files begin with that look like text: an archive, a document, JSON."""


def read_table(path: Path, variable: str | None = None) -> RawTable:
    """Read a file of numbers; a new format is one line here.

    Parameters
    ----------
    path : file; a pipe is none, since a log is read more than once
    variable : str, which array of a MATLAB file, topic of a bag or sensor of a flight log
    """
    with readable(path):
        if (path / bags.BAG_OF_FOLDER).is_file():
            return bags.read_bag(path, variable)
        if not (path.is_file() or path.is_dir()) and path.stat():
            raise InputError(
                f"{path}: a pipe or a device, and a log is read more than once; save it in a file"
            )
        with path.open("rb") as file:
            start = file.read(128)
    if not start:
        raise InputError(f"{path}: the file is empty")
    if path.suffix.lower() in (".parquet", ".pq"):
        with open_parquet(path) as parquet:
            return RawTable(path, parquet.read())
    # An ASCII .mat has no zero bytes; every binary one has some in its header.
    if path.suffix.lower() == ".mat" and 0 in start:
        return _read_matlab(path, variable)
    if start.startswith(bags.BAGS):
        return bags.read_bag(path, variable)
    if start.startswith(bags.ULOG):
        return bags.read_ulog(path, variable)
    if not start.startswith(GZIP) and (_NO_TABLE.match(start) or _CONTROLS.search(start)):
        raise InputError(
            f"{path}: no text, MATLAB file up to version 7, Parquet, bag or ULog; unpack an "
            "archive, and save a workbook or JSON as CSV, with a row for each sample"
        )
    return TextTable.read(path)


def _read_matlab(path: Path, variable: str | None) -> RawTable:
    """Read an array of a MATLAB file, which the format holds to 2 GB."""
    from scipy.io import loadmat, whosmat

    with unless_damaged(path, "MATLAB file"):
        try:
            kinds = whosmat(path)
        except NotImplementedError:
            raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7") from None
        arrays = [
            name
            for name, shape, kind in kinds
            if _IS_NUMBER.fullmatch(kind) and len(shape) == 2 and min(shape) >= len(AXES)
        ]
        name = choose(path, "array of 3 columns or more", arrays, variable)
        array = loadmat(path, variable_names=[name])[name]
    if np.iscomplexobj(array):
        raise InputError(f"{path}: array {name} has complex numbers")
    # An array with few rows and many columns has the samples in its columns.
    columns = array if array.shape[0] < array.shape[1] else array.T
    return RawTable(path, pa.table({str(i): c for i, c in enumerate(columns)}), named=False)


def table_in_memory(frame: pd.DataFrame) -> RawTable:
    """Raw table of a DataFrame; an index of dates or durations becomes its last column."""
    frame = frame.copy()  # what its owner changes later is not of this log
    columns, index, name = frame.rename(columns=str), frame.index, str(frame.index.name or "time")
    layout = {}
    if isinstance(index, pd.DatetimeIndex | pd.TimedeltaIndex) and name not in columns:
        columns, layout = columns.assign(**{name: index}), {"time": name}
    durations = columns.select_dtypes("timedelta")
    columns = columns.assign(**{str(key): one.dt.total_seconds() for key, one in durations.items()})
    # A word between numbers, as files may have, too.
    mixed = [name for name, kind in columns.dtypes.items() if pd.api.types.is_object_dtype(kind)]
    columns = columns.astype(dict.fromkeys(mixed, str))
    try:
        content = pa.Table.from_pandas(columns, preserve_index=False)
    except (TypeError, ValueError, NotImplementedError) as error:
        why = one_line(error.args[-1])
        raise InputError(f"log: the DataFrame cannot be a log, which has numbers: {why}") from None
    return RawTable(Path("DataFrame"), content, layout, frame=frame)
