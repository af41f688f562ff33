"""Monte Carlo of a pole: all sources at once, with exact geometry and exact correction."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from accelstudy.basics.units import GON, MGON
from accelstudy.pole.budget import Budget, budget, situation_at
from accelstudy.pole.geometry import Situation
from accelstudy.pole.sensor import CalibratedSensor
from accelstudy.pole.setup import Setup
from accelstudy.pole.sources import sources

Array = NDArray[np.float64]


def draw(situation: Situation, replicates: int, rng: np.random.Generator) -> Array:
    """Draw errors of the foot, (R, k, 3), m, with independent errors from every source."""
    errors: dict[tuple[str, ...], Array] = {}
    for source in sources():
        each = source.errors(situation)
        # Eigenvectors, since a covariance may be singular or zero.
        variance, axes = np.linalg.eigh(each.covariance)
        root = axes * np.sqrt(np.maximum(variance, 0.0))[:, None]
        normal = rng.standard_normal((replicates, *each.shift.shape))
        error = each.shift + np.einsum("kij,rkj->rki", root, normal)
        errors[each.inputs] = errors.get(each.inputs, 0.0) + error
    return situation.errors(errors)


def simulate(
    setup: Setup, sensor: CalibratedSensor, tilts: Array, replicates: int, seed: int
) -> pd.DataFrame:
    """Compare linear theory with a Monte Carlo over all directions of leaning.

    Parameters
    ----------
    setup : Setup
    sensor : CalibratedSensor
    tilts : (t,) array, rad
    replicates : int, of each tilt and direction
    seed : int; the draws of a tilt depend on it and on the tilt only

    Returns
    -------
    DataFrame, one row per tilt: rms by linear theory (`linear_…`) and by Monte Carlo
    (`simulated_…`) with its standard error (`standard_error_…`), horizontal and vertical, in m; and
    the part of the horizontal errors inside the circles for 95 % (`inside_95`)
    """
    rows = []
    for tilt in tilts:
        situation = situation_at(setup, sensor, np.array([tilt]))
        linear = budget(setup, sensor, np.array([tilt]))
        rng = np.random.default_rng([seed, round(tilt / MGON)])
        errors = draw(situation, replicates, rng)
        rows.append(
            {"tilt_gon": tilt / GON, "replicates": errors[..., 0].size, **_compared(linear, errors)}
        )
    return pd.DataFrame(rows)


def _compared(linear: Budget, errors: Array) -> dict[str, float]:
    row = {}
    squares = {
        "horizontal": (linear.horizontal(), errors[..., 0] ** 2 + errors[..., 1] ** 2),
        "vertical": (linear.vertical(), errors[..., 2] ** 2),
    }
    for name, ((expected,), square) in squares.items():
        rms = np.sqrt(np.mean(square))
        # Directions differ systematically, so the variance is taken within each.
        variance = np.mean(np.var(square, axis=0, ddof=1)) / square.size
        row[f"linear_{name}_m"] = float(expected)
        row[f"simulated_{name}_m"] = float(rms)
        row[f"standard_error_{name}_m"] = float(np.sqrt(variance) / (2 * rms)) if rms > 0 else 0.0
    inside = np.sqrt(squares["horizontal"][1]) <= linear.total.radius[0]
    return {**row, "inside_95": float(np.mean(inside))}
