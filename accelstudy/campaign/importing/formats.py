"""Files of numbers, opened by their endings and first bytes; a new format is registered here."""

from __future__ import annotations

import re
from pathlib import Path

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.bags import BAG_OF_FOLDER, open_bag, open_ulog
from accelstudy.campaign.importing.sources import LogFile, Source, open_matlab, open_parquet
from accelstudy.campaign.importing.text import GZIP, TextSource
from accelstudy.files.reading import readable

_BAGS = (b"#ROSBAG V2.0", b"\x89MCAP0", b"SQLite format 3\0")
_ULOG = b"ULog\x01\x12\x35"
_OTHERS = {
    b"PK\x03\x04": "a zip archive; unpack it first",
    b"\xd0\xcf\x11\xe0": "an Excel workbook; save its sheet as CSV",
    b"\x89HDF": "a MATLAB 7.3 (HDF5) file; save it with -v7",
    b"BZh": "packed by bzip2; unpack it first",
    b"\xfd7zXZ": "packed by xz; unpack it first",
    b"7z\xbc\xaf": "a 7-Zip archive; unpack it first",
    b"Rar!": "a RAR archive; unpack it first",
    b"\x28\xb5\x2f\xfd": "packed by zstd; unpack it first",
    b"%PDF": "a PDF; a log is text, MATLAB, Parquet, a bag or a ULog",
}
"""What files begin with that are no logs, and what they are."""
_JSON = re.compile(rb"(\xef\xbb\xbf)?\s*(\{\s*[\"}]|\[\s*[\[{\"])")


def open_source(path: LogFile, variable: str | None = None, delimiter: str | None = None) -> Source:
    """Open a file of numbers, by its ending and its first bytes.

    Parameters
    ----------
    path : file, or a table in memory, which is a source already; a pipe is none, since a log is
        read more than once
    variable : str, which array of a MATLAB file, topic of a bag or sensor of a flight log
    delimiter : str, between the columns of a text, see `LogLayout`
    """
    if isinstance(path, Source):
        return path
    path = Path(path)
    with readable(path):
        if (path / BAG_OF_FOLDER).is_file():
            return open_bag(path, variable)
        if not (path.is_file() or path.is_dir()) and path.stat():
            raise InputError(
                f"{path}: a pipe or a device, and a log is read more than once; save it in a file"
            )
        with path.open("rb") as file:
            start = file.read(128)
    if not start:
        raise InputError(f"{path}: the file is empty")
    if path.suffix.lower() in (".parquet", ".pq"):
        return open_parquet(path)
    if start.startswith(GZIP):
        kind = Path(path.stem).suffix.lower()
        if kind in (".parquet", ".pq", ".mat"):
            raise InputError(f"{path}: unpack it first; only text is read from gzip")
        return TextSource(path, delimiter)
    # An ASCII .mat has no zero bytes; every binary one has some in its header.
    if path.suffix.lower() == ".mat" and 0 in start:
        return open_matlab(path, variable)
    if start.startswith(_BAGS):
        return open_bag(path, variable)
    if start.startswith(_ULOG):
        return open_ulog(path, variable)
    for first, what in _OTHERS.items():
        if start.startswith(first):
            office = any(part in start for part in (b"[Content_Types]", b"docProps/", b"xl/"))
            if first == b"PK\x03\x04" and (office or path.suffix.lower() == ".xlsx"):
                what = "an Excel workbook; save its sheet as CSV"
            raise InputError(f"{path}: {what}")
    if _JSON.match(start):
        raise InputError(f"{path}: JSON; save it as CSV, with a row for each sample")
    return TextSource(path, delimiter)
