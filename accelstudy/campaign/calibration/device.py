"""What a device knows besides its readings, and where it uses a calibration."""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.applying import SensorCalibration
from accelstudy.effects import Course, HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE

Array = NDArray[np.float64]

KNOWN = {"temperature": "temperature_degC", "time": "time_s", "vibration": "vibration_mps2"}
"""Columns of `HoldConditions` that a device has, and the ranges of a calibration in them."""
USUAL = {
    "temperature": (REFERENCE_TEMPERATURE, REFERENCE_TEMPERATURE),
    "time": (0.0, 0.0),
    "vibration": (0.0, 0.0),
}
"""Ranges of a calibration that does not say its own."""
LEVELS = 5
"""Values of a condition that matters."""


def unknown(needs: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Effects that need a column that no device knows, of effects each with a column."""
    return [(effect, column) for effect, column in needs if column not in KNOWN]


def must_be_known(needs: Iterable[tuple[str, str]]) -> None:
    """Raise `InputError` if one of effects needs a column that no device knows."""
    for effect, column in unknown(needs):
        what = "position before" if column.startswith("step_") else column
        raise InputError(
            f"{effect} depends on the {what}, which no device knows; calibrate without it"
        )


def in_use(
    calibration: SensorCalibration, forces: Array, columns: Collection[str], margin: float = 0.0
) -> tuple[Array, HoldConditions]:
    """Combine forces with conditions, spread over the ranges of a calibration.

    The temperature is settled: what lags behind it is as warm.

    Parameters
    ----------
    calibration : SensorCalibration
    forces : (n, 3) array, m/s²
    columns : names of what varies
    margin : float, part of the width by which a range is left on either side

    Returns
    -------
    forces, hold
        (n k, 3) array, each force with each of k conditions, and these.
    """
    levels = []
    for column, name in KNOWN.items():
        low, high = calibration.ranges.get(name, USUAL[column])
        more = margin * (high - low)
        least = -np.inf if column == "temperature" else 0.0
        count = LEVELS if high > low and column in columns else 1
        levels.append(np.linspace(max(low - more, least), high + more, count))
    grid = np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1).reshape(-1, len(levels))
    each = np.repeat(grid, len(forces), axis=0).T
    still = np.zeros(each.shape[1])
    return np.tile(forces, (len(grid), 1)), HoldConditions(
        **dict(zip(KNOWN, each, strict=True)),
        step_x=still,
        step_y=still,
        step_z=still,
        course=Course(np.zeros(1), np.full(1, REFERENCE_TEMPERATURE)),
    )
