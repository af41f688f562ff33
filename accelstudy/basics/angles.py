"""Differences of angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def wrapped(angle: ArrayLike) -> NDArray[np.float64]:
    """Return the angle in [−π, π) that points the same way, in rad; arrays of any shape."""
    return np.asarray((np.asarray(angle, dtype=float) + np.pi) % (2 * np.pi) - np.pi)
