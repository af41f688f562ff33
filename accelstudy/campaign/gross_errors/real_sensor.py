"""How well a real sensor can fit a campaign: what gross errors are judged by.

Even before calibration a real sensor differs from an ideal one by some hundredths of g only. So
the fit starts at the ideal sensor and stays near it, and positions that are far off get no weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import specific_force

Array = NDArray[np.float64]

USUAL = 0.3
"""Standard deviation of each parameter of an uncalibrated sensor, as a share of gravity."""
CLEARLY = 4.0
"""How many times better an explanation must fit to be clear. A position that is farther off than so
many times the usual distance is wrong."""
LOST = 0.15
"""Share of gravity by which no usable sensor is wrong."""
SHOWS = 0.005
"""Share of gravity by which a single position must be off to be called wrong."""
LEAST = 1e-6
"""Distance, as a share of gravity, below which differences do not count."""
SPARE = 3
"""Positions beyond the number of fitted parameters that are needed to notice a wrong one."""
STEPS = 40
"""Largest number of iterations."""


@dataclass(frozen=True)
class RealSensor:
    """A sensor that was fitted to most positions of a campaign.

    Attributes
    ----------
    expected : (n, 3) array, m/s², what it reads in each position; None where only the norm is known
    distance : (n,) array, m/s², of each reading from what it should be
    gravity : float, m/s²
    tells : bool, whether there are enough positions to say which of them are wrong
    mirrored : bool, whether its axes are left-handed, as those of no sensor are, however mounted;
        only of one that may be mounted in any attitude
    """

    expected: Array | None
    distance: Array
    gravity: float
    tells: bool
    mirrored: bool = False

    @property
    def usual(self) -> float:
        """Distance of the usual position, m/s²."""
        return float(np.median(self.distance))

    @property
    def misfit(self) -> float:
        """Mean distance, m/s²; a position beyond `LOST` counts as `LOST`, however far off it is."""
        return float(np.mean(np.minimum(self.distance, LOST * self.gravity)))

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """Which positions, (n,), do not fit."""
        return self.distance > CLEARLY * self.usual

    @classmethod
    def of(cls, campaign: Campaign, attitude: bool, mounted: bool = False) -> RealSensor:
        """Fit a sensor, robustly.

        Parameters
        ----------
        campaign : Campaign
        attitude : bool, whether to compare with the robot's attitudes, or with gravity alone
        mounted : bool, whether the sensor may be mounted in any attitude, with errors of any size
        """
        g, conditions = campaign.gravity, _conditions(campaign)
        share = np.inf if mounted else USUAL
        if not attitude:
            # The norm of (I + D) f/g + c is 1: linear in the nine numbers of (I + D)ᵀ(I + D), c.
            x, y, z = unit = campaign.forces.T / g
            columns = [*unit**2, x * y, y * z, z * x, *unit]
            columns += [c * axis for c in conditions for axis in unit]
            design = np.stack(columns, axis=1)
            lacking = (1 - np.sum(unit**2, axis=0, keepdims=True).T) / 2
            squares = 1 - 2 * (lacking - _robust(design, lacking, share))[:, 0]
            return cls(None, g * np.abs(np.sqrt(np.maximum(squares, 0)) - 1), g, _tells(design))
        ideal = attitude_forces(campaign)
        columns = [*ideal.T / g, np.ones(len(ideal)), *conditions]
        design, lacking = np.stack(columns, axis=1), (campaign.forces - ideal) / g
        expected = ideal + g * _robust(design, lacking, share)
        distance = np.linalg.norm(campaign.forces - expected, axis=1)
        mirrored = mounted and _left_handed(design, expected / g, float(np.median(distance)) / g)
        return cls(expected, distance, g, _tells(design), mirrored)


def attitude_forces(campaign: Campaign) -> Array:
    """Return what an ideal sensor reads at the robot's angles, (n, 3), m/s²."""
    assert campaign.angles is not None
    roll, pitch = campaign.angles.T
    return np.column_stack(specific_force(roll, pitch, campaign.gravity))


def _left_handed(design: Array, expected: Array, noise: float) -> bool:
    """Whether what a sensor reads is a mirror image of the forces, the first columns of a design.

    Each axis has to show clearly, or its direction would be one of noise.
    """
    inverse = np.linalg.pinv(design)
    matrix = (inverse @ expected)[:3]
    error = noise * np.linalg.norm(inverse[:3], ord=2)
    least = np.linalg.svd(matrix, compute_uv=False)[-1]
    return bool(np.linalg.det(matrix) < 0 and least > CLEARLY * error)


def _tells(design: Array) -> bool:
    n, u = design.shape
    return n >= u + SPARE


def _conditions(campaign: Campaign) -> list[Array]:
    """Temperature and time, scaled to −1 … 1: a drift with them is not the fault of a position."""
    conditions = []
    for values in (campaign.temperature, campaign.time):
        if values is not None and np.ptp(values) > 0:
            conditions.append(2 * (values - values.min()) / np.ptp(values) - 1)
    return conditions


def _robust(design: Array, lacking: Array, share: float) -> Array:
    """Fit X p ≈ y robustly and return X p, (n, k); positions that are far off lose their weight.

    Each parameter is held near zero, as if it had been observed in each position with the standard
    deviation `share`, where the standard deviation of an observation is the usual distance. So the
    parameters become large only if the usual distance is large.
    """
    n, u = design.shape
    start: Array = np.zeros((u, lacking.shape[1]))
    if share == np.inf:
        start = np.asarray(np.linalg.lstsq(design, lacking, rcond=None)[0])
    parameters, before = start, np.inf
    for _ in range(STEPS):
        distance = np.linalg.norm(lacking - design @ parameters, axis=1)
        usual = max(float(np.median(distance)), LEAST)
        if abs(before - usual) < 1e-3 * usual:
            break
        before = usual
        weights = 1 / (1 + (distance / (CLEARLY * usual)) ** 2) ** 2
        normal = design.T * weights @ design / n + np.eye(u) * max((usual / share) ** 2, 1e-12)
        parameters = np.linalg.solve(normal, design.T * weights @ lacking / n)
    return np.asarray(design @ parameters)
