"""Smooth functions of a coordinate: a Gaussian process as a few functions with prior variances.

In its Hilbert-space form (Solin & Särkkä 2020, Stat. Comput. 30, 419) a smooth function is h(c) =
Σ_j w_j φ_j(c), with sines φ_j, or harmonics of an angle, and w_j ~ N(0, σ² S_j), S_j the spectral
density of a squared exponential at the frequency of φ_j and σ the standard deviation of h.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array

LENGTHS = (0.25, 0.6, 1.5)
"""Length scales, of a coordinate that goes from −1 to 1, of an angle in rad, or of a direction."""
SINES, EDGE = 12, 1.5
"""Sines of a coordinate; they vanish this far from its middle."""
HARMONICS = 4
"""Harmonics of an angle."""
CYCLES = np.arange(1.0, 5.01, 0.25)
"""Cycles of a periodic function of time in a session."""

MIN_LENGTHS = 3.2
"""Length scales from the middle at which sines may vanish, so that they are a Gaussian process in
all of the range (Riutort-Mayol et al. 2023, Stat. Comput. 33, 17)."""
ORDERS = np.arange(1, HARMONICS + 1)
"""Frequencies of the harmonics."""


def frequencies(edge: float = EDGE) -> Array:
    """Frequencies of sines that vanish at ± an edge, (k,)."""
    return np.asarray(np.pi / (2 * edge) * np.arange(1, SINES + 1))


def sines(scaled: Any, xp: Any, count: int = SINES, edge: float = EDGE) -> list[Any]:
    """Sines of a coordinate that goes from −1 to 1."""
    return [xp.sin(omega * (scaled + edge)) for omega in frequencies(edge)[:count].tolist()]


def harmonics(angle: Any, xp: Any, count: int = HARMONICS) -> list[Any]:
    """Sines of multiples of an angle, then their cosines."""
    turns = [k * angle for k in ORDERS[:count].tolist()]
    return [*(xp.sin(turn) for turn in turns), *(xp.cos(turn) for turn in turns)]


def spectrum(omega: ArrayLike, length: ArrayLike) -> Array:
    """Spectral density of a squared exponential, by the length scales and frequencies, (..., k)."""
    return np.asarray(np.exp(-(np.multiply.outer(length, omega) ** 2) / 2))
