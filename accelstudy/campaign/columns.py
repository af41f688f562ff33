"""The columns of the holds of a campaign: one list by which they are read, checked and written."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics import bounds
from accelstudy.basics.bounds import Range
from accelstudy.basics.errors import InputError, check_name

MAX_CELL = 1e12
"""Larger than any measured value in any unit; squares and cubes of smaller ones stay finite."""
ANY = Range(-MAX_CELL, MAX_CELL)


class Columns(NamedTuple):
    """Columns of the holds that belong together: all of them are there, or none.

    Attributes
    ----------
    names : tuple of str, in `Campaign.holds`
    suffix : str, what their names end with in the file
    unit : str, in the file; "unit" is the unit of the header
    within : Range, in that unit
    meaning : str
    whole : bool, whether they are whole numbers
    needed : bool
    """

    names: tuple[str, ...]
    suffix: str
    unit: str
    within: Range
    meaning: str
    whole: bool = False
    needed: bool = False

    @property
    def keys(self) -> tuple[str, ...]:
        """Names in the file."""
        return tuple(f"{name}{self.suffix}" for name in self.names)

    @property
    def si(self) -> str:
        """Unit in `Campaign.holds`."""
        return {"gon": "rad", "unit": "m/s²"}.get(self.unit, self.unit)

    def array(self, holds: pd.DataFrame) -> NDArray[Any]:
        """Values (n, k) in a table of holds; to cut out a part of it takes several times longer."""
        return np.column_stack([holds[name].to_numpy() for name in self.names])


_COUNT = Range(1, 2**53)  # beyond which not every integer is a float
COLUMNS = {
    "positions": Columns(("position",), "", "", _COUNT,
        "number of the hold, from 1 on, in the order of acquisition", whole=True, needed=True),
    "time": Columns(("time",), "_s", "s", bounds.TIME,
        "middle of the hold since the start of the session"),
    "forces": Columns(("fx", "fy", "fz"), "", "unit", ANY,
        "mean specific force of the hold, in sensor axes", needed=True),
    "n_samples": Columns(("n_samples",), "", "", _COUNT, "samples in the hold", whole=True),
    "sd": Columns(("sd_fx", "sd_fy", "sd_fz"), "", "unit", Range(0.0, MAX_CELL),
        "standard deviations of the samples within the hold"),
    "temperature": Columns(("temperature",), "_degC", "°C", bounds.TEMPERATURE,
        "mean temperature"),
    "angles": Columns(("roll", "pitch"), "_robot_gon", "gon", bounds.ANGLE,
        "attitude that the robot tells, or a reference"),
    "yaw": Columns(("yaw",), "_robot_gon", "gon", bounds.ANGLE,
        "yaw that the robot tells; 0 if absent"),
    "vibration": Columns(("vibration",), "_mps2", "m/s²", bounds.VIBRATION,
        "rms of the vibration"),
}  # fmt: skip
"""Columns by the attribute of a campaign that they make up."""
KEYS = tuple(key for columns in COLUMNS.values() for key in columns.keys)


def table_of(arrays: Mapping[str, Any]) -> pd.DataFrame:
    """Table of holds, all of them used, of arrays in SI by attribute; None is no column.

    Without positions the holds are numbered from 1 on. Errors as of `split`.
    """
    for name in arrays:
        check_name("array of a campaign", name, COLUMNS)
    if arrays.get("forces") is None:
        raise InputError("forces: missing; a campaign has one of each position")
    n = len(arrays["forces"])
    given = {name: arrays[name] for name in COLUMNS if arrays.get(name) is not None}
    positions = given.pop("positions", np.arange(1, n + 1))
    holds: dict[str, Any] = {}
    for attribute, values in given.items():
        holds |= split(attribute, values, n)
    return pd.DataFrame({**holds, "left_out": [""] * n}, pd.Index(positions, name="position"))


def split(attribute: str, values: Any, n: int) -> dict[str, NDArray[Any]]:
    """Columns of an array by their names.

    Raises
    ------
    InputError
        If the array has another shape than (n,), or (n, k) for k columns.
    """
    names = COLUMNS[attribute].names
    shape = (n, len(names)) if len(names) > 1 else (n,)
    if np.shape(values) != shape:
        raise InputError(f"{attribute}: shape {np.shape(values)}, not {shape}")
    return dict(zip(names, np.reshape(values, (n, len(names))).T, strict=True))
