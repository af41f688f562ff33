"""The attitudes from which the next position is chosen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.errors import InputError, UnknownNameError
from accelstudy.basics.units import GON
from accelstudy.design.optimal.constraints import (
    Constraint,
    Constraints,
    OffPole,
    PitchRange,
    RollRange,
)
from accelstudy.design.optimal.spaces import by_eye, cube, listed_in

Array = NDArray[np.float64]

STEP = 25 * GON
"""Step of roll and pitch in the grid."""
SETS = {"cube": "faces, edges and corners of a cube", "grid": "roll and pitch in steps of 25 gon"}
DEFAULTS = {"gravity": "cube", "robot": "grid"}
"""Default set of attitudes of an approach: a block on a table, a grid for a robot."""
SAME = 5 * GON
"""A position within this angle of another counts as the same attitude."""


def candidates(
    name: str,
    pole_distance: float | None = None,
    max_roll: float | None = None,
    max_pitch: float | None = None,
) -> Array:
    """Directions of gravity in the body frame, (k, 3), of the attitudes to choose from.

    Parameters
    ----------
    name : str
        One of `SETS`, or the path of a CSV file with the columns x, y, z or roll and pitch.
    pole_distance : float, rad, optional, least angle between the x axis and the vertical
    max_roll, max_pitch : float, rad, optional, largest roll and pitch either way

    Raises
    ------
    InputError
        If there is no such set, the file cannot be read, or nothing is left.
    """
    if name == "cube":
        directions = cube().directions(0)
    elif name == "grid":
        directions = by_eye(STEP).directions(0)
    elif name.endswith(".csv"):
        directions = listed_in(Path(name)).directions(0)
    else:
        raise UnknownNameError("set of attitudes", name, (*SETS, "FILE.csv"))
    limits: list[Constraint] = []
    if pole_distance is not None:
        limits.append(OffPole(pole_distance))
    if max_roll is not None:
        limits.append(RollRange(-max_roll, max_roll))
    if max_pitch is not None:
        limits.append(PitchRange(-max_pitch, max_pitch))
    left = Constraints(tuple(limits)).keep(directions)
    if not len(left):
        raise InputError(f"attitudes: none of {name} is within the limits that are given")
    # Simple attitudes first: with vertical axes, then with horizontal ones.
    axes = np.count_nonzero(np.abs(left) > 1e-9, axis=1)
    return left[np.argsort(axes, kind="stable")]


def apart_from(directions: Array, last: Array) -> NDArray[np.bool_]:
    """Which of directions (k, 3) differ from the last ones (R, 3), (R, k).

    To repeat an attitude at once would repeat its errors too.
    """
    return np.asarray(last @ directions.T < np.cos(SAME))
