"""Files as robots record them, written with the libraries that read them."""

import struct

import numpy as np
from pyulog import ULog
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

IMU, TEMPERATURE = "sensor_msgs/msg/Imu", "sensor_msgs/msg/Temperature"
EPOCH = 1_700_000_000  # s


def write_bag(path, time, topics, temperature=None, frame="imu_link", stamped=True):
    """Write a bag, of ROS 1 if it ends in .bag.

    Parameters
    ----------
    topics : mapping of topic to forces (n, 3), m/s²
    temperature : mapping of topic to the last of n, °C, of which every tenth is written
    """
    first = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
    writer = Writer1(path) if first else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
    of = store.types
    stamp, header = of["builtin_interfaces/msg/Time"], of["std_msgs/msg/Header"]
    vector, turn = of["geometry_msgs/msg/Vector3"], of["geometry_msgs/msg/Quaternion"]
    unknown = np.zeros(9)
    serialize = store.serialize_ros1 if first else store.serialize_cdr
    messages = []
    with writer as bag:
        for kind, series, every in ((IMU, topics, 1), (TEMPERATURE, temperature or {}, 10)):
            for topic, values in series.items():
                connection = bag.add_connection(topic, kind, typestore=store)
                for t, value in list(zip(time[-len(values) :], values, strict=True))[::every]:
                    nanoseconds = round(t * 1e9)
                    seconds, rest = divmod(EPOCH * 10**9 + nanoseconds, 10**9)
                    at = stamp(seconds, rest) if stamped else stamp(0, 0)
                    head = header(seq=0, stamp=at, frame_id=frame) if first else header(at, frame)
                    if kind == IMU:
                        zero = vector(0.0, 0.0, 0.0)
                        rest_of = (turn(0.0, 0.0, 0.0, 1.0), unknown, zero, unknown)
                        message = of[kind](head, *rest_of, vector(*map(float, value)), unknown)
                    else:
                        message = of[kind](head, float(value), 0.0)
                    messages.append((EPOCH * 10**9 + nanoseconds, connection, kind, message))
        for received, connection, kind, message in sorted(messages, key=lambda each: each[0]):
            bag.write(connection, received, serialize(message, kind))


def message(kind, content):
    """A message of a flight log."""
    return struct.pack("<HB", len(content), ord(kind)) + content


def ulog(fields, count=1):
    """Begin a flight log: parts with the fields of sensor_accel and its instances."""
    parts = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0), message("B", bytes(40))]
    parts += [message("F", f"sensor_accel:{fields}".encode())]
    names = (struct.pack("<BH", i, i) + b"sensor_accel" for i in range(count))
    return [*parts, *(message("A", name) for name in names)]


def write_ulog(path, time, sensors, temperature):
    """Write a flight log with one sensor_accel for each of the forces (n, 3), m/s².

    The library writes only what it has read, so it gets a log without samples first.
    """
    fields = "uint64_t timestamp;uint64_t timestamp_sample;uint32_t device_id;"
    fields += "float x;float y;float z;float temperature;uint32_t error_count;"
    parts = ulog(fields, len(sensors))
    for i, forces in enumerate(sensors):
        for t, force, warm in zip(time, forces, temperature, strict=True):
            at = round(1e6 * t) + 5_000_000
            row = struct.pack("<HQQI4fI", i, at + 300, at, 7, *force, warm, 0)
            parts.append(message("D", row))
    path.write_bytes(b"".join(parts))
    log = ULog(str(path))
    log.write_ulog(str(path))
