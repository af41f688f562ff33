"""Closed forms, with which the adjustment, the leveling and the Monte Carlo are compared.

Those of linear theory are valid for the models of bias, scale and non-orthogonality in schemes
with octahedral moments: over the n directions ⟨x⟩ = ⟨xy⟩ = 0 and all third moments vanish, ⟨x⁴⟩ is
the same for each axis and m = ⟨x²y²⟩ the same for each pair, and no moment such as ⟨x³y⟩ remains.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.units import STANDARD_GRAVITY

Array = NDArray[np.float64]


def has_octahedral_moments(directions: Array) -> bool:
    """Whether `directions` (n, 3) have the moments of a cube's symmetry through degree 4."""
    fourth = np.mean(directions[:, 0] ** 4)
    m = np.mean(directions[:, 0] ** 2 * directions[:, 1] ** 2)
    for degree in range(1, 5):
        for axes in combinations_with_replacement(range(3), degree):
            counts = sorted(axes.count(i) for i in set(axes))
            expected = {(2,): 1 / 3, (4,): fourth, (2, 2): m}.get(tuple(counts), 0.0)
            if abs(np.mean(np.prod(directions[:, axes], axis=1)) - expected) > 1e-6:
                return False
    return True


def gravity_sigma(
    directions: Array, sigma_force: float, g: float = STANDARD_GRAVITY
) -> dict[str, float]:
    """Standard deviations of the gravity-based calibration.

    σ_b = σ √(3/n), σ_α = (σ/g) / √(n m), σ_s = (σ/g) √((1 − 3m) / (n (1/3 − 3m))).

    Parameters
    ----------
    directions : (n, 3) array with octahedral moments
    sigma_force : float, m/s²
    g : float, m/s²

    Returns
    -------
    dict of effect ("bias", "scale", "nonorthogonality") to sigma in SI; infinite for an effect
    that the scheme does not determine (non-orthogonality with m = 0)
    """
    n, m = len(directions), float(np.mean(directions[:, 0] ** 2 * directions[:, 1] ** 2))
    relative = sigma_force / g
    return {
        "bias": sigma_force * np.sqrt(3 / n),
        "scale": relative * np.sqrt((1 - 3 * m) / (n * (1 / 3 - 3 * m))),
        "nonorthogonality": relative / np.sqrt(n * m) if m > 0 else np.inf,
    }


def roll_and_pitch(f: Array) -> Array:
    """Angles (..., 2), rad, of forces (..., 3) with x forward, y right, z down."""
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([np.arctan2(-y, -z), np.arctan2(x, np.hypot(y, z))], axis=-1)


def perfect_robot_ratio(directions: Array) -> dict[str, float]:
    """Standard deviations with a robot without error, relative to the gravity-based ones.

    Bias 1/√3, misalignment √(3m), scale √(3 (1/3 − 3m) / (1 − 3m)).
    """
    m = float(np.mean(directions[:, 0] ** 2 * directions[:, 1] ** 2))
    return {
        "bias": 1 / np.sqrt(3),
        "scale": np.sqrt(3 * (1 / 3 - 3 * m) / (1 - 3 * m)),
        "nonorthogonality": np.sqrt(3 * m),
    }
