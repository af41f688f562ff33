"""Simulated sessions: noise as ordered, reproducible draws."""

import math

import numpy as np
import pytest
from usual import NINE, G

from accelstudy.basics.units import MGON
from accelstudy.leveling.angles import roll_pitch
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise, session, sigma_of_mean

TRUTH = NINE.vector({"b_x": 0.05, "s_y": 200e-6, "alpha_zx": 44 * MGON})
DIRECTIONS = get_scheme("mclaren-24").directions
IDEAL = session(NINE, TRUTH, DIRECTIONS)


def draw(replicates, seed=1, **noise):
    return IDEAL.draw(Noise(**noise), replicates, np.random.default_rng(seed))


def test_a_session_without_noise():
    np.testing.assert_allclose(IDEAL.f_b, -G * DIRECTIONS, rtol=1e-14)
    np.testing.assert_allclose(IDEAL.forces, NINE.sense(-G * DIRECTIONS, TRUTH), rtol=1e-14)
    np.testing.assert_allclose(IDEAL.angles.T, roll_pitch(tuple(IDEAL.f_b.T)), rtol=1e-14)
    observed = IDEAL.observations(Noise())
    np.testing.assert_array_equal(observed.forces, IDEAL.forces[None])
    np.testing.assert_array_equal(observed.angles, IDEAL.angles[None])
    assert observed.gravity.tolist() == [G]


@pytest.mark.parametrize(("force", "angle", "of_g"), [(0.002, 3.2 * MGON, 0.01), (0.02, 0.0, 1.0)])
def test_noise_is_standard_normals_in_order_times_the_sigmas(force, angle, of_g):
    """Common random numbers: another seed gives others, and another sigma the same, larger."""
    rng = np.random.default_rng(1)
    forces, angles = rng.standard_normal((4, 24, 3)), rng.standard_normal((4, 24, 2))
    gravity = rng.standard_normal(4)
    observed = draw(4, sigma_force=force, sigma_angle=angle, sigma_gravity=of_g)
    np.testing.assert_allclose(observed.forces, IDEAL.forces + force * forces, rtol=1e-14)
    np.testing.assert_allclose(observed.angles, IDEAL.angles + angle * angles, rtol=1e-13)
    np.testing.assert_allclose(observed.gravity, G + of_g * gravity, rtol=1e-14)
    assert observed.forces.tobytes() == draw(4, sigma_force=force).forces.tobytes()


def test_the_readings_of_the_robot_are_not_drawn_where_nothing_needs_them():
    for noise in (Noise(), Noise(sigma_gravity=0.01), Noise(effects=("coloured_noise",))):
        whole = IDEAL.draw(noise, 3, np.random.default_rng(1))
        rng = np.random.default_rng(1)
        part = IDEAL.draw(noise, 3, rng, angles=False)
        assert part.forces.tobytes() == whole.forces.tobytes()
        assert part.gravity.tobytes() == whole.gravity.tobytes()
        if noise == Noise():
            after = np.random.default_rng(1)
            after.standard_normal((3, 24, 3))
            assert rng.standard_normal() == after.standard_normal()


@pytest.mark.parametrize(
    ("rate", "duration", "n"), [(100, 2, 200), (50, 2, 100), (1, 1, 1), (0.1, 2, 1), (100, 0, 1)]
)
def test_sigma_of_the_mean_of_a_position(rate, duration, n):
    assert sigma_of_mean(0.02, rate, duration) == pytest.approx(0.02 / math.sqrt(n), rel=1e-14)
