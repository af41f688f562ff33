"""Redundancy numbers, and the errors that the tests of positions do not find."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from accelstudy.adjustment.quality.solution import Solution
from accelstudy.basics.units import GON
from accelstudy.effects import HoldConditions
from accelstudy.effects.hold_conditions import REFERENCE_TEMPERATURE
from accelstudy.leveling.angles import roll_pitch, tilt_slope
from accelstudy.leveling.error import MAX_TILT_GON, cap_forces

Array = NDArray[np.float64]

POWER = 0.8
"""Probability with which a detectable error or change is found."""
MIDPOINTS = 200
"""Number of nodes over an estimated variance, for the power of a test."""


@dataclass(frozen=True)
class Redundancy:
    """Shares of the observations in the redundancy; with the share of gravity they sum up to r.

    Attributes
    ----------
    observations : (n, o) array, diagonal of Q_vv Q⁻¹: share of an error that shows in v, 0 to 1
    positions : (n,) array, their sums, which are the traces of R
    gravity : float, of the observed gravity; None where it is fixed
    """

    observations: Array
    positions: Array
    gravity: float | None


def redundancy_numbers(solution: Solution) -> Redundancy:
    """Redundancy numbers of observations and positions (Baarda 1968; Koch 1999, chapter 4)."""
    observed = solution.observed.sigma_gravity > 0
    return Redundancy(
        observations=solution.shares,
        positions=np.einsum("ncc->n", solution.blocks),
        gravity=float(1 - np.sum(solution.basis[-1] ** 2)) if observed else None,
    )


@dataclass(frozen=True)
class Reliability:
    """Largest errors that the tests may miss; infinite where a position is not controlled.

    Attributes
    ----------
    noncentrality : float, λ0
    mdb : (n, c) array, m/s², minimal detectable error of |f_b| (gravity-based) or semi-axes of the
        ellipsoid of barely detectable errors of the vector f_b, ascending (robot)
    parameters : (n, u) array, SI, largest effect of such an error on each parameter
    leveling : (n, 2) array, rad, largest effect on roll and on pitch, rms over all tilts up to
        `max_tilt`
    """

    noncentrality: float
    mdb: Array
    parameters: Array
    leveling: Array


def noncentrality(
    dof: int, alpha: float = 0.001, power: float = POWER, noise_dof: float = np.inf
) -> float:
    """λ0 at which a test of level `alpha` has `power`; 17.075 by default for one dof.

    The test is χ² where the noise is known; else F, whose noise has `noise_dof` degrees of freedom.
    """
    if np.isinf(noise_dof):
        return float(special.chndtrinc(special.chdtri(dof, alpha), dof, 1 - power))
    from scipy import optimize, stats  # slow to import, and seldom needed

    # A mean over χ²(ν), as the noncentral F of SciPy has no numbers for some ν.
    evenly = (np.arange(MIDPOINTS) + 0.5) / MIDPOINTS
    ratios = stats.chi2.ppf(evenly, noise_dof) / noise_dof
    limits = dof * stats.f.isf(alpha, dof, noise_dof) * ratios

    def missed(size: float) -> float:
        return float(np.mean(stats.ncx2.cdf(limits, dof, size))) - (1 - power)

    most = 1e4
    while missed(most) > 0:
        most *= 10
    return float(optimize.brentq(missed, 1e-6, most))


def reliability(
    solution: Solution,
    alpha: float = 0.001,
    power: float = POWER,
    max_tilt: float = MAX_TILT_GON * GON,
    attitudes: int = 64,
) -> Reliability:
    """Minimal detectable errors and their effects (Baarda 1968; Teunissen 2006).

    Leveling is taken at the reference temperature, at time zero, without vibration and without a
    change of position, where effects depend on such things.

    Parameters
    ----------
    solution : Solution
    alpha, power : float, of the single test
    max_tilt : float, rad
    attitudes : int, least number of attitudes over which leveling is averaged
    """
    n, c = solution.misclosures.shape
    root, rank = solution.root
    lambda0 = noncentrality(c, alpha, power)

    # Barely detectable errors are ∇ = √λ0 L H s with a unit vector s; maxima are over s.
    axes = np.linalg.svd(solution.whitening @ root, compute_uv=False)[:, ::-1]
    a = solution.design[: n * c].reshape(n, c, -1)
    on_parameters = solution.cofactors @ np.swapaxes(a, 1, 2) @ root
    slope = _leveling_slope(solution, max_tilt, attitudes)
    # The largest singular value of the changes of all attitudes, by their sum of squares.
    squares = np.einsum("kau,kav->auv", slope, slope) / len(slope)
    on_level = on_parameters[:, None, : slope.shape[-1]]
    on_leveling = np.swapaxes(on_level, 2, 3) @ squares @ on_level
    largest = np.sqrt(np.maximum(np.linalg.eigvalsh(on_leveling)[..., -1], 0.0))

    def scaled(values: NDArray[np.floating]) -> Array:
        return np.where((rank == c)[:, None], np.sqrt(lambda0) * values, np.inf)

    return Reliability(
        noncentrality=lambda0,
        mdb=scaled(axes),
        parameters=scaled(np.linalg.norm(on_parameters, axis=-1)),
        leveling=scaled(largest),
    )


def _leveling_slope(solution: Solution, max_tilt: float, attitudes: int) -> Array:
    """Derivatives of roll and pitch by the model's parameters, (k, 2, u); 0 by those of the rig."""
    model, g = solution.model, solution.gravity
    p = np.where(model.stays, solution.parameters[: model.n_parameters], 0.0)
    f_b = cap_forces(max_tilt, attitudes, g)
    roll, pitch = roll_pitch(tuple(f_b.T))
    at_rest = dict.fromkeys(HoldConditions.columns(), np.zeros(len(f_b)))
    reference = np.full(len(f_b), REFERENCE_TEMPERATURE)
    hold = HoldConditions(**{**at_rest, "roll": roll, "pitch": pitch, "temperature": reference})
    return tilt_slope(model, p, model.sense(f_b, p, g, hold), f_b, g, hold) * model.stays
