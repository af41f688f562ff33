"""Shapley effects: closed forms, the definition itself, and where leveling is linear."""

from itertools import permutations

import numpy as np
import pytest
from usual import GRAVITY, NINE, PAPER, G

from accelstudy.basics.units import GON
from accelstudy.design.estimability import estimability
from accelstudy.leveling.angles import specific_force, tilt_by_output, tilt_slope
from accelstudy.leveling.sensitivity import leveling_function, leveling_sensitivity
from accelstudy.leveling.shares import leveling_shares, linear_shapley, order_changes
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise

# Confidence intervals are of 95 %: 2.5 half widths are 4.9 standard deviations.
WIDTHS = 2.5


def random_covariance(d, seed):
    a = np.random.default_rng(seed).normal(size=(d, d))
    return a @ a.T


@pytest.mark.parametrize("rho", [-0.9, 0.0, 0.5, 1.0])
def test_two_correlated_inputs(rho):
    """Iooss & Prieur (2019), section 4.1."""
    (b1, b2), (s1, s2) = (1.0, 3.0), (2.0, 0.5)
    covariance = [[s1**2, rho * s1 * s2], [rho * s1 * s2, s2**2]]
    shares, variance = linear_shapley([b1, b2], covariance)
    common = rho * b1 * b2 * s1 * s2
    total = (b1 * s1) ** 2 + 2 * common + (b2 * s2) ** 2
    first = (b1 * s1) ** 2 * (1 - rho**2 / 2) + common + (b2 * s2) ** 2 * rho**2 / 2
    assert variance == pytest.approx(total)
    np.testing.assert_allclose(shares, [[first / total, 1 - first / total]])


def test_the_definition():
    """What each input adds to the explained variance, on average over all orders."""
    covariance, slope = random_covariance(4, 1), np.array([1.0, -2.0, 0.3, 0.0])
    with_output = covariance @ slope

    def explained(known):
        own = covariance[np.ix_(known, known)]
        return with_output[known] @ np.linalg.solve(own, with_output[known])

    gained = np.zeros(4)
    orders = list(permutations(range(4)))
    for order in orders:
        values = [0.0, *(explained(list(order[: j + 1])) for j in range(4))]
        gained[list(order)] += np.diff(values)
    shares, variance = linear_shapley(slope, covariance)
    np.testing.assert_allclose(shares[0] * variance, gained / len(orders))
    assert shares[0, 3] > 0.01  # of no influence of its own, but it tells of the others


def test_independent_groups_are_games_of_their_own():
    order = [3, 0, 5, 1, 4, 2]  # so that no group is in one piece
    blocks = [random_covariance(2, 2), random_covariance(4, 3)]
    slope = np.random.default_rng(4).normal(size=6)
    whole = np.zeros((6, 6))
    whole[:2, :2], whole[2:, 2:] = blocks
    shares, variance = linear_shapley(slope[order], whole[np.ix_(order, order)])
    shares = shares[0, np.argsort(order)]
    for part, block in zip((slice(0, 2), slice(2, 6)), blocks, strict=True):
        alone, its = linear_shapley(slope[part], block)
        np.testing.assert_allclose(shares[part], alone[0] * its / variance)
    # One group of all, connected by a correlation that is as good as none.
    whole[0, 5] = whole[5, 0] = 1e-13
    np.testing.assert_allclose(linear_shapley(slope, whole)[0][0], shares, rtol=1e-9)


# --- leveling ------------------------------------------------------------------------------------

NAMES = ["f_x", "f_y", "f_z", *NINE.parameter_names]
SIGMA_FORCE = 0.002


def shares_of(scheme, roll, pitch):
    found = estimability(get_scheme(scheme), NINE, GRAVITY, Noise())
    return leveling_shares(roll, pitch, SIGMA_FORCE, NINE, PAPER, found.cofactors)


def test_the_slope_is_the_derivative():
    attitude = np.array([30.0, -20.0]) * GON
    f_s = NINE.sense(np.array(specific_force(*attitude, G))[None], PAPER)
    mean, function = np.concatenate([f_s[0], PAPER]), leveling_function(attitude, NINE)
    step = 1e-5 * np.eye(len(NAMES))
    numeric = (function(mean + step) - function(mean - step)).T / 2e-5
    at = NINE, PAPER, f_s, NINE.correct(f_s, PAPER, G), G
    slope = np.concatenate([tilt_by_output(*at), tilt_slope(*at)], axis=-1)[0]
    np.testing.assert_allclose(slope, numeric, rtol=1e-6, atol=1e-8)


def test_total_effects_are_those_of_the_paper():
    """The linear ones beside the Shapley effects, against Sobol's method."""
    found = estimability(get_scheme("mclaren-24"), NINE, GRAVITY, Noise())
    sampled = leveling_sensitivity([0, 50], [25], SIGMA_FORCE, 256, 1, NINE, PAPER, found.sigma)
    table = shares_of("mclaren-24", [0, 50], [25])
    keys = ["output", "roll_gon", "pitch_gon", "input"]
    both = table.merge(sampled, on=keys, suffixes=("", "_sampled"), validate="one_to_one")
    assert len(both) == len(table)
    apart = (both["total_effect"] - both["total_effect_sampled"]).abs()
    assert (apart < WIDTHS * both["ci95"] + 1e-4).all()


def test_correlated_scales_gain_and_overtake_the_biases():
    """Roll depends on s_y − s_z, whose variance a correlation of −0.25 makes a quarter larger."""
    table = shares_of("mclaren-24", [0, 50], [0, 25])
    assert table["defined"].all()
    shares = table.set_index(["output", "roll_gon", "pitch_gon", "input"]).sort_index()
    tilted = shares.loc["roll", 50.0, 25.0]
    effects = tilted[["shapley_effect", "total_effect"]]
    gain = effects.loc[["s_x", "s_y", "s_z"]].sum() / effects.loc["b_y"]
    assert gain["shapley_effect"] / gain["total_effect"] == pytest.approx(1.25, rel=1e-3)
    assert effects.loc["s_x", "shapley_effect"] > 10 * effects.loc["s_x", "total_effect"]
    level = shares.loc["roll", 0.0, 0.0]
    np.testing.assert_allclose(level["shapley_effect"], level["total_effect"], atol=1e-4)

    changed = order_changes(table)
    at = changed[["output", "roll_gon", "pitch_gon"]].drop_duplicates().to_numpy().tolist()
    assert at == [["roll", 50.0, 25.0]]
    pairs = set(zip(changed["input"], changed["over"], strict=True))
    assert pairs == {("s_y", "b_y"), ("s_y", "b_z"), ("s_z", "b_y"), ("s_z", "b_z")}


def test_near_the_pole_shares_are_not_defined():
    """Linear theory still serves at a pitch of 90 gon, and fails at 0.01 gon from the pole."""
    table = shares_of("mclaren-24", [10], [90, 99.99])
    assert (table["defined"] == (table["pitch_gon"] == 90)).all()
    assert (table["shapley_effect"].notna() == table["defined"]).all()
