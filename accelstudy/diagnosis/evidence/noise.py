"""The evidence for wrong noise: its level, axes, colour, tails and resolution.

Axes and colour have a restricted likelihood. In the residual space (Harville 1974, restricted
maximum likelihood), with N an orthonormal basis of it, U one of the design, and Σ the covariance of
the noise,

    log|Nᵀ Σ N| = log|Σ| + log|Uᵀ Σ⁻¹ U|,
    zᵀ (Nᵀ Σ N)⁻¹ z = zᵀ Σ⁻¹ z − zᵀ Σ⁻¹ U (Uᵀ Σ⁻¹ U)⁻¹ Uᵀ Σ⁻¹ z.

Unequal axes: the variances of the axes have the ratios κ, log κ_i summing to zero. Residuals alone
say little of them where the redundancy is small, so κ has a prior: about equal axes, within a
factor of two or so, and where the noise within the holds is known, about its ratios.

Coloured noise: successive holds are correlated. The processes are those of `LENGTHS`: the
first-order Gauss–Markov process of `coloured_noise`, whose τ counts holds here, and a random walk,
min(i, j)/n. A process of strength s adds s K to the covariance of the residuals, as a smooth
function of the time does.

The tests of axes and colour have this log evidence as their statistic. That of the tails needs no
sigma: simulations of Gaussian noise in the same adjustment show what is usual.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import GlobalTest
from accelstudy.basics.arrays import Array
from accelstudy.basics.levels import REFUTATION_LEVEL
from accelstudy.diagnosis.evidence.detection import Chance
from accelstudy.diagnosis.evidence.size import Evidence, log_mean
from accelstudy.diagnosis.rules import RULES
from accelstudy.diagnosis.space.hypotheses import clusters
from accelstudy.diagnosis.space.residuals import Residuals
from accelstudy.noise_effects.coloured_noise import autocorrelation

LEVEL, AXES, COLOUR, TAILS = "noise_level", "axis_noise", "coloured_noise", "heavy_tails"
STEPS = "quantisation"
NOISES = {
    STEPS: "the readings are coarse",
    COLOUR: "the noise lasts longer than a hold, or differs from hold to hold",
    AXES: "the axes differ in noise",
    TAILS: "large residuals are more frequent than in a normal distribution",
    LEVEL: "the residuals are larger than sigma says, and have no pattern",
}
"""What may be wrong with the noise, the most specific first, and the reason that is given."""


@dataclass(frozen=True)
class NoiseTest:
    """One test of the stochastic model.

    Attributes
    ----------
    name : str, the noise effect that it looks for
    statistic : float
    p_value : float
    remark : str
    by_holds : bool, whether it is measured by the noise within the holds
    """

    name: str
    statistic: float
    p_value: float
    remark: str
    by_holds: bool = False


def force_residuals(residuals: Residuals) -> Array:
    """Residuals of the forces in units of sigma, up to sign, (n, 3)."""
    n, c = residuals.whitening.shape[:2]
    return np.einsum("nc,nca->na", residuals.z[: n * c].reshape(n, c), residuals.force_noise)


def level_test(test: GlobalTest) -> NoiseTest:
    """Whether the residuals are as large as sigma says, two-sided, by the global test."""
    factor = test.statistic / test.dof
    times, size = np.sqrt(max(factor, 1 / factor)), "larger" if factor > 1 else "smaller"
    remark = f"the residuals are {times:.3g} times {size} than sigma says"
    return NoiseTest(LEVEL, test.statistic, min(test.p_value, 1.0), remark)


def axis_test(residuals: Residuals, evidence: float) -> NoiseTest:
    """Whether the axes differ in noise, by the log evidence for that beside equal axes."""
    squares = np.sum(force_residuals(residuals) ** 2, axis=0)
    shares = tuple((squares / squares.sum()).tolist())
    remark = "shares of x, y and z in the residuals " + ", ".join(f"{k:.2f}" for k in shares)
    return NoiseTest(AXES, evidence, _bound(evidence), remark)


def colour_test(residuals: Residuals, evidence: float) -> NoiseTest:
    """Whether residuals of holds close in time are alike, by the log evidence for that."""
    v = force_residuals(residuals)
    successive = float(np.sum(v[1:] * v[:-1]) / np.sum(v**2))
    remark = f"residuals of successive holds are correlated by {successive:.2f}".replace("-", "−")
    return NoiseTest(COLOUR, evidence, _bound(evidence), remark)


def _bound(evidence: float) -> float:
    """Bound of a p-value: white noise gives as much log evidence with a probability of 1/e^x."""
    return float(np.exp(-max(evidence, 0.0)))


def tail_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether large residuals are more frequent than a normal distribution has them."""
    scale = np.sqrt(np.maximum(1 - np.sum(residuals.absorbed**2, axis=1), 0.0))
    controlled = scale > 0.05

    def kurtosis(errors: Array) -> Array:
        squares = (errors[..., controlled] / scale[controlled]) ** 2
        return np.asarray(np.mean(squares**2, axis=-1) / np.mean(squares, axis=-1) ** 2)

    value = float(kurtosis(residuals.z))
    usual = kurtosis(chance.errors(residuals))
    p = float((1 + np.count_nonzero(usual >= value)) / (1 + len(usual)))
    return NoiseTest(TAILS, value, p, f"kurtosis of the residuals {value:.1f}")


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
        return NoiseTest(COLOUR, 0.0, 1.0, "the holds say nothing of the noise within them")
    white = float(np.mean(sd**2 / n_samples[:, None]))
    freedom = 3 * float(np.sum(n_samples - 1))
    ratio, sigma = scatter / white, float(np.sqrt(white))
    p = float(special.fdtrc(residuals.redundancy, freedom, ratio))
    remark = (
        f"white noise within the holds explains {1e3 * sigma:.2f} of "
        f"{1e3 * np.sqrt(scatter):.2f} mm/s² of a position mean"
    )
    return NoiseTest(COLOUR, ratio, p, remark, by_holds=True)


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
    return NoiseTest(STEPS, n * best, float(min(p, 1.0)), remark)


def _rayleigh(values: Array, frequencies: Array) -> Array:
    """Rayleigh power of values at frequencies, in [0, 1]."""
    return np.asarray(np.abs(np.exp(2j * np.pi * np.outer(frequencies, values)).mean(axis=1)) ** 2)


def _rayleigh_of_grid(values: Array, frequencies: Array) -> Array:
    """Rayleigh power at equally spaced frequencies: phases of a coarse grid times a fine one's."""
    width = int(np.ceil(np.sqrt(len(frequencies))))
    fine = frequencies[:width] - frequencies[0]
    coarse = np.exp(2j * np.pi * np.outer(frequencies[::width], values))
    total = coarse @ np.exp(2j * np.pi * np.outer(values, fine))
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


LEAST_OF_REPEATS = 1e-12
"""Part of the squares that differences of repeats have at least."""


def worst_of(tests: Sequence[NoiseTest]) -> NoiseTest | None:
    """Return what is wrong with the noise, the most specific finding first."""
    level = next((t for t in tests if t.name == LEVEL), None)
    counted = [
        t
        for t in tests
        # A sigma that the residuals confirm knows of what varies from hold to hold.
        if not (t.by_holds and level is not None and level.p_value >= REFUTATION_LEVEL)
    ]
    others = RULES.level_noise / max(len(counted) - (level is not None), 1)
    failed = [t for t in counted if t.p_value < (REFUTATION_LEVEL if t is level else others)]
    return min(failed, key=lambda t: [*NOISES].index(t.name), default=None)


# --- repeated positions --------------------------------------------------------------------------


def lack_of_fit(residuals: Residuals, square: float, freedom: int) -> float:
    """p-value of the test whether repeats agree better with each other than with the model.

    It is the F test of all but the differences of repeats against these differences.

    Parameters
    ----------
    residuals : Residuals
    square, freedom : of the differences, by `square_of_repeats`
    """
    rest = residuals.redundancy - freedom
    if not freedom or not rest:
        return 1.0
    ratio = (float(residuals.z @ residuals.z) - square) / rest / (square / freedom)
    return float(special.fdtrc(rest, freedom, ratio))


def square_of_repeats(residuals: Residuals, same: Array) -> tuple[float, int]:
    """Square of the differences of repeated positions, and its degrees of freedom.

    Parameters
    ----------
    residuals : Residuals
    same : (m, l) array, orthonormal basis of what they have in common
    """
    z, freedom = residuals.z, residuals.redundancy - same.shape[1]
    whole = float(z @ z)
    # Coarse readings repeat exactly.
    return max(whole - float(np.sum((z @ same) ** 2)), LEAST_OF_REPEATS * whole), freedom


# --- likelihoods of unequal axes and of coloured noise -------------------------------------------

LOG_RATIOS = np.linspace(-2.5, 2.5, 9)
CONTRASTS = np.array([[2.0, -1.0, -1.0], [0.0, 1.0, -1.0]]) / np.sqrt([[6.0], [2.0]])


def unequal_axes_density(residuals: Residuals, evidence: Evidence, within: Array | None) -> float:
    """Log density of residuals with noise that differs from axis to axis, over the ratios.

    Parameters
    ----------
    residuals : Residuals, of a fit with equal axes
    evidence : Evidence
    within : (3,) array, variances within the holds; None if unknown
    """
    x, y = (values.ravel() for values in np.meshgrid(LOG_RATIOS, LOG_RATIOS))
    ratios = np.exp(np.column_stack([x, y]) @ CONTRASTS)
    determinant, squares = _restricted(residuals, ratios)
    densities = np.logaddexp.reduce(evidence.noise_density(squares, determinant), axis=-1)
    prior = _normal(x, y, np.zeros(3), RULES.spread_axes)
    if within is not None and np.all(within > 0):
        centre = np.log(within) - np.mean(np.log(within))
        prior = (prior + _normal(x, y, centre, RULES.spread_within)) / 2
    return float(log_mean(densities, prior))


def _normal(x: Array, y: Array, centre: Array, spread: float) -> Array:
    """Normal density on the grid of contrasts, which sums to 1."""
    a, b = CONTRASTS @ centre
    density = np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * spread**2))
    return np.asarray(density / density.sum())


def _restricted(residuals: Residuals, ratios: Array) -> tuple[Array, Array]:
    """log|Nᵀ Σ N| and zᵀ (Nᵀ Σ N)⁻¹ z for variances (g, 3) of the axes, (g,) each."""
    n, c = residuals.whitening.shape[:2]
    columns = np.column_stack([residuals.absorbed, residuals.z])
    blocks, rest = columns[: n * c].reshape(n, c, -1), columns[n * c :]
    f = residuals.force_noise
    covariance = np.eye(c) + np.einsum("ga,nca,nda->gncd", ratios - 1, f, f)
    weighted = (np.linalg.inv(covariance) @ blocks).reshape(len(ratios), n * c, -1)
    normal = columns[: n * c].T @ weighted + rest.T @ rest
    design, mixed, square = normal[:, :-1, :-1], normal[:, :-1, -1:], normal[:, -1, -1]
    explained = np.swapaxes(mixed, -1, -2) @ np.linalg.solve(design, mixed)
    determinant = np.sum(np.linalg.slogdet(covariance)[1], axis=1)
    return determinant + np.linalg.slogdet(design)[1], square - explained[:, 0, 0]


LENGTHS = (1.0, 3.0, 8.0, np.inf)
"""Correlation lengths in holds; infinite for the random walk."""
STRENGTHS = np.array([0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0])
"""Variances of the process, with white noise of 1, over which the evidence is averaged."""


def colour_kernels(n: int) -> Array:
    """Covariance of n holds by each process, (k, n, n)."""
    i = np.arange(n)
    walk = (np.minimum(i[:, None], i) + 1) / n
    lag = np.abs(i[:, None] - i)
    return np.stack([autocorrelation(lag, x) if np.isfinite(x) else walk for x in LENGTHS])


def coloured_density(residuals: Residuals, evidence: Evidence) -> float:
    """Log density of residuals with coloured noise, over lengths and strengths."""
    n, c = residuals.whitening.shape[:2]
    f, z, logs = residuals.force_noise, residuals.z, []
    for kernel in colour_kernels(n):
        covariance = np.einsum("ica,ij,jda->icjd", f, kernel, f).reshape(n * c, n * c)
        rows = residuals.project(np.pad(covariance, (0, len(z) - n * c)))
        values, vectors = np.linalg.eigh(residuals.project(rows.T))
        along, shares = (z @ vectors)[None] ** 2, np.maximum(values, 0.0)
        logs.append(evidence.densities_by_size(along, shares, np.array([z @ z]), STRENGTHS))
    return float(log_mean(np.concatenate(logs, axis=None)))
