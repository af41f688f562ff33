"""Recordings of robots: bags of ROS 1 and 2, and flight logs of PX4 (ULog).

Their libraries are extras, so they are imported where a file needs them. A recording of one sensor
is held in memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from io import BufferedReader, FileIO, StringIO
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from accelstudy.basics.arrays import Array
from accelstudy.basics.errors import InputError
from accelstudy.campaign.importing.raw_table import RawTable, choose, unless_damaged

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection


BAGS = (b"#ROSBAG V2.0", b"\x89MCAP0", b"SQLite format 3\0")
ULOG = b"ULog\x01\x12\x35"
"""First bytes of bags, and of a flight log."""
BAG_OF_FOLDER = "metadata.yaml"
"""File by which a folder is a bag of ROS 2."""

_IMU, _TEMPERATURE = "sensor_msgs/msg/Imu", "sensor_msgs/msg/Temperature"
_BAG_COLUMNS = {f"f{axis}": f"linear_acceleration.{axis}" for axis in "xyz"}
_SENSOR = "sensor_accel"
_LONGEST_GAP = 3600.0  # s
_THERMAL_TIME = 10.0
"""Seconds in which a temperature hardly changes; before and after a thermometer it is unknown."""
_FIELDS = {"fx": "x", "fy": "y", "fz": "z", "temperature": "temperature"}


def read_bag(path: Path, topic: str | None = None) -> RawTable:
    """Read the forces of a bag; their frame is flu, or frd where its name ends in _ned (REP 103).

    Parameters
    ----------
    path : .bag of ROS 1, folder of ROS 2, or the .db3 or .mcap in such a folder
    topic : str, which one, if there are several of sensor_msgs/Imu

    Raises
    ------
    InputError
        If the library is not installed, or there is no such topic, or several.
    """
    with _needed_for(path, "a bag of ROS", "rosbags", "ros"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    folder = path
    if path.suffix in (".db3", ".mcap"):
        folder = path.parent
        if not (folder / BAG_OF_FOLDER).is_file():
            raise InputError(f"{path}: a bag of ROS 2 is a folder; {BAG_OF_FOLDER} is missing here")
    store = get_typestore(Stores.ROS2_HUMBLE)
    with unless_damaged(path, "bag"), AnyReader([folder], default_typestore=store) as reader:
        topics = {c.topic: c for c in reader.connections if c.msgtype == _IMU}
        name = choose(path, "topic of sensor_msgs/Imu", topics, topic)
        imu = [c for c in reader.connections if c.topic == name]
        frame = next((message.header.frame_id for _, message in _messages(reader, imu)), "")
        rows = _rows(reader, imu, 4, attrgetter(*_BAG_COLUMNS.values()))
        expected = sum(connection.msgcount for connection in imu)
        thermometer = _thermometer(reader, name)
        temperatures = _rows(reader, thermometer, 2, lambda m: (m.temperature,))
    notes, warnings = [], []
    if len(rows) < expected:
        end = rows[-1, 0] - rows[0, 0] if len(rows) else 0.0
        warnings.append(
            f"the bag ends early or is damaged: {len(rows)} of {expected} messages of {name} are "
            f"there, up to {end:.1f} s"
        )
    columns = dict(_BAG_COLUMNS)
    if len(temperatures):
        time, (first, last) = rows[:, 0], temperatures[[0, -1], 0]
        warm = np.interp(time, *temperatures.T)
        warm[(time < first - _THERMAL_TIME) | (time > last + _THERMAL_TIME)] = np.nan
        rows = np.column_stack([rows, warm])
        columns["temperature"] = "temperature"
        notes.append(f"temperature: topic {thermometer[0].topic}")
    frame = "frd" if frame.endswith("_ned") else "flu"
    return _table(path, rows, columns, frame, warnings, notes)


def _table(
    path: Path,
    rows: Array,
    columns: Mapping[str, str],
    frame: str,
    warnings: Sequence[str],
    notes: Sequence[str] = (),
) -> RawTable:
    """Times, s, forces, m/s², and perhaps temperatures as a table."""
    units = {"unit": "m/s^2", "time_unit": "s"}
    layout = {"columns": columns, "time": "time", "frame": frame, **units}
    content = dict(zip(("time", *columns.values()), rows.T, strict=True))
    return RawTable(path, pa.table(content), layout, notes, warnings)


def _messages(reader: AnyReader, connections: Sequence[Connection]) -> Iterator[tuple[float, Any]]:
    """Messages with their times, s: their stamps, or when they were recorded if these are empty."""
    for connection, received, raw in reader.messages(connections) if connections else ():
        message: Any = reader.deserialize(raw, connection.msgtype)
        stamp = message.header.stamp
        yield 1e-9 * (stamp.sec * 10**9 + stamp.nanosec or received), message


def _rows(
    reader: AnyReader,
    connections: Sequence[Connection],
    width: int,
    values: Callable[[Any], tuple[float, ...]],
) -> Array:
    """Times, s, and values of messages, (n, width), up to where a bag is damaged."""
    rows: list[tuple[float, ...]] = []
    try:
        for time, message in _messages(reader, connections):
            rows.append((time, *values(message)))
    except Exception:
        if not rows:
            raise
    return np.array(rows, dtype=float).reshape(-1, width)


def _thermometer(reader: AnyReader, topic: str) -> list[Connection]:
    """The only topic of a temperature, or the only one beside the topic of the forces."""
    every = [c for c in reader.connections if c.msgtype == _TEMPERATURE]
    siblings = [c for c in every if c.topic.rpartition("/")[0] == topic.rpartition("/")[0]]
    return next((some for some in (every, siblings) if len({c.topic for c in some}) == 1), [])


def read_ulog(path: Path, instance: str | None = None) -> RawTable:
    """Read the forces of a flight log.

    Parameters
    ----------
    path : file
    instance : str, which one, as "0", if several sensors were logged

    Raises
    ------
    InputError
        If the library is not installed, or there is no such sensor, or several.
    """
    with _needed_for(path, "a flight log of PX4", "pyulog", "px4"):
        from pyulog import ULog

    # It prints what it thinks of a file.
    with (
        unless_damaged(path, "flight log"),
        _TruncationCheck(FileIO(path)) as file,
        redirect_stdout(StringIO()),
    ):
        log = ULog(file, [_SENSOR])
    sensors = {str(each.multi_id): each.data for each in log.data_list}
    if not sensors:
        raise InputError(
            f"{path}: no messages of {_SENSOR}, the raw readings; let PX4 log them "
            "(SDLOG_PROFILE 64)"
        )
    values = sensors[choose(path, f"instance of {_SENSOR}", sensors, instance)]
    if missing := {"timestamp", *"xyz"} - values.keys():
        raise InputError(f"{path}: {_SENSOR} has no field {min(missing)!r}; it cannot be read")
    # Microseconds since the start of the controller; older logs have only the time of the message.
    time = values.get("timestamp_sample", values["timestamp"])
    time = time if np.any(time) else values["timestamp"]
    fields = {key: field for key, field in _FIELDS.items() if field in values}
    columns = {key: f"{_SENSOR}.{field}" for key, field in fields.items()}
    with np.errstate(invalid="ignore"):  # of damaged numbers
        rows = np.column_stack([1e-6 * time, *(values[field] for field in fields.values())])
    warnings = []
    if log.file_corruption or file.cut:
        steps = np.diff(rows[:, 0])
        odd = np.flatnonzero(~((steps > 0) & (steps < _LONGEST_GAP)))
        rows = rows[: odd[0] + 1] if len(odd) else rows
        gaps = np.flatnonzero(steps > 5 * np.median(steps)) if len(steps) else odd
        whole = rows[min([len(rows) - 1, *gaps]), 0] - rows[0, 0]
        warnings.append(
            f"the flight log ends early or is damaged: its samples are whole up to {whole:.1f} s, "
            f"and end at {rows[-1, 0] - rows[0, 0]:.1f} s"
        )
    return _table(path, rows, columns, "frd", warnings)


class _TruncationCheck(BufferedReader):
    """A file that knows whether its end cut off what was read.

    Attributes
    ----------
    cut : bool
    """

    cut = False

    def read(self, size: int | None = -1) -> bytes:
        """Read so many bytes, as a header of 3 bytes and what belongs to it are read."""
        content = super().read(size) or b""
        # Between two messages it may end.
        self.cut |= size is not None and len(content) < size and not (size == 3 and not content)
        return content


@contextmanager
def _needed_for(path: Path, what: str, library: str, extra: str) -> Iterator[None]:
    """Import what reads a format; if it is missing, say what to install."""
    try:
        yield
    except ImportError:
        raise InputError(
            f"{path}: {what} is read by the library {library}, which is not installed; "
            f"pip install 'accelstudy[{extra}]'"
        ) from None
