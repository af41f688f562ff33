"""Variance components: whether accelerometer and robot are as accurate as they are assumed to be.

With M = M₀ + Σ θ_i M_i the variance of the misclosures w, M_i = B Q_i Bᵀ, and

    W = M⁻¹ − M⁻¹ A (Aᵀ M⁻¹ A)⁻¹ Aᵀ M⁻¹,   q_i = wᵀ W M_i W w,   S_ij = tr(W M_i W M_j),

the factors θ on the a-priori variances obey S θ = q − S₀, iterated (Helmert; Koch 1999, chapter 3).
θ_i q_i is the share of group i in Ω, and θ_i tr(W M_i) its share r_i in the redundancy. Where
Helmert's step would give a negative factor, Förstner's step is taken instead, θ_i ← θ_i · (θ_i q_i
/ r_i) (1979, Ein Verfahren zur Schätzung von Varianz- und Kovarianzkomponenten). It has the same
fixed point and stays positive. The factor of an absent component goes to zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from accelstudy.adjustment.observations import Observations
from accelstudy.adjustment.quality import Solution, solve
from accelstudy.approaches import Approach
from accelstudy.basics.arrays import Array
from accelstudy.sensors.sensor import SensorModel

MAX_STEPS = 300
MAX_FITS = 10
STEP_TOLERANCE = 1e-6
"""Fraction of a standard deviation below which a step with given derivatives is the last."""
REFIT_TOLERANCE = 1e-3
"""Fraction of its sigma below which the change of a factor by a new adjustment is the last."""


@dataclass(frozen=True)
class VarianceComponents:
    """Factors on the variances of two groups, the accelerometer and the robot.

    Attributes
    ----------
    factors : (2,) array, on σ² of the forces and of the angles; 1 if the a-priori values are right
    sigma : (2,) array, standard deviations of the factors, √(2 S⁻¹), at the estimate
    converged : bool
    """

    factors: Array
    sigma: Array
    converged: bool


def variance_components(
    model: SensorModel, approach: Approach, observed: Observations
) -> VarianceComponents | None:
    """Estimate the variance components of one session; None if there are no two to estimate.

    There is nothing to estimate without a robot, with a group that is free of noise, or with
    positions that cannot separate the two groups. The factors are unbiased only if they are clearly
    above zero: one with a standard deviation of its own size is often cut off at zero, so its mean
    is too large.

    Parameters
    ----------
    model, approach, observed : as in `calibrate`, one session

    Raises
    ------
    InputError
        If the session has no solution.
    """
    if not (approach.uses_angles and np.any(observed.sigma_angle)):
        return None
    solution = solve(model, approach, observed)
    variances = solution.variances
    groups = np.zeros((2, *variances.shape))
    groups[0, :, :3], groups[1, :, 3:] = variances[:, :3], variances[:, 3:]

    estimate = _estimate(solution, groups, np.ones(2))
    for _ in range(MAX_FITS):
        if estimate is None:
            return None
        # The derivatives are taken at adjusted observations, which depend on the weights.
        force, angle = np.sqrt(estimate.factors)
        rescaled = replace(
            observed,
            sigma_force=force * np.asarray(observed.sigma_force),
            sigma_angle=angle * np.asarray(observed.sigma_angle),
        )
        before = estimate
        estimate = _estimate(solve(model, approach, rescaled), groups, before.factors)
        if estimate is not None and np.all(
            np.abs(estimate.factors - before.factors) <= REFIT_TOLERANCE * estimate.sigma
        ):
            return estimate
    return None if estimate is None else replace(estimate, converged=False)


def _estimate(solution: Solution, groups: Array, factors: Array) -> VarianceComponents | None:
    """Estimate the factors with the derivatives of one solution; None if S is singular.

    Apart from the part of A, all matrices of conditions by conditions have one block per position.
    So traces of products are sums over positions and products of (u, u) matrices: with
    G = (Aᵀ M⁻¹ A)⁻¹ and T_i = Aᵀ M⁻¹ M_i M⁻¹ A,

        tr(W M_i W M_j) = tr(M⁻¹ M_i M⁻¹ M_j) − 2 tr(G Aᵀ M⁻¹ M_i M⁻¹ M_j M⁻¹ A) + tr(G T_i G T_j).

    Observed gravity is a row of weight 1 in A, w and M; its weight stays as it is.
    """
    b = solution.jac_observations
    rows, errors = solution.prior
    m = np.einsum("nco,ino,ndo->incd", b, groups, b)
    design = np.concatenate([solution.jac_parameters.reshape(-1, rows.shape[1]), rows])
    length = np.linalg.norm(design, axis=0)
    a, rows = solution.jac_parameters / length, rows / length
    w = solution.misclosures
    prior = rows.T @ rows

    for _ in range(MAX_STEPS):
        try:
            inverse = np.linalg.inv(np.tensordot(factors, m, 1))
        except np.linalg.LinAlgError:  # factors without bounds, of numbers that are no session
            return None
        weighted = inverse @ a
        g = np.linalg.inv(_normal(a, weighted) + prior)
        # W w, by position; the row of observed gravity does not count in the components.
        x = g @ (np.einsum("ncu,nc->u", weighted, w) + rows.T @ errors)
        pw = np.einsum("ncd,nd->nc", inverse, w) - weighted @ x

        mk = m @ inverse  # M_i M⁻¹
        mka = m @ weighted  # M_i M⁻¹ A
        t = np.stack([_normal(weighted, part) for part in mka])
        gt = g @ t
        both = np.array([[_normal(one, inverse @ other) for other in mka] for one in mka])
        s = (
            np.einsum("incd,jndc->ij", mk, mk)
            - 2 * np.einsum("uv,ijvu->ij", g, both)
            + np.einsum("iuv,jvu->ij", gt, gt)
        )
        share = np.einsum("nc,incd,nd->i", pw, m, pw)
        trace = np.einsum("incc->i", mk) - np.einsum("iuu->i", gt)
        size = np.sqrt(np.maximum(np.diag(s), 0.0))  # rounding may make a factor near 0 negative
        if not np.all(size > 0) or np.linalg.cond(s / np.outer(size, size)) > 1e10:
            return None
        variances = np.diag(2 * np.linalg.inv(s))
        if not np.all(variances > 0):  # the rounding error of such factors
            return None
        target = np.linalg.solve(s, share - np.einsum("iuv,vu->i", gt, g @ prior))
        if np.any(target <= 0):
            # Förstner's step alone would creep towards zero where that is the solution.
            target = factors * np.minimum(share / trace, np.where(target <= 0, 0.5, np.inf))
        step = target - factors
        factors = target
        sigma = np.sqrt(variances)
        if np.all(np.abs(step) <= STEP_TOLERANCE * sigma):
            return VarianceComponents(factors, sigma, True)
    return VarianceComponents(factors, sigma, False)


def _normal(left: Array, right: Array) -> Array:
    """Σ leftᵀ right over positions, (u, v), of (n, c, u) and (n, c, v)."""
    flat = left.reshape(-1, left.shape[-1]).T
    return np.asarray(flat @ right.reshape(-1, right.shape[-1]))
