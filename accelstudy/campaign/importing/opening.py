"""Files of numbers, opened by their endings and first bytes; a new format is registered here."""

from __future__ import annotations

from pathlib import Path

from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.recorded import BAG_OF_FOLDER, open_bag, open_ulog
from accelstudy.campaign.importing.sources import (
    GZIP,
    ParquetSource,
    Source,
    TextSource,
    open_matlab,
)
from accelstudy.files.reading import readable

_BAGS = (b"#ROSBAG V2.0", b"\x89MCAP0", b"SQLite format 3\0")
_ULOG = b"ULog\x01\x12\x35"


def open_source(path: str | Path, variable: str | None = None) -> Source:
    """Open a file of numbers, by its ending and its first bytes."""
    path = Path(path)
    if (path / BAG_OF_FOLDER).is_file():
        return open_bag(path, variable)
    with readable(path), path.open("rb") as file:
        start = file.read(128)
    if not start:
        raise InputError(f"{path}: the file is empty")
    if path.suffix.lower() in (".parquet", ".pq"):
        return ParquetSource(path)
    if start.startswith(GZIP):
        kind = Path(path.stem).suffix.lower()
        if kind in (".parquet", ".pq", ".mat"):
            raise InputError(f"{path}: unpack it first; only text is read from gzip")
        return TextSource(path)
    # An ASCII .mat has no zero bytes; every binary one has some in its header.
    if path.suffix.lower() == ".mat" and 0 in start:
        return open_matlab(path, variable)
    if start.startswith(_BAGS):
        return open_bag(path, variable)
    if start.startswith(_ULOG):
        return open_ulog(path, variable)
    if start.startswith(b"\x89HDF"):
        raise InputError(f"{path}: a MATLAB 7.3 (HDF5) file; save it with -v7")
    return TextSource(path)
