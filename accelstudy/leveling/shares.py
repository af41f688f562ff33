"""How much of the variance of roll and pitch each input causes, correlations included.

Shapley effects over a grid of attitudes, beside the total effects that
`accelstudy.leveling.sensitivity` has for inputs taken as independent (figures 5 and 6 of
Thalmann & Neuner 2018).

Where inputs are correlated, no part of the variance belongs to one of them alone. Owen (2014)
divides the variance among the inputs as a game divides its gain among the players (Shapley 1953).
The value of a set of inputs is the variance that it explains, v(u) = Var E(Y | X_u), and an input
gets what it adds to v on average over all orders in which the inputs could become known. So the
shares are not negative and sum to 1, whatever the correlations; of independent inputs of a linear
function they are the classic Sobol indices.

A linear function of normal inputs has them in closed form, since v(u) = g_uᵀ Σ_uu⁻¹ g_u with
g = Cov(X, Y) (Owen & Prieur 2017; Iooss & Prieur 2019). Groups of inputs that are independent of
each other can be treated one by one (Broto et al. 2019), so the effort depends on the largest group
of correlated inputs.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, product
from math import factorial

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from accelstudy.basics.arrays import Array
from accelstudy.basics.units import GON, STANDARD_GRAVITY
from accelstudy.leveling.angles import specific_force, tilt_by_output, tilt_slope
from accelstudy.leveling.sensitivity import FORCES, NEGLIGIBLE_VARIANCE, effects_table
from accelstudy.sensors.sensor import SensorModel

LINEAR_UP_TO = 0.01
"""Sd of roll and pitch, rad, up to which linear theory gives their variance to 3e-4 of it. Beyond,
near the roll pole, the shares are not defined."""
MIN_SHARE = 0.01
"""Share below which it does not matter which of two inputs is the larger."""
SHARE_TOLERANCE = 0.02
"""Relative difference of two shares up to which they count as equal.

With the sds of 100 000 calibrations the shares are uncertain by 0.6 %.
"""
SINGULAR = 1e-12
"""Eigenvalues of a correlation matrix below this share of the largest one count as zero."""


def leveling_shares(
    roll_gon: Sequence[float],
    pitch_gon: Sequence[float],
    sigma_force: float,
    model: SensorModel,
    parameters: Array,
    covariance: Array,
    g: float = STANDARD_GRAVITY,
) -> pd.DataFrame:
    """Shapley effects on roll and pitch over a grid of attitudes, where leveling is linear.

    Parameters
    ----------
    roll_gon, pitch_gon : the grid
    sigma_force : float, m/s², of each component of the sensor's output
    model, parameters : sensor model with its (u,) parameters, SI
    covariance : (u, u) array, SI, of the parameters
    g : float, m/s²

    Returns
    -------
    DataFrame
        output, roll_gon, pitch_gon, input, shapley_effect, total_effect (of the inputs taken as
        independent), sd_output_mgon, defined; where the output has no variance, or leveling is
        not linear within the errors, the effects are NaN and `defined` False.
    """
    names = [*FORCES, *model.parameter_names]
    covariances = np.zeros((len(names), len(names)))
    covariances[:3, :3] = sigma_force**2 * np.eye(3)
    covariances[3:, 3:] = covariance
    sigma = np.sqrt(np.diagonal(covariances))
    attitudes = np.array(list(product(roll_gon, pitch_gon))) * GON
    f_b = np.stack(specific_force(attitudes[:, 0], attitudes[:, 1], g), axis=-1)
    f_s = model.sense(f_b, parameters, g)
    at = model, parameters, f_s, f_b, g
    slopes = np.concatenate([tilt_by_output(*at), tilt_slope(*at)], axis=-1)
    shares, variance = linear_shapley(slopes.reshape(-1, len(names)), covariances)
    shares, variance = shares.reshape(slopes.shape), variance.reshape(slopes.shape[:2])
    total = (slopes * sigma) ** 2
    total /= np.maximum(total.sum(axis=-1, keepdims=True), np.finfo(float).tiny)
    linear = (variance <= LINEAR_UP_TO**2).all(axis=1, keepdims=True)
    defined = linear & (variance > NEGLIGIBLE_VARIANCE)
    shares[~defined] = total[~defined] = np.nan
    effects = {"shapley_effect": shares, "total_effect": total}
    return effects_table(roll_gon, pitch_gon, names, np.sqrt(variance), effects)


def order_changes(table: pd.DataFrame) -> pd.DataFrame:
    """Find the pairs of inputs whose order the correlations change.

    An input overtakes another if its Shapley effect is the larger of the two and its total effect
    the smaller, by more than `SHARE_TOLERANCE` of it, and each input has `MIN_SHARE` by one of the
    two.

    Parameters
    ----------
    table : DataFrame, as `leveling_shares` returns it; further columns tell analyses apart

    Returns
    -------
    DataFrame
        One row per pair: what it has of analysis, output, roll_gon and pitch_gon, `input` and
        `over`, the input that it overtakes.
    """
    labels = [c for c in ("analysis", "output", "roll_gon", "pitch_gon") if c in table]
    shares = ["input", "shapley_effect", "total_effect"]
    rows = table.loc[table["defined"].astype(bool), labels + shares]
    rows = rows[rows[shares[1:]].max(axis=1) >= MIN_SHARE]
    pairs = rows.merge(rows, on=labels, suffixes=("", "_over"))
    factor = 1 + SHARE_TOLERANCE
    now = pairs["shapley_effect"] > factor * pairs["shapley_effect_over"]
    before = factor * pairs["total_effect"] < pairs["total_effect_over"]
    pairs = pairs.loc[now & before, [*labels, "input", "input_over"]]
    return pairs.rename(columns={"input_over": "over"}).reset_index(drop=True)


def linear_shapley(slope: ArrayLike, covariance: ArrayLike) -> tuple[Array, Array]:
    """Shapley effects of normal inputs on linear outputs, exactly.

    The effort doubles with each input of the largest group of correlated ones.

    Parameters
    ----------
    slope : (k, d) array, derivatives of k outputs by d inputs
    covariance : (d, d) array, of the inputs

    Returns
    -------
    shares : (k, d) array, each row sums to 1; NaN where an output has no variance
    variance : (k,) array, of the outputs
    """
    slope, covariance = np.atleast_2d(np.asarray(slope, float)), np.asarray(covariance, float)
    gained = np.zeros_like(slope)
    for group in _groups(covariance):
        within = covariance[np.ix_(group, group)]
        gained[:, group] = _divided(within, slope[:, group] @ within)
    variance = np.einsum("ki,ij,kj->k", slope, covariance, slope)
    shares = gained / np.where(variance > 0, variance, np.nan)[:, None]
    return shares, variance


def _groups(covariance: Array) -> list[NDArray[np.int64]]:
    """Indices of the groups of correlated inputs; inputs without variance are in none."""
    from scipy.sparse.csgraph import connected_components  # slow to import; figures do without it

    varied = np.flatnonzero(np.diagonal(covariance) > 0)
    n, label = connected_components(covariance[np.ix_(varied, varied)] != 0, directed=False)
    return [varied[label == i] for i in range(n)]


def _divided(covariance: Array, with_output: Array) -> Array:
    """Variance that each of p inputs gets, (k, p), from the covariances with k outputs."""
    p = len(covariance)
    # Correlations instead of covariances, so that the inverses do not suffer from the units.
    sd = np.sqrt(np.diagonal(covariance))
    correlation, g = covariance / np.outer(sd, sd), (with_output / sd).T
    gained = np.zeros_like(g)
    for size in range(1, p + 1):
        members = np.array([*combinations(range(p), size)])
        inside = np.zeros((len(members), p))
        np.put_along_axis(inside, members, 1.0, axis=1)
        of_members = g[members]
        block = correlation[members[:, :, None], members[:, None, :]]
        explained = np.linalg.pinv(block, rcond=SINGULAR, hermitian=True) @ of_members
        value = np.einsum("spk,spk->sk", of_members, explained)
        joins = factorial(size - 1) * factorial(p - size) / factorial(p)
        misses = factorial(size) * factorial(p - size - 1) / factorial(p) if size < p else 0.0
        gained += (inside * joins - (1 - inside) * misses).T @ value
    return gained.T
