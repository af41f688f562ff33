"""Simulated sessions: noise as ordered, reproducible draws, and what is known of the holds."""

import math

import numpy as np
import pytest

from accelstudy.adjustment import calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.units import MGON, STANDARD_GRAVITY
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import roll_pitch
from accelstudy.schemes import get_scheme
from accelstudy.sensors.models import get_model
from accelstudy.simulation.sessions import Noise, session, sigma_of_mean

G = STANDARD_GRAVITY
MODEL = get_model("bias-scale-nonorthogonality")
TRUTH = MODEL.vector({"b_x": 0.05, "s_y": 200e-6, "alpha_zx": 44 * MGON})
DIRECTIONS = get_scheme("mclaren-24").directions
IDEAL = session(MODEL, TRUTH, DIRECTIONS)


def draw(replicates, seed=1, **noise):
    return IDEAL.draw(Noise(**noise), replicates, np.random.default_rng(seed))


def test_noise_of_the_paper_is_the_default():
    noise = Noise()
    assert noise.sigma_force == 0.002
    assert noise.sigma_angle == pytest.approx(3.2e-3 * math.pi / 200)
    assert noise.sigma_gravity == noise.gravity_error == 0


def test_a_session_without_noise():
    np.testing.assert_allclose(IDEAL.f_b, -G * DIRECTIONS, rtol=1e-14)
    np.testing.assert_allclose(IDEAL.forces, MODEL.sense(-G * DIRECTIONS, TRUTH), rtol=1e-14)
    np.testing.assert_allclose(IDEAL.angles.T, roll_pitch(tuple(IDEAL.f_b.T)), rtol=1e-14)
    observed = IDEAL.observations(Noise())
    np.testing.assert_array_equal(observed.forces, IDEAL.forces[None])
    np.testing.assert_array_equal(observed.angles, IDEAL.angles[None])
    assert observed.gravity.tolist() == [G]


def test_the_sensor_feels_the_reaction_to_gravity():
    """Level is z down, along gravity, and reads −g."""
    level = session(MODEL, np.zeros(9), np.array([[0.0, 0.0, 1.0]]))
    np.testing.assert_allclose(level.forces, [[0, 0, -G]], atol=1e-14)
    np.testing.assert_allclose(level.angles, [[0, 0]], atol=1e-14)


def test_moments_of_the_noise():
    replicates = 2000
    observed = draw(replicates, sigma_force=0.003, sigma_angle=2e-4, sigma_gravity=0.01)
    errors = {
        "forces": ((observed.forces - IDEAL.forces) / 0.003).reshape(replicates, -1),
        "angles": ((observed.angles - IDEAL.angles) / 2e-4).reshape(replicates, -1),
        "gravity": ((observed.gravity - G) / 0.01)[:, None],
    }
    for standardised in errors.values():
        n = standardised.size
        assert abs(standardised.mean()) < 4.5 / math.sqrt(n)
        assert abs(standardised.std() - 1) < 4.5 / math.sqrt(2 * n)
        assert abs((standardised**3).mean()) < 4.5 * math.sqrt(15 / n)
        assert abs((standardised**4).mean() - 3) < 4.5 * math.sqrt(96 / n)
    together = np.concatenate([*errors.values()], axis=1)
    correlation = np.corrcoef(together.T)[np.triu_indices(together.shape[1], 1)]
    # The largest of 7 260 independent correlations; 5.5 standard errors is 1 in 3 600.
    assert np.abs(correlation).max() < 5.5 / math.sqrt(replicates)


def test_a_seed_gives_the_same_session_and_another_a_different_one():
    one, same, other = draw(3), draw(3), draw(3, seed=2)
    np.testing.assert_array_equal(one.forces, same.forces)
    np.testing.assert_array_equal(one.angles, same.angles)
    assert not np.any(one.forces == other.forces)


def test_successive_draws_of_a_generator_differ():
    rng = np.random.default_rng(1)
    first, second = (IDEAL.draw(Noise(), 2, rng) for _ in range(2))
    np.testing.assert_array_equal(first.forces, draw(2).forces)
    assert not np.any(first.forces == second.forces)


def test_what_is_drawn_does_not_depend_on_the_sizes():
    """Common random numbers: with another sigma the same errors come, only larger."""
    small, large = draw(4), draw(4, sigma_force=0.02, sigma_angle=0.0, sigma_gravity=1.0)
    np.testing.assert_allclose(
        large.forces - IDEAL.forces, 10 * (small.forces - IDEAL.forces), rtol=0, atol=1e-13
    )
    np.testing.assert_array_equal(large.angles, np.broadcast_to(IDEAL.angles, (4, 24, 2)))


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


def test_order_of_the_draws():
    rng = np.random.default_rng(1)
    forces = rng.standard_normal((4, 24, 3))
    angles = rng.standard_normal((4, 24, 2))
    gravity = rng.standard_normal(4)
    observed = draw(4, sigma_gravity=0.01)
    np.testing.assert_allclose(observed.forces, IDEAL.forces + 0.002 * forces, rtol=1e-14)
    np.testing.assert_allclose(observed.angles, IDEAL.angles + 3.2 * MGON * angles, rtol=1e-13)
    np.testing.assert_allclose(observed.gravity, G + 0.01 * gravity, rtol=1e-14)


def test_both_approaches_see_the_same_forces():
    """The reading of the robot does not change what the gravity-based calibration gets."""
    gravity = get_approach("gravity")
    with_robot = calibrate(MODEL, gravity, draw(3))
    other_robot = calibrate(MODEL, gravity, draw(3, sigma_angle=1.0))
    np.testing.assert_array_equal(with_robot.parameters, other_robot.parameters)


def test_a_wrong_gravity_is_believed_but_not_felt():
    observed = draw(2, gravity_error=1e-3)
    np.testing.assert_array_equal(observed.gravity, [G + 1e-3, G + 1e-3])
    np.testing.assert_array_equal(observed.forces, draw(2).forces)


@pytest.mark.parametrize(
    ("rate", "duration", "n"), [(100, 2, 200), (50, 2, 100), (1, 1, 1), (0.1, 2, 1), (100, 0, 1)]
)
def test_sigma_of_the_mean_of_a_position(rate, duration, n):
    assert sigma_of_mean(0.02, rate, duration) == pytest.approx(0.02 / math.sqrt(n), rel=1e-14)


def test_sigma_of_the_mean_by_simulation():
    means = np.random.default_rng(3).normal(0, 0.02, (5000, 200)).mean(axis=1)
    expected = sigma_of_mean(0.02, 100, 2)
    assert means.std() == pytest.approx(expected, rel=4.5 / math.sqrt(2 * 5000))


# --- what is known of the holds ------------------------------------------------------------------


def test_attitude_of_the_holds():
    np.testing.assert_array_equal(IDEAL.hold.roll, IDEAL.angles[:, 0])
    np.testing.assert_array_equal(IDEAL.hold.pitch, IDEAL.angles[:, 1])


def test_the_first_position_makes_no_step():
    hold = IDEAL.hold
    step = np.stack([hold.step_x, hold.step_y, hold.step_z], axis=1)
    np.testing.assert_array_equal(step[1:], IDEAL.f_b[1:] - IDEAL.f_b[:-1])
    np.testing.assert_array_equal(step[0], 0)


def test_columns_of_the_caller_are_kept():
    temperature, time = np.linspace(-5, 20, 24), 30.0 * np.arange(24)
    known = session(
        MODEL, TRUTH, DIRECTIONS, hold=HoldConditions(temperature=temperature, time=time)
    ).hold
    np.testing.assert_array_equal(known.temperature, temperature)
    np.testing.assert_array_equal(known.time, time)
    assert known.vibration is None
    np.testing.assert_array_equal(known.roll, IDEAL.hold.roll)
    assert draw(1).hold is IDEAL.hold
