"""Files of numbers, opened by their endings and first bytes; a new format is one line here."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pyarrow as pa

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.importing import bags
from accelstudy.campaign.importing.sources import LogFile, Source, chosen_of
from accelstudy.campaign.importing.text import GZIP, read_text
from accelstudy.files.reading import readable
from accelstudy.files.tables import open_parquet

_CONTROLS = re.compile(rb"[\x01-\x08\x0e-\x1a\x1c-\x1f]")
"""Bytes that no text has, in UTF-16 either."""
_IS_NUMBER = re.compile("double|single|u?int[0-9]+")
"""Classes of MATLAB arrays."""
_NO_TABLE = re.compile(rb"BZh|%PDF|(\xef\xbb\xbf)?\s*[\[{]\s*[\[{\"}]")
"""What files begin with that look like text: an archive, a document, JSON."""


def open_source(path: LogFile, variable: str | None = None) -> Source:
    """Open a file of numbers, by its ending and its first bytes; a new format is one line here.

    Parameters
    ----------
    path : file, or a table in memory, which is a source already; a pipe is none, since a log is
        read more than once
    variable : str, which array of a MATLAB file, topic of a bag or sensor of a flight log
    """
    if isinstance(path, Source):
        return path
    path = Path(path)
    with readable(path):
        if (path / bags.BAG_OF_FOLDER).is_file():
            return bags.open_bag(path, variable)
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
            return Source(path, parquet.read())
    # An ASCII .mat has no zero bytes; every binary one has some in its header.
    if path.suffix.lower() == ".mat" and 0 in start:
        return _open_matlab(path, variable)
    if start.startswith(bags.BAGS):
        return bags.open_bag(path, variable)
    if start.startswith(bags.ULOG):
        return bags.open_ulog(path, variable)
    if not start.startswith(GZIP) and (_NO_TABLE.match(start) or _CONTROLS.search(start)):
        raise InputError(
            f"{path}: no text, MATLAB file up to version 7, Parquet, bag or ULog; unpack an "
            "archive, and save a workbook or JSON as CSV, with a row for each sample"
        )
    return read_text(path)


def _open_matlab(path: Path, variable: str | None) -> Source:
    """Open a MATLAB file; it is read as a whole, since the format allows 2 GB at most."""
    from scipy.io import loadmat, whosmat

    try:
        with readable(path):
            arrays = {
                name: shape
                for name, shape, kind in whosmat(path)
                if _IS_NUMBER.fullmatch(kind) and len(shape) == 2 and all(shape)
            }
            name = chosen_of(path, "array", arrays, variable)
            array = loadmat(path, variable_names=[name])[name]
    except InputError:
        raise
    except NotImplementedError:
        raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7") from None
    except Exception as error:  # SciPy's reader fails in many ways on a damaged file
        raise InputError(f"{path}: not a whole MATLAB file ({one_line(error)})") from None
    if np.iscomplexobj(array):
        raise InputError(f"{path}: array {name} has complex numbers")
    # An array with few rows and many columns has the samples in its columns.
    columns = array if array.shape[0] < array.shape[1] else array.T
    return Source(path, pa.table({str(i): c for i, c in enumerate(columns)}), named=False)
