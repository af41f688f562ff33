"""The sphere on which the readings of a sensor at rest lie, apart from its smaller errors."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def fit_sphere(forces: Array) -> tuple[Array, float] | None:
    """Centre (3,) and radius of the sphere that fits points (n, 3) best; None if there is none.

    |f − c|² = r² is linear in c and in r² − |c|².
    """
    # Relative to their mean, so that a large offset costs no digits.
    middle = forces.mean(axis=0)
    points = forces - middle
    design = np.column_stack([2 * points, np.ones(len(points))])
    solution, _, rank, _ = np.linalg.lstsq(design, np.sum(points**2, axis=1), rcond=1e-6)
    square = solution[3] + solution[:3] @ solution[:3]
    if rank < 4 or square <= 0:
        return None
    return middle + solution[:3], float(np.sqrt(square))
