"""Tests of the stochastic model by the residuals: level, axes, colour, tails, noise within holds.

Those of axes, colour and tails need no sigma. Their statistics are shares of the residuals, and
simulations of white Gaussian noise, equal on all axes, in the same adjustment show what is usual.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality import global_test
from accelstudy.diagnosis.evidence.chance import Chance
from accelstudy.diagnosis.evidence.noise.colour import quadratic_forms
from accelstudy.diagnosis.evidence.noise.kinds import AXES, COLOUR, LEVEL, TAILS, NoiseTest
from accelstudy.diagnosis.space.residuals import Residuals, position_products

Array = NDArray[np.float64]


def force_residuals(residuals: Residuals, errors: Array) -> Array:
    """Residuals of the forces in units of sigma, up to sign, (..., n, 3), of errors (..., m)."""
    return np.stack(position_products(errors, residuals.force_noise), axis=-1)


def level_test(residuals: Residuals) -> NoiseTest:
    """Whether the residuals are as large as sigma says, two-sided (the global test)."""
    factor = residuals.variance
    omega = factor * residuals.redundancy
    test = global_test(omega, residuals.redundancy)
    assert test is not None
    size = "larger" if factor > 1 else "smaller"
    return NoiseTest(
        LEVEL,
        omega,
        min(test.p_value, 1.0),
        (factor,),
        f"the residuals are {np.sqrt(max(factor, 1 / factor)):.3g} times {size} than sigma says",
    )


def axis_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether one axis is noisier than the others."""

    def shares(errors: Array) -> Array:
        v = force_residuals(residuals, errors)
        squares = np.sum(v**2, axis=-2)
        return np.asarray(squares / np.sum(squares, axis=-1, keepdims=True))

    usual = chance.statistic(residuals, shares)
    mean, scale = usual.mean(axis=0), usual.std(axis=0)
    statistic = float(np.max(np.abs(shares(residuals.z) - mean) / scale))
    p = _upper(np.max(np.abs(usual - mean) / scale, axis=-1), statistic)
    factors = axis_factors(residuals)
    return NoiseTest(
        AXES,
        statistic,
        p,
        tuple(factors),
        "variance factors of the axes " + ", ".join(f"{k:.2f}" for k in factors),
    )


def axis_factors(residuals: Residuals) -> Array:
    """Variance factors of the three axes (MINQUE with equal a-priori weights), (3,), at least 0.

    The noise of the axes has the covariance Σ κ_a G_a G_aᵀ in z, G_a = R F_a; the rest, up to I, is
    that of the robot's angles. With t_ia = U_iᵀ f_ia, of position i, G_aᵀ G_b has the elements
    δ_ij f_iaᵀ f_ib − t_iaᵀ t_jb, of which only sums of squares are needed.
    """
    n, c = residuals.whitening.shape[:2]
    f = residuals.force_noise
    t = np.einsum("ncu,nca->nau", residuals.absorbed[: n * c].reshape(n, c, -1), f)
    own, taken = np.einsum("nca,ncb->nab", f, f), np.einsum("nau,nbu->nab", t, t)
    normal = np.einsum("nau,nav->auv", t, t)
    left = np.sum(own**2 - 2 * own * taken, axis=0) + np.einsum("auv,buv->ab", normal, normal)
    angles = np.einsum("naa->a", own - taken) - left.sum(axis=1)
    right = np.sum(force_residuals(residuals, residuals.z) ** 2, axis=0) - angles
    return np.maximum(np.linalg.lstsq(left, right, rcond=1e-9)[0], 0.0)


def colour_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether the residuals of holds close in time are alike."""

    def statistics(errors: Array) -> Array:
        total = np.sum(errors**2, axis=-1)
        return quadratic_forms(force_residuals(residuals, errors)) / total[..., None]

    usual = chance.statistic(residuals, statistics)
    mean, scale = usual.mean(axis=0), usual.std(axis=0)
    statistic = float(np.max((statistics(residuals.z) - mean) / scale))
    v = force_residuals(residuals, residuals.z)
    successive = float(np.sum(v[1:] * v[:-1]) / np.sum(v**2))
    return NoiseTest(
        COLOUR,
        statistic,
        _upper(np.max((usual - mean) / scale, axis=-1), statistic),
        (successive,),
        f"residuals of successive holds are correlated by {successive:.2f}".replace("-", "−"),
    )


def tail_test(residuals: Residuals, chance: Chance) -> NoiseTest:
    """Whether large residuals are more frequent than a normal distribution has them."""
    scale = np.sqrt(np.maximum(1 - np.sum(residuals.absorbed**2, axis=1), 0.0))
    controlled = scale > 0.05

    def kurtosis(errors: Array) -> Array:
        squares = (errors[..., controlled] / scale[controlled]) ** 2
        return np.asarray(np.mean(squares**2, axis=-1) / np.mean(squares, axis=-1) ** 2)

    value = float(kurtosis(residuals.z))
    return NoiseTest(
        TAILS,
        value,
        _upper(chance.statistic(residuals, kurtosis), value),
        (value,),
        f"kurtosis of the residuals {value:.1f}",
    )


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
    ratio = scatter / white
    return NoiseTest(
        COLOUR,
        ratio,
        float(special.fdtrc(residuals.redundancy, freedom, ratio)),
        (float(np.sqrt(white)),),
        f"white noise within the holds explains {1e3 * np.sqrt(white):.2f} of "
        f"{1e3 * np.sqrt(scatter):.2f} mm/s² of a position mean",
        by_holds=True,
    )


def _upper(usual: Array, value: float) -> float:
    """Share of simulated values that are as large."""
    return float((1 + np.count_nonzero(usual >= value)) / (1 + len(usual)))


def most_evidence(p: float) -> float:
    """Log of the largest evidence that a p-value can mean (Sellke, Bayarri & Berger 2001).

    −e p log p is the least Bayes factor for the null, over all alternatives of a usual form; from
    1/e on a p-value means nothing.
    """
    return float(-np.log(-np.e * p * np.log(p))) if p < 1 / np.e else 0.0
