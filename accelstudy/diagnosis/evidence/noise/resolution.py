"""The test for coarse readings: whether they are whole multiples of a step."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.diagnosis.evidence.noise.kinds import STEPS, NoiseTest
from accelstudy.diagnosis.space.repeats import clusters

Array = NDArray[np.float64]

GRID = 1e-5
"""Probability that noise about a regular grid of attitudes looks like steps, at each resolution."""


def resolution_test(forces: Array, sigma: float) -> NoiseTest:
    """Whether the readings of an axis are whole multiples of a resolution that matters.

    The Rayleigh power of the readings is searched over resolutions q from σ to 30 σ, as long as the
    readings span at least four steps. Without quantisation n times the power is a standard
    exponential variable at each q.

    The attitudes may themselves form a regular grid. With noise of σ about it −n log(power) is at
    least (2π σ/q)² χ² with n − 1 degrees of freedom. So only a power that exceeds what such noise
    reaches counts. Of repeated attitudes one is used.
    """
    forces = forces[np.unique(clusters(forces))]
    n = len(forces)
    best, where = 0.0, 0.0
    extent = float(np.max(np.ptp(forces, axis=0)))
    steps = max(2, min(int(2 * extent / sigma), 100_000))
    lowest = max(1 / 30, 4 * sigma / extent) if extent > 0 else 1.0
    frequencies = np.linspace(min(lowest, 1.0), 1.0, steps) / sigma
    least = 2 * special.gammaincinv((n - 1) / 2, GRID) / n if n > 1 else 0.0
    usual = np.exp(-((2 * np.pi * sigma * frequencies) ** 2) * least)
    for column in forces.T if lowest < 1 else ():
        power = _rayleigh_of_grid(column, frequencies)
        power = np.where(power > np.maximum(usual, 0.5), power, 0.0)
        k = int(np.argmax(power))
        if power[k] > best:
            best, where = float(power[k]), _step(column, frequencies[max(k - 1, 0) : k + 2])
    p = -np.expm1(3 * steps * np.log1p(-np.exp(-min(n * best, 700.0)))) if best else 1.0
    remark = f"readings in steps of {1e3 * where:.2f} mm/s²" if best else "no steps in the readings"
    return NoiseTest(STEPS, n * best, float(min(p, 1.0)), (where,), remark)


def _rayleigh(values: Array, frequencies: Array) -> Array:
    """Rayleigh power of values at frequencies, in [0, 1]."""
    return np.asarray(np.abs(np.exp(2j * np.pi * np.outer(frequencies, values)).mean(axis=1)) ** 2)


def _rayleigh_of_grid(values: Array, frequencies: Array) -> Array:
    """Likewise at equally spaced frequencies: phases of a coarse grid times those of a fine one."""
    width = int(np.ceil(np.sqrt(len(frequencies))))
    fine = frequencies[:width] - frequencies[0]
    total = np.zeros((len(frequencies[::width]), width), dtype=complex)
    for part in np.array_split(values, len(values) // 4096 + 1):
        coarse = np.exp(2j * np.pi * np.outer(frequencies[::width], part))
        total += coarse @ np.exp(2j * np.pi * np.outer(part, fine))
    return np.asarray(np.abs(total.ravel()[: len(frequencies)] / len(values)) ** 2)


def _step(values: Array, around: Array) -> float:
    """Largest step of which values are multiples, given frequencies around a peak of the power.

    Multiples of q are multiples of q/2, q/3, … too, so that the peak may be any of these.
    """
    near = np.linspace(around[0], around[-1], 201)
    peak = near[np.argmax(_rayleigh(values, near))]
    divisors = np.arange(1, 31)
    power = _rayleigh(values, peak / divisors)
    return float(divisors[power > 0.99 * power[0]].max() / peak)
