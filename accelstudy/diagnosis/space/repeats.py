"""Which positions repeat each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SAME_ATTITUDE = 0.01
"""Positions closer than this (chord of unit vectors) repeat each other."""


def clusters(forces: NDArray[np.float64]) -> NDArray[np.int_]:
    """Label positions by attitude; positions with the same label repeat each other."""
    unit = forces / np.linalg.norm(forces, axis=1, keepdims=True)
    labels = -np.ones(len(unit), dtype=int)
    # Only positions alike in one coordinate need to be compared.
    order = np.argsort(unit[:, 0], kind="stable")
    x = unit[order, 0]
    first = np.searchsorted(x, unit[:, 0] - SAME_ATTITUDE)
    last = np.searchsorted(x, unit[:, 0] + SAME_ATTITUDE, side="right")
    for i in range(len(unit)):
        if labels[i] < 0:
            near = order[first[i] : last[i]]
            near = near[labels[near] < 0]
            labels[near[np.linalg.norm(unit[near] - unit[i], axis=1) < SAME_ATTITUDE]] = i
    return labels
