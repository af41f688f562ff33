"""How well a calibration predicts positions that it did not use.

Without position i the parameters change by dx = Q_xx Ãᵢᵀ R_ii⁻¹ e_i, and its misclosure becomes
L R_ii⁻¹ e_i: to first order, as one position of many changes the derivatives by next to nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.adjustment.quality.solution import Solution
from accelstudy.leveling.angles import angles_of, wrap_angle

Array = NDArray[np.float64]

NEAR_POLE = 0.1
"""Cosine of pitch below which an error of roll says nothing of the tilt."""


@dataclass(frozen=True)
class HeldOut:
    """How well each position is predicted by a calibration from all others.

    Attributes
    ----------
    misclosures : (n, c) array, m/s², |f_b| − g, or the output less that in the robot's attitude;
        NaN where the others do not determine the parameters
    angles : (n, 2) array, rad, calibrated roll and pitch less the robot's; None without a robot.
        NaN in roll where the x axis is nearly vertical
    """

    misclosures: Array
    angles: Array | None

    @property
    def n_predicted(self) -> int:
        """Number of positions that could be predicted; the rms are over these."""
        return int(np.count_nonzero(~np.isnan(self.misclosures[:, 0])))

    @property
    def rms(self) -> float:
        """Rms of |misclosure|, m/s²."""
        return float(_rms(np.linalg.norm(self.misclosures, axis=1)))

    @property
    def rms_angles(self) -> Array | None:
        """Rms of roll and of pitch, rad, (2,)."""
        return None if self.angles is None else np.array([_rms(a) for a in self.angles.T])


def _rms(values: Array) -> float:
    predicted = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(predicted**2))) if len(predicted) else np.nan


def held_out(solution: Solution) -> HeldOut | None:
    """Predict each position of a session by all others; None if the redundancy is below c."""
    n, c = solution.misclosures.shape
    if solution.redundancy < c:
        return None
    model, observed = solution.model, solution.observed
    root, rank = solution.root
    root = np.where((rank == c)[:, None, None], root, np.nan)
    scaled = root @ np.swapaxes(root, 1, 2) @ solution.errors[: n * c].reshape(n, c, 1)
    misclosures = (solution.whitening @ scaled)[..., 0]
    if observed.angles is None or not solution.approach.uses_angles:
        return HeldOut(misclosures, None)
    design = solution.design[: n * c].reshape(n, c, -1)
    x = solution.parameters + (np.swapaxes(design, 1, 2) @ scaled)[..., 0] @ solution.cofactors
    p = x[:, : model.n_parameters]
    g = x[:, -1] if observed.sigma_gravity > 0 else np.full(n, solution.gravity)
    # Each position has parameters of its own, so they are sessions of one position.
    hold = None if observed.hold is None else observed.hold.take(np.arange(n)[:, None])
    f_b = model.correct(observed.forces[0][:, None], p, g, hold)[:, 0]
    readings = observed.angles[0]
    attitude = readings - model.errors_of_reading(readings[:, None], p, hold)[:, 0]
    return HeldOut(misclosures, _attitude_error(f_b, attitude))


def _attitude_error(f: Array, angles: Array) -> Array:
    """Roll and pitch of `f` less the given ones, (n, 2), roll wrapped into ±π."""
    roll, pitch = (angles_of(f) - angles).T
    roll = np.where(np.cos(angles[:, 1]) < NEAR_POLE, np.nan, wrap_angle(roll))
    return np.stack([roll, pitch], axis=-1)
