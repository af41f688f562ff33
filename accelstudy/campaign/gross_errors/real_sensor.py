"""A real sensor, fitted robustly to a campaign that may have gross errors.

Even before calibration a sensor agrees with its robot, or with gravity, within some hundredths of
g. So the fit starts at the ideal sensor and stays near it, and positions that are far off get no
weight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import specific_force
from accelstudy.sensors.plausibility import LARGEST

USUAL_SD = 0.3
"""Standard deviation of each parameter of an uncalibrated sensor, as a share of gravity."""
MIN_RATIO = 4.0
"""How many times better an explanation must fit to be clear. A position that is farther off than so
many times the usual distance is wrong."""
MAX_USABLE_ERROR = 0.15
"""Share of gravity by which no usable sensor is wrong."""
MIN_POSITION_ERROR = 0.005
"""Share of gravity by which a single position must be off to be called wrong, and by which an
exchange of rows must improve the fit."""
MIN_DISTANCE = 1e-6
"""Distance, as a share of gravity, below which differences do not count."""
MIN_SPARE_POSITIONS = 3
"""Positions beyond the number of fitted parameters that are needed to notice a wrong one."""
MANY_POSITIONS = 3
"""Positions, in numbers of fitted parameters, from which on there are many."""
MAX_ITERATIONS = 40
"""Largest number of iterations."""
MIN_GROSS_ERROR = 0.1
"""Share of gravity: if no position is farther off, no unit and no axis can be wrong."""


@dataclass(frozen=True)
class Correction:
    """A gross error, undone.

    Attributes
    ----------
    name : str, of the gross error
    reason : str, what is wrong, in words; empty if nothing is
    corrected : Campaign, without the error
    matrix : (3, 3) array, turns forces as they were read into mended ones; None if it is I
    changed : (n,) bool array, which positions change; None if all do
    left_out : tuple of int, positions that cannot be mended
    """

    name: str
    reason: str
    corrected: Campaign
    matrix: Array | None = None
    changed: NDArray[np.bool_] | None = None
    left_out: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class RealSensor:
    """A sensor that is fitted robustly to most positions of a campaign.

    Attributes
    ----------
    campaign : Campaign, after the corrections
    attitude : bool, whether to compare with the robot's attitudes, or with gravity alone
    mounted : bool, whether the sensor may be mounted in any attitude, with errors of any size
    undone : tuple of Correction, what was corrected in the campaign, one after the other
    """

    campaign: Campaign
    attitude: bool
    mounted: bool = False
    undone: tuple[Correction, ...] = ()

    def after(self, correction: Correction) -> RealSensor:
        """Return the sensor that is fitted to the campaign after one more correction."""
        return replace(self, campaign=correction.corrected, undone=(*self.undone, correction))

    @property
    def gravity(self) -> float:
        """Gravity of the campaign, m/s²."""
        return self.campaign.gravity

    @cached_property
    def free(self) -> RealSensor:
        """The sensor that may be mounted in any attitude."""
        return replace(self, mounted=True)

    @cached_property
    def _design(self) -> tuple[Array, Array]:
        """Design (n, u), and what an ideal sensor lacks, (n, 3) or, of the norm alone, (n, 1)."""
        g, conditions = self.gravity, _conditions(self.campaign)
        if self.attitude:
            assert self.campaign.angles is not None
            roll, pitch = self.campaign.angles.T
            ideal = np.column_stack(specific_force(roll, pitch, g))
            design = np.stack([*ideal.T / g, np.ones(len(ideal)), *conditions], axis=1)
            return design, (self.campaign.forces - ideal) / g
        # The norm of (I + D) f/g + c is 1: linear in the nine numbers of (I + D)ᵀ(I + D), c.
        x, y, z = unit = self.campaign.forces.T / g
        columns = [*unit**2, x * y, y * z, z * x, *unit]
        columns += [c * axis for c in conditions for axis in unit]
        return np.stack(columns, axis=1), (1 - np.sum(unit**2, axis=0, keepdims=True).T) / 2

    @cached_property
    def _parameters(self) -> Array:
        """Parameters (u, 3) or, of the norm alone, (u, 1) of the fitted sensor."""
        return _robust(*self._design, np.inf if self.mounted else USUAL_SD)

    @cached_property
    def _left(self) -> Array:
        """What an ideal sensor lacks beyond the fitted one, (n, 3), or (n, 1) of the norm alone."""
        design, lacking = self._design
        return np.asarray(lacking - design @ self._parameters)

    @cached_property
    def strangeness(self) -> float:
        """Largest bias or scale by the norm alone, over the largest that sensors have.

        The readings lie on the ellipsoid uᵀMu + 2 qᵀu = 1 about −M⁻¹q.
        """
        xx, yy, zz, xy, yz, zx, *q = self.free._parameters[:9, 0]
        shape = np.eye(3) + np.array([[2 * xx, xy, zx], [xy, 2 * yy, yz], [zx, yz, 2 * zz]])
        if np.linalg.eigvalsh(shape)[0] <= 0:
            return np.inf
        bias = -np.linalg.solve(shape, q)
        scales = np.sqrt((1 - bias @ q) * np.diag(np.linalg.inv(shape))) - 1
        most = LARGEST["bias"] / STANDARD_GRAVITY, LARGEST["scale"]
        return float(max(np.abs(bias).max() / most[0], np.abs(scales).max() / most[1]))

    @cached_property
    def expected(self) -> Array | None:
        """What it reads in each position, (n, 3), m/s²; None where only the norm is known."""
        return self.campaign.forces - self.gravity * self._left if self.attitude else None

    @cached_property
    def distance(self) -> Array:
        """Distance of each reading from what it should be, (n,), m/s²."""
        if self.attitude:
            return np.asarray(self.gravity * np.linalg.norm(self._left, axis=1))
        return self.gravity * np.abs(np.sqrt(np.maximum(1 - 2 * self._left[:, 0], 0)) - 1)

    @property
    def tells(self) -> bool:
        """Whether there are enough positions to say which of them are wrong."""
        n, u = self._design[0].shape
        return n >= u + MIN_SPARE_POSITIONS

    @property
    def has_many(self) -> bool:
        """Whether there are so many positions that chance hardly makes them fit better."""
        n, u = self._design[0].shape
        return n >= MANY_POSITIONS * u

    @property
    def usual_distance(self) -> float:
        """Distance of the usual position, m/s²."""
        return float(np.median(self.distance))

    @property
    def misfit(self) -> float:
        """Mean distance, m/s²; each position counts by `MAX_USABLE_ERROR` at most."""
        return float(np.mean(np.minimum(self.distance, MAX_USABLE_ERROR * self.gravity)))

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """Which positions, (n,), do not fit."""
        return self.distance > MIN_RATIO * self.usual_distance

    @property
    def is_far_off(self) -> bool:
        """Whether a position is so far off that a unit or an axis can be wrong."""
        return bool(self.distance.max() >= MIN_GROSS_ERROR * self.gravity)

    @property
    def is_askew(self) -> bool:
        """Whether most positions fit clearly better if it may be mounted in any attitude."""
        if not self.attitude or self.usual_distance < MIN_POSITION_ERROR * self.gravity:
            return False
        return MIN_RATIO * self.free.usual_distance < self.usual_distance


def _conditions(campaign: Campaign) -> list[Array]:
    """Temperature and time, scaled to −1 … 1: a drift with them is not the fault of a position."""
    conditions = []
    for values in (campaign.temperature, campaign.time):
        if values is not None and np.ptp(values) > 0:
            conditions.append(2 * (values - values.min()) / np.ptp(values) - 1)
    return conditions


def _robust(design: Array, lacking: Array, share: float) -> Array:
    """Fit X p ≈ y robustly and return p, (u, k); positions that are far off lose their weight.

    Each parameter is held near zero, as if it had been observed in each position with the standard
    deviation `share`, where the standard deviation of an observation is the usual distance. So the
    parameters become large only if the usual distance is large.
    """
    n, u = design.shape
    start: Array = np.zeros((u, lacking.shape[1]))
    if share == np.inf:
        start = np.asarray(np.linalg.lstsq(design, lacking, rcond=None)[0])
    parameters, before = start, np.inf
    for _ in range(MAX_ITERATIONS):
        distance = np.linalg.norm(lacking - design @ parameters, axis=1)
        usual = max(float(np.median(distance)), MIN_DISTANCE)
        if abs(before - usual) < 1e-3 * usual:
            break
        before = usual
        weights = 1 / (1 + (distance / (MIN_RATIO * usual)) ** 2) ** 2
        normal = design.T * weights @ design / n + np.eye(u) * max((usual / share) ** 2, 1e-12)
        parameters = np.linalg.solve(normal, design.T * weights @ lacking / n)
    return np.asarray(parameters)
