"""Flight logs of PX4 (ULog): the forces and the temperature of one sensor_accel, in frd."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np

from accelstudy.basics.errors import InputError
from accelstudy.basics.progress import warn
from accelstudy.basics.wording import one_line
from accelstudy.campaign.importing.sources import ArraySource, chosen_of, needed_for
from accelstudy.files.reading import readable

_MESSAGE = "sensor_accel"
_COLUMNS = {**{f"f{axis}": f"{_MESSAGE}.{axis}" for axis in "xyz"}, "temperature": "temperature"}


def open_ulog(path: Path, instance: str | None = None) -> ArraySource:
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
    with needed_for(path, "a flight log of PX4", "pyulog", "px4"):
        from pyulog import ULog
    try:
        with readable(path), redirect_stdout(StringIO()):  # it prints what it thinks of a file
            log = ULog(str(path), [_MESSAGE])
    except InputError:
        raise
    except Exception as error:  # a damaged file fails in many ways
        raise InputError(f"{path}: not a whole flight log ({one_line(error)})") from None
    if log.file_corruption:
        warn(f"{path}: parts of the flight log are damaged and left out")
    sensors = {str(each.multi_id): each.data for each in log.data_list}
    values = sensors[chosen_of(path, f"instance of {_MESSAGE}", sensors, instance)]
    # Microseconds since the start of the controller; older logs have only the time of the message.
    time = values.get("timestamp_sample", values["timestamp"])
    time = time if np.any(time) else values["timestamp"]
    columns = {
        key: name for key, name in _COLUMNS.items() if name.removeprefix(f"{_MESSAGE}.") in values
    }
    forces = [values[name.removeprefix(f"{_MESSAGE}.")] for name in columns.values()]
    layout = {
        "columns": columns,
        "time": "time",
        "unit": "m/s^2",
        "time_unit": "s",
        "frame": "frd",
    }
    rows = np.column_stack([1e-6 * time, *forces]).astype(float)
    return ArraySource(path, rows, ["time", *columns.values()], layout)
