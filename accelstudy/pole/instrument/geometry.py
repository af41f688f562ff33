"""Position of the foot of a pole: the one definition from which all derivatives are traced.

Positions are north, east, down. The pole's own axes are forward, right and down along the pole. Its
attitude is yaw, pitch and roll, as everywhere in the project; upright all three are zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.effects.components import Number, Vector

Array = NDArray[np.float64]

INPUTS = (
    "top_north",
    "top_east",
    "top_down",
    "roll",
    "pitch",
    "yaw",
    "length",
    "offset_forward",
    "offset_right",
    "mounting_forward",
    "mounting_right",
    "bend_forward",
    "bend_right",
)
"""Arguments of `foot`, in order.

The top is the centre of the antenna or prism, m, and the offset is its distance from the pole's
axis. The mounting angles turn the pole against the leveled axes, about forward and about right,
rad. Bending moves the foot away from the straight line that leveling assumes, m.
"""


def foot(inputs: Sequence[Number], xp: Any = np) -> Vector:
    """North, east and down of the foot, m, as a function of the `INPUTS`."""
    (north, east, down, roll, pitch, yaw, length, offset_forward, offset_right,
     mounting_forward, mounting_right, bend_forward, bend_right) = inputs  # fmt: skip
    arm = (bend_forward - offset_forward, bend_right - offset_right, length)
    arm = _about_right(_about_forward(arm, mounting_forward, xp), mounting_right, xp)
    arm = _about_down(_about_right(_about_forward(arm, roll, xp), pitch, xp), yaw, xp)
    return north + arm[0], east + arm[1], down + arm[2]


def _about_forward(v: Vector, angle: Number, xp: Any) -> Vector:
    c, s = xp.cos(angle), xp.sin(angle)
    return v[0], c * v[1] - s * v[2], s * v[1] + c * v[2]


def _about_right(v: Vector, angle: Number, xp: Any) -> Vector:
    c, s = xp.cos(angle), xp.sin(angle)
    return c * v[0] + s * v[2], v[1], c * v[2] - s * v[0]


def _about_down(v: Vector, angle: Number, xp: Any) -> Vector:
    c, s = xp.cos(angle), xp.sin(angle)
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@cache
def _jacobian_function() -> Any:
    from accelstudy.symbolic.tracing import jacobian_of

    return jacobian_of(foot, len(INPUTS))


def jacobian(inputs: ArrayLike) -> Array:
    """Partial derivatives of the foot with respect to all inputs.

    Parameters
    ----------
    inputs : (..., 13) array, in the order of `INPUTS`

    Returns
    -------
    (..., 3, 13) array, m per unit of the input
    """
    return np.asarray(_jacobian_function()(np.asarray(inputs, dtype=float)))


def leaning(tilt: ArrayLike, direction: ArrayLike, g: float = STANDARD_GRAVITY) -> Array:
    """Specific force in the pole's axes when it leans.

    Parameters
    ----------
    tilt : (...) array, rad, angle between the pole and the vertical
    direction : (...) array, rad, in which the top leans, from forward towards right
    g : float, m/s²

    Returns
    -------
    (..., 3) array, m/s²
    """
    tilt, direction = np.broadcast_arrays(
        np.asarray(tilt, dtype=float), np.asarray(direction, dtype=float)
    )
    down = (np.sin(tilt) * np.cos(direction), np.sin(tilt) * np.sin(direction), np.cos(tilt))
    return -g * np.stack(down, axis=-1)
