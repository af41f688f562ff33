"""Tests of the noise: its level, axes, colour, tails and resolution, and the noise within holds.

Those of axes, colour and tails need no sigma. Their statistics are shares of the residuals, and
simulations of white Gaussian noise, equal on all axes, in the same adjustment show what is usual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import global_test
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.evidence.noise_models import colour_kernels
from accelstudy.diagnosis.space.hypotheses import clusters
from accelstudy.diagnosis.space.residuals import Residuals

Array = NDArray[np.float64]

LEVEL, AXES, COLOUR, TAILS = "noise_level", "axis_noise", "coloured_noise", "heavy_tails"
STEPS = "quantisation"
NOISES = {
    LEVEL: "the residuals are larger than sigma says, and have no pattern",
    AXES: "the axes differ in noise",
    COLOUR: "the noise lasts longer than a hold, or differs from hold to hold",
    TAILS: "large residuals are more frequent than in a normal distribution",
    STEPS: "the readings are coarse",
}
"""The reason that is given for each kind of wrong noise."""


@dataclass(frozen=True)
class NoiseTest:
    """One test of the stochastic model.

    Attributes
    ----------
    name : str, the noise effect that it looks for
    statistic : float
    p_value : float
    values : tuple of float, what the data say of it: variance factor, variance factors of the
        axes, correlation of successive holds, kurtosis, resolution in m/s²
    remark : str
    by_holds : bool, whether it is measured by the noise within the holds
    """

    name: str
    statistic: float
    p_value: float
    values: tuple[float, ...]
    remark: str
    by_holds: bool = False


def force_residuals(residuals: Residuals, errors: Array) -> Array:
    """Residuals of the forces in units of sigma, up to sign, (..., n, 3), of errors (..., m)."""
    n, c = residuals.whitening.shape[:2]
    blocks = errors[..., : n * c].reshape(*errors.shape[:-1], n, c)
    return np.asarray(np.einsum("...nc,nca->...na", blocks, residuals.force_noise))


def level_test(residuals: Residuals, sigma_dof: float = np.inf) -> NoiseTest:
    """Whether the residuals are as large as sigma says, two-sided (the global test)."""
    factor = residuals.variance
    test = global_test(factor * residuals.redundancy, residuals.redundancy, sigma_dof=sigma_dof)
    assert test is not None
    times, size = np.sqrt(max(factor, 1 / factor)), "larger" if factor > 1 else "smaller"
    remark = f"the residuals are {times:.3g} times {size} than sigma says"
    return NoiseTest(LEVEL, test.statistic, min(test.p_value, 1.0), (factor,), remark)


def axis_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether one axis is noisier than the others."""

    def shares(errors: Array) -> Array:
        squares = np.sum(force_residuals(residuals, errors) ** 2, axis=-2)
        return np.asarray(squares / np.sum(squares, axis=-1, keepdims=True))

    factors = axis_factors(residuals)
    remark = "variance factors of the axes " + ", ".join(f"{k:.2f}" for k in factors)
    statistic, p = _largest(residuals, chance, shares, np.abs)
    return NoiseTest(AXES, statistic, p, tuple(factors), remark)


def axis_factors(residuals: Residuals) -> Array:
    """Variance factors of the three axes (MINQUE with equal a-priori weights), (3,), at least 0.

    The noise of the axes has the covariance Σ κ_a G_a G_aᵀ in z, G_a = R F_a; the rest, up to I, is
    that of the robot's angles. With t_ia = U_iᵀ f_ia, of position i, G_aᵀ G_b has the elements
    δ_ij f_iaᵀ f_ib − t_iaᵀ t_jb, of which only sums of squares are needed.
    """
    n, c = residuals.whitening.shape[:2]
    f = residuals.force_noise
    t = np.einsum("ncu,nca->nau", residuals.absorbed[: n * c].reshape(n, c, -1), f)
    shown, taken = np.einsum("nca,ncb->nab", f, f), np.einsum("nau,nbu->nab", t, t)
    normal = np.einsum("nau,nav->auv", t, t)
    left = np.sum(shown**2 - 2 * shown * taken, axis=0) + np.einsum("auv,buv->ab", normal, normal)
    angles = np.einsum("naa->a", shown - taken) - left.sum(axis=1)
    right = np.sum(force_residuals(residuals, residuals.z) ** 2, axis=0) - angles
    return np.maximum(np.linalg.lstsq(left, right, rcond=1e-9)[0], 0.0)


def colour_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether the residuals of holds close in time are alike."""
    kernels = colour_kernels(len(residuals.whitening))

    def statistics(errors: Array) -> Array:
        v, total = force_residuals(residuals, errors), np.sum(errors**2, axis=-1)
        forms = [np.sum(v * (kernel @ v), axis=(-2, -1)) for kernel in kernels]
        return np.stack(forms, axis=-1) / total[..., None]

    v = force_residuals(residuals, residuals.z)
    successive = float(np.sum(v[1:] * v[:-1]) / np.sum(v**2))
    remark = f"residuals of successive holds are correlated by {successive:.2f}".replace("-", "−")
    statistic, p = _largest(residuals, chance, statistics, np.asarray)
    return NoiseTest(COLOUR, statistic, p, (successive,), remark)


def _largest(
    residuals: Residuals,
    chance: Chance,
    statistics: Callable[[Array], Array],
    sided: Callable[[Array], Array],
) -> tuple[float, float]:
    """Largest of some statistics, each over its usual scatter about its mean, and its p-value."""
    usual, seen = statistics(chance.errors(residuals)), statistics(residuals.z)
    mean, scale = usual.mean(axis=0), usual.std(axis=0)
    value = float(np.max(sided(seen - mean) / scale))
    return value, _upper(np.max(sided(usual - mean) / scale, axis=-1), value)


def tail_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether large residuals are more frequent than a normal distribution has them."""
    scale = np.sqrt(np.maximum(1 - np.sum(residuals.absorbed**2, axis=1), 0.0))
    controlled = scale > 0.05

    def kurtosis(errors: Array) -> Array:
        squares = (errors[..., controlled] / scale[controlled]) ** 2
        return np.asarray(np.mean(squares**2, axis=-1) / np.mean(squares, axis=-1) ** 2)

    value = float(kurtosis(residuals.z))
    p = _upper(kurtosis(chance.errors(residuals)), value)
    return NoiseTest(TAILS, value, p, (value,), f"kurtosis of the residuals {value:.1f}")


def within_hold_test(
    residuals: Residuals, unit: float, sd: Array, n_samples: NDArray[np.int_]
) -> NoiseTest:
    """Whether the means scatter more than white noise within the holds explains.

    Holds of one sample do not show their noise, nor do samples that are all the same.

    Parameters
    ----------
    residuals : Residuals
    unit : float, m/s², σ of unit weight
    sd : (n, 3) array, m/s², of the samples within the holds
    n_samples : (n,) int array
    """
    several = n_samples > 1
    sd, n_samples = sd[several], n_samples[several]
    scatter = residuals.variance * unit**2
    if not sd.any():
        remark = "the holds say nothing of the noise within them"
        return NoiseTest(COLOUR, 0.0, 1.0, (0.0,), remark)
    white = float(np.mean(sd**2 / n_samples[:, None]))
    freedom = 3 * float(np.sum(n_samples - 1))
    ratio, sigma = scatter / white, float(np.sqrt(white))
    p = float(special.fdtrc(residuals.redundancy, freedom, ratio))
    remark = (
        f"white noise within the holds explains {1e3 * sigma:.2f} of "
        f"{1e3 * np.sqrt(scatter):.2f} mm/s² of a position mean"
    )
    return NoiseTest(COLOUR, ratio, p, (sigma,), remark, by_holds=True)


def _upper(usual: Array, value: float) -> float:
    """Share of simulated values that are as large."""
    return float((1 + np.count_nonzero(usual >= value)) / (1 + len(usual)))


def most_evidence(p: float) -> float:
    """Log of the largest evidence that a p-value can mean (Sellke, Bayarri & Berger 2001).

    −e p log p is the least Bayes factor for the null, over all alternatives of a usual form; from
    1/e on a p-value means nothing.
    """
    return float(-np.log(-np.e * p * np.log(p))) if p < 1 / np.e else 0.0


GRID_PROBABILITY = 1e-5
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
    least = 2 * special.gammaincinv((n - 1) / 2, GRID_PROBABILITY) / n if n > 1 else 0.0
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
    """Rayleigh power at equally spaced frequencies: phases of a coarse grid times a fine one's."""
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
