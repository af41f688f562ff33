"""Noise effects: each has the distribution that it says, and none changes what is without it."""

import math

import numpy as np
import pytest
from scipy import stats
from study_helpers import grid, make_cells
from usual import NINE

from accelstudy.effects import HoldConditions
from accelstudy.noise_effects import get_noise_effect, noise_effect_names
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session

SIGMA, R = 0.003, 4000
TIME = np.cumsum(np.linspace(30, 90, 24))
DIRECTIONS = get_scheme("mclaren-24").directions
IDEAL = session(NINE, np.zeros(9), DIRECTIONS, hold=HoldConditions(time=TIME))


def errors(*effects, seed=1, ideal=IDEAL, sigma=SIGMA):
    """Errors of the forces over sigma, (R, n, 3)."""
    noise = Noise(sigma_force=sigma, effects=effects)
    drawn = ideal.draw(noise, R, np.random.default_rng(seed))
    return (drawn.forces - ideal.forces) / sigma


def near_variance(values, expected, kurtosis=3.0):
    """Whether the mean square of independent values is that expected, within 4.5 MC errors."""
    n = values.size
    return abs(np.mean(values**2) / expected - 1) < 4.5 * math.sqrt((kurtosis - 1) / n)


def test_nothing_changes_without_effects_and_nothing_but_the_forces_with_them():
    plain = IDEAL.draw(Noise(), 3, np.random.default_rng(1))
    other = IDEAL.draw(Noise(effects=("coloured_noise",)), 3, np.random.default_rng(1))
    forces = IDEAL.forces + 0.002 * np.random.default_rng(1).standard_normal((3, 24, 3))
    np.testing.assert_array_equal(plain.forces, forces)
    assert not np.any(other.forces == plain.forces)
    np.testing.assert_array_equal(other.angles, plain.angles)
    np.testing.assert_array_equal(other.gravity, plain.gravity)
    assert other.sigma_force == plain.sigma_force


@pytest.mark.parametrize("name", noise_effect_names())
def test_a_noise_effect_has_a_spec_and_follows_from_the_seed(name):
    np.testing.assert_array_equal(errors(name), errors(name))
    assert not np.all(errors(name) == errors(name, seed=2))
    effect = get_noise_effect(name)
    again = get_noise_effect(effect.spec)
    assert type(again) is type(effect)
    assert again.settings == pytest.approx(effect.settings, rel=1e-11)
    low, high = effect.typical
    assert 0 < low < high
    assert effect.equation


def test_noise_level():
    v = errors("noise_level(kappa=4)")
    np.testing.assert_allclose(v, 2 * errors(), rtol=0, atol=1e-9)
    np.testing.assert_allclose(get_noise_effect("noise_level(kappa=4)").within_hold, 2)


def test_axis_noise():
    v = errors("axis_noise(kappa_x=0.25, kappa_y=1, kappa_z=9)")
    for i, kappa in enumerate((0.25, 1, 9)):
        assert near_variance(v[..., i], kappa)
    np.testing.assert_allclose(
        get_noise_effect("axis_noise(kappa_z=9)").within_hold, [1, 1, 3], rtol=1e-14
    )


@pytest.mark.parametrize("known_time", [True, False], ids=["time", "number"])
def test_coloured_noise_is_a_stationary_gauss_markov_process(known_time):
    share, tau = 0.7, 300.0 if known_time else 3.0
    ideal = IDEAL if known_time else session(NINE, np.zeros(9), get_scheme("mclaren-24").directions)
    time = TIME if known_time else np.arange(24.0)
    v = errors(f"coloured_noise(share={share}, tau={tau})", ideal=ideal)
    total = 1 / (1 - share)
    # Replicates and axes are independent; holds are not.
    sample = np.moveaxis(v, 1, 2).reshape(-1, 24)
    covariance = sample.T @ sample / len(sample)
    expected = total * share * np.exp(-np.abs(np.subtract.outer(time, time)) / tau) + np.eye(24)
    # Var of a product of two normal variables: c_ij² + c_ii c_jj.
    deviation = np.sqrt((expected**2 + total**2) / len(sample))
    # The largest of 300 pairs.
    assert np.abs((covariance - expected) / deviation).max() < 5


def test_heavy_tails_are_student_with_the_variance_of_sigma():
    nu = 9.0
    v = errors(f"heavy_tails(nu={nu})").ravel()
    # The kurtosis of t is 3 + 6/(ν − 4).
    assert near_variance(v, 1.0, kurtosis=3 + 6 / (nu - 4))
    student = stats.t(nu, scale=math.sqrt((nu - 2) / nu))
    assert stats.kstest(v, student.cdf).pvalue > 1e-4
    assert stats.kstest(v, stats.norm.cdf).pvalue < 1e-6


def test_quantisation_is_the_last_thing_that_happens():
    lsb = 0.01
    noise = Noise(sigma_force=SIGMA, effects=(f"quantisation(lsb={lsb})", "noise_level(kappa=4)"))
    forces = IDEAL.draw(noise, 5, np.random.default_rng(1)).forces
    white = 2 * SIGMA * np.random.default_rng(1).standard_normal((5, 24, 3))
    expected = lsb * np.round((IDEAL.forces + white) / lsb)
    np.testing.assert_allclose(forces, expected, rtol=0, atol=1e-12)


# --- in a study ----------------------------------------------------------------------------------


def test_seeds_of_cells_without_noise_effects_are_those_of_old():
    """Words of a seed as they were before there were noise effects and conditions of the holds."""
    cell = make_cells(grid(), seed=2018)["bias-scale-nonorthogonality/mclaren-24/robot"]
    assert cell.seed(2018, 3).generate_state(2).tolist() == [4071928413, 2252154610]
