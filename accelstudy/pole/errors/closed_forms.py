"""Closed forms of some sources, with which the budget is compared.

They hold for a sensor whose axes are those of the pole (frd), an antenna on the pole's axis, and
small errors. A pole of length L leans by τ in the direction α, counted from forward towards right.
"""

from __future__ import annotations

import numpy as np

from accelstudy.basics.units import STANDARD_GRAVITY


def of_force(
    length: float, tilt: float, direction: float, sigma: float, g: float = STANDARD_GRAVITY
) -> tuple[float, float]:
    """Errors of a force, equal on all axes (noise, drift): horizontal and vertical, m.

    The horizontal variance is (L σ/g)² {cos²τ + [cos²τ + sin⁴τ sin²α cos²α] / (1 − sin²τ cos²α)²}
    and the vertical one (L σ/g)² sin²τ. The expression in braces is 2 at level, cos²τ + 1/cos²τ for
    a pole that leans forward, and 2 cos²τ for one that leans to the side. They differ since the
    heading is that of the forward axis: if this axis points up or down, an error of roll turns the
    lean about the vertical.
    """
    s, c = np.sin(tilt), np.cos(tilt)
    across = s**2 * np.sin(direction) * np.cos(direction)
    level = 1 - s**2 * np.cos(direction) ** 2
    size = length * sigma / g
    return size * np.sqrt(c**2 + (c**2 + across**2) / level**2), size * s


def of_mounting(length: float, tilt: float, sigma: float) -> tuple[float, float]:
    """Angles between sensor and pole: L σ √(1 + cos²τ) horizontally, L σ sin τ in height, m."""
    return length * sigma * np.sqrt(1 + np.cos(tilt) ** 2), length * sigma * np.sin(tilt)


def of_heading(length: float, tilt: float, sigma: float) -> tuple[float, float]:
    """Error of the heading: L sin τ σ horizontally, nothing in height, m."""
    return length * np.sin(tilt) * sigma, 0.0


def of_length(tilt: float, sigma: float) -> tuple[float, float]:
    """Error of the length: σ sin τ horizontally, σ cos τ in height, m."""
    return sigma * np.sin(tilt), sigma * np.cos(tilt)


def of_bending(flexibility: float, tilt: float) -> tuple[float, float]:
    """Bending of a pole: f sin τ cos τ horizontally, f sin²τ in height, m."""
    return abs(flexibility) * np.sin(tilt) * np.cos(tilt), abs(flexibility) * np.sin(tilt) ** 2
