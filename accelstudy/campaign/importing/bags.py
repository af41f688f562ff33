"""Bags of ROS 1 and 2: the forces of one topic of sensor_msgs/Imu, and a temperature."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.basics.wording import one_line
from accelstudy.campaign.importing.sources import BAG_OF_FOLDER, ArraySource, chosen_of, needed_for
from accelstudy.files.reading import readable

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

Array = NDArray[np.float64]

_IMU, _TEMPERATURE = "sensor_msgs/msg/Imu", "sensor_msgs/msg/Temperature"
_AXES = {f"f{axis}": f"linear_acceleration.{axis}" for axis in "xyz"}


def open_bag(path: Path, topic: str | None = None) -> ArraySource:
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
    with needed_for(path, "a bag of ROS", "rosbags", "ros"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    within = path.parent if path.suffix in (".db3", ".mcap") else path
    if path.suffix in (".db3", ".mcap") and not (within / BAG_OF_FOLDER).is_file():
        raise InputError(f"{path}: a bag of ROS 2 is a folder; {BAG_OF_FOLDER} is missing here")
    try:
        with (
            readable(path),
            AnyReader([within], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader,
        ):
            topics = {c.topic: c for c in reader.connections if c.msgtype == _IMU}
            name = chosen_of(path, "topic of sensor_msgs/Imu", topics, topic)
            rows, frame = _imu(reader, [c for c in reader.connections if c.topic == name])
            thermometer = _thermometer(reader, name)
            measured = _temperatures(reader, thermometer) if thermometer else np.empty((0, 2))
    except InputError:
        raise
    except Exception as error:  # a damaged file fails in many ways
        raise InputError(f"{path}: not a whole bag ({one_line(error)})") from None
    columns = dict(_AXES)
    if len(measured):
        rows = np.column_stack([rows, np.interp(rows[:, 0], *measured.T)])
        columns["temperature"] = "temperature"
    layout = {
        "columns": columns,
        "time": "time",
        "unit": "m/s^2",
        "time_unit": "s",
        "frame": "frd" if frame.endswith("_ned") else "flu",
    }
    return ArraySource(path, rows, ["time", *columns.values()], layout)


def _imu(reader: AnyReader, connections: Sequence[Connection]) -> tuple[Array, str]:
    """Times, s, and forces, m/s², (n, 4); and the name of their frame."""
    rows, frame = [], ""
    for connection, received, raw in reader.messages(connections):
        message: Any = reader.deserialize(raw, connection.msgtype)
        force, frame = message.linear_acceleration, message.header.frame_id
        rows.append((_seconds(message, received), force.x, force.y, force.z))
    return np.array(rows, dtype=float).reshape(-1, 4), frame


def _thermometer(reader: AnyReader, topic: str) -> Connection | None:
    """The only topic of a temperature, or the only one beside the topic of the forces."""
    found = [c for c in reader.connections if c.msgtype == _TEMPERATURE]
    beside = [c for c in found if c.topic.rpartition("/")[0] == topic.rpartition("/")[0]]
    return next((c[0] for c in (found, beside) if len(c) == 1), None)


def _temperatures(reader: AnyReader, connection: Connection) -> Array:
    """Times, s, and temperatures, °C, (n, 2)."""
    rows = []
    for _, received, raw in reader.messages([connection]):
        message: Any = reader.deserialize(raw, connection.msgtype)
        rows.append((_seconds(message, received), message.temperature))
    return np.array(rows, dtype=float).reshape(-1, 2)


def _seconds(message: Any, received: int) -> float:
    """Time of a message; that at which it was recorded, in ns, if its stamp is empty."""
    stamp = message.header.stamp
    return stamp.sec + 1e-9 * stamp.nanosec if stamp.sec or stamp.nanosec else 1e-9 * received
