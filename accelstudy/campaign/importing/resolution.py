"""The steps in which an axis is read, and what rounding to them leaves in the mean of a hold.

A reading is the force with its noise, rounded to the next step. Noise of half a step and more
averages the rounding out, as a dither does. With less noise all samples of a hold are rounded
alike, and however long the hold, its mean is off by up to half a step.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.units import STANDARD_GRAVITY
from accelstudy.basics.wording import comma_list

Array = NDArray[np.float64]

MOST = 2**15
"""Different readings of an axis beyond which its steps are too fine to matter."""
OFTEN = 4
"""Times that a reading occurs on average, at least, where an axis is read in steps."""
COARSEST = 0.1 * STANDARD_GRAVITY
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


def step_in(readings: Array) -> float:
    """Step of the readings (n,) of an axis, m/s²; 0 if there is none."""
    different = np.empty(0)
    for first in range(0, len(readings), MOST):  # most axes of fine steps show it at once
        different = np.union1d(different, readings[first : first + MOST])
        if len(different) > MOST:
            return 0.0
    often = len(readings) >= OFTEN * len(different)
    return float(f"{step_of(different):.6g}") if often else 0.0


def step_of(different: Array) -> float:
    """Step of a regular grid of which these readings, in order, are points; 0 if there is none."""
    gaps = np.diff(different)
    if len(gaps) < 2:
        return 0.0
    step = float(np.median(gaps[gaps <= 1.5 * gaps.min()]))
    place = np.concatenate([[0.0], np.cumsum(np.round(gaps / step))])
    slope, start = np.polyfit(place, different, 1)
    off = np.sqrt(np.mean((different - start - slope * place) ** 2))
    return float(slope) if off <= _OFF * slope and slope <= COARSEST else 0.0


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
