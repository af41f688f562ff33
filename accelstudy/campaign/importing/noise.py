"""Noise of the samples within holds, and what it and rounding leave in the mean of a hold.

A reading is the force with its noise, rounded to the next step. Noise of half a step and more
averages the rounding out, as a dither does. With less noise all samples of a hold are rounded
alike, and however long the hold, its mean is off by up to half a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import comma_list
from accelstudy.campaign.importing.allan import (
    AllanDeviation,
    MeanAccuracy,
    accuracy_of_mean,
    pooled_deviation,
)

MAX_NORM_RATIO = 1.5
"""Largest over smallest norm of the means of one sensor in gravity."""
MIN_SPREAD = 0.25
"""Rms of the means along their thinnest direction, over gravity; of a sphere 0.58."""
MAX_OVER_HARMONIC = 1.4
"""Length of a typical hold over the harmonic mean of all lengths, at most. If a third of 18 holds
has a twelfth of the usual length, a test at 1 % then rejects 11 % of right calibrations by gravity,
and 79 % without this limit."""
LONGEST_RECORD = 2**20
"""Samples of a hold that are used for the Allan deviation; later ones count for the mean only."""
MAX_READINGS = 2**15
"""Different readings of an axis beyond which its steps are too fine to matter."""
MAX_STEP = 0.1 * STANDARD_GRAVITY
"""Largest step of a usable sensor, m/s²."""
_OFF = 0.1
"""Rms of readings about a regular grid, in steps: a file rounds them, too."""

_RATIO = np.linspace(0.0, 2.0, 401)
"""Noise before rounding over the step."""
_ORDERS = np.arange(1, 501)[:, None]
_LEFT = np.sum(np.exp(-((2 * np.pi * _ORDERS * _RATIO) ** 2)) / (2 * np.pi**2 * _ORDERS**2), axis=0)
"""Variance that rounding leaves in the mean of a hold, in squares of the step, over `_RATIO`.

The mean of rounded readings is off by Σ (−1)ᵏ q/(π k) exp(−2 π² k² σ²/q²) sin(2π k f/q) (Widrow and
Kollár 2008, chapter 4). Its square is averaged over forces f: from q²/12 without noise to nothing.
"""
_WITHIN = _RATIO**2 + 1 / 12 - _LEFT
"""Variance of the readings within a hold in the same unit: of all, less what the mean has of it."""


@dataclass(frozen=True)
class HoldNoise:
    """Noise of the samples within all holds of a log together.

    It is taken along the mean specific force of each hold, where nothing that moves the sensor
    adds to it; if the means are too far from forces for that, in all three channels.

    Attributes
    ----------
    allan : AllanDeviation, of the channels of the sensor
    sd : (3,) array, m/s², root mean square sd of the samples along the mean and across it
    center : (3,) array, m/s², zero point of the specific forces; zero if the holds determine none
    directed : bool, whether the means are close enough to forces for "along" to have a meaning
    accuracy : MeanAccuracy, of the mean over a typical hold in the channels of the sensor
    across : float, m/s², standard deviation of such a mean across gravity; 0 if not directed
    rounding : float, m/s², what rounding to the steps of the readings leaves in any mean
    count : int, holds
    """

    allan: AllanDeviation
    sd: Array
    center: Array
    directed: bool
    accuracy: MeanAccuracy
    across: float
    rounding: float
    count: int

    @property
    def sigma(self) -> float:
        """Standard deviation of the mean over a typical hold, m/s²."""
        return float(np.hypot(self.accuracy.allan, self.rounding))

    @property
    def dof(self) -> float:
        """Degrees of freedom of the square of `sigma` (Welch and Satterthwaite).

        Those of the part of rounding are the means of the axes that it comes from.
        """
        allan, rounding = self.accuracy.allan**2, self.rounding**2
        parts = allan**2 / self.accuracy.dof + rounding**2 / (3 * self.count)
        return (allan + rounding) ** 2 / parts if parts > 0 else self.accuracy.dof


def hold_noise(records: Sequence[Array], step: float, resolution: ArrayLike = 0.0) -> HoldNoise:
    """Noise of the samples of holds.

    Parameters
    ----------
    records : the forces (n, 3), m/s², of each hold
    step : float, s, usual time between samples
    resolution : (3,) array, m/s², steps in which the axes are read; 0 where there are none
    """
    means = np.array([record.mean(axis=0) for record in records])
    center, directed = _center(means)
    # Orthonormal columns, the first of them along the mean. A sensor that settles or is nudged
    # turns a little. That moves the force across its mean, and along it in the second order only.
    # So the scatter along the mean is the sensor's own noise.
    frames = np.linalg.svd((means - center)[:, :, None])[0]
    covariances = np.array([np.cov(record, rowvar=False) for record in records])
    squares = np.einsum("nij,nik,nkj->j", frames, covariances, frames) / len(records)
    sd = np.sqrt(np.maximum(squares, 0.0))
    lengths = np.array([len(record) for record in records])
    # The harmonic mean has the mean variance of white noise; far beyond it short holds refute it.
    typical = int(min(np.median(lengths), MAX_OVER_HARMONIC / np.mean(1 / lengths)))
    short = [record[:LONGEST_RECORD] for record in records]

    def accuracy_in(channels: slice, least: float) -> tuple[AllanDeviation, MeanAccuracy]:
        curve = pooled_deviation(short, step, frames[:, :, channels], least)
        return curve, accuracy_of_mean(curve, typical * step, sd[channels], typical)

    allan, accuracy = accuracy_in(slice(0, 1 if directed else 3), 1)
    # Two octaves are extrapolated; all averaging times would take long.
    least = min(accuracy.tau / step, typical) / 5
    across = accuracy_in(slice(1, 3), least)[1].allan if directed else 0.0
    of_axes = np.sqrt(np.einsum("nii->i", covariances) / len(records))
    rounding = float(np.sqrt(np.mean(rounding_of_mean(resolution, of_axes) ** 2)))
    return HoldNoise(allan, sd, center, directed, accuracy, across, rounding, len(records))


def _center(means: Array) -> tuple[Array, bool]:
    """Point from which all means of holds are equally far, and whether there is one.

    The offset of counts may be unknown; with a large one no mean points along gravity. If the
    attitudes differ enough, the sphere through the means shows it.
    """
    center = np.zeros(3)
    if len(means) > 5 and (sphere := fit_sphere(means)) is not None:
        thinnest = np.linalg.svd(means - means.mean(axis=0), compute_uv=False)[-1]
        if thinnest > MIN_SPREAD * sphere[1] * np.sqrt(len(means)):
            center = sphere[0]
    norms = np.linalg.norm(means - center, axis=1)
    directed = bool(norms.max() <= MAX_NORM_RATIO * norms.min())
    return center * directed, directed


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


def step_in(readings: Array) -> float:
    """Step of the readings (n,) of an axis, m/s²; 0 if there is none."""
    different = np.empty(0)
    for first in range(0, len(readings), MAX_READINGS):  # most axes of fine steps show it at once
        different = np.union1d(different, readings[first : first + MAX_READINGS])
        if len(different) > MAX_READINGS:
            return 0.0
    return float(f"{step_of(different):.6g}")


def step_of(different: Array) -> float:
    """Step of a regular grid of which these readings, in order, are points; 0 if there is none."""
    gaps = np.diff(different)
    if len(gaps) < 2:
        return 0.0
    # Not their median, which a file that rounds steps of 3.9 shows as 4.
    step = float(np.mean(gaps[gaps <= 1.5 * gaps.min()]))
    place = np.concatenate([[0.0], np.cumsum(np.round(gaps / step))])
    slope, start = np.polyfit(place, different, 1)
    off = np.sqrt(np.mean((different - start - slope * place) ** 2))
    return float(slope) if off <= _OFF * slope and slope <= MAX_STEP else 0.0


def noise_before_rounding(step: ArrayLike, sd: ArrayLike) -> Array:
    """Noise of samples before they were rounded, of the same shape as their steps and sds, m/s²."""
    step, sd = np.asarray(step, dtype=float), np.asarray(sd, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.interp((sd / step) ** 2, _WITHIN, _RATIO, right=np.nan)
    fine = np.sqrt(np.maximum(sd**2 - step**2 / 12, 0.0))
    return np.where(np.isnan(ratio), fine, ratio * step)


def rounding_of_mean(step: ArrayLike, sd: ArrayLike) -> Array:
    """Standard deviation that rounding leaves in the mean of a hold, m/s², whatever its length.

    Parameters
    ----------
    step : array, m/s², 0 where there is none
    sd : array, m/s², root mean square sd of the samples within holds, as they were read
    """
    step = np.asarray(step, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = noise_before_rounding(step, sd) / step
    return np.where(step > 0, step * np.sqrt(np.interp(ratio, _RATIO, _LEFT)), 0.0)


def steps_text(steps: ArrayLike) -> str:
    """Steps of the axes, m/s², for people; one number if they are alike."""
    different = dict.fromkeys(f"{step:.3g}" for step in np.ravel(steps) if step > 0)
    return f"{comma_list([*different])} m/s²"


def sigma_text(sigma: float) -> str:
    """Standard deviation of a force, m/s², for people."""
    return f"{1e3 * sigma:.3g} mm/s²"
