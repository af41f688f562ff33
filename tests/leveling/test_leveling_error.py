"""The tilt error that a calibration leaves, against brute force and against closed forms."""

import numpy as np
import pytest
from leveling_helpers import leveling_error
from usual import NINE, PAPER, PAPER_TRUTH, G

from accelstudy.basics.units import GON, MGON
from accelstudy.effects import HoldConditions
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import ATTITUDES, attitudes_in_use, cap_forces, tilt_error
from accelstudy.sensors.models import compose

# What the gravity-based calibration of 24 positions leaves.
SIGMA = np.repeat([0.707e-3, 102e-6, 10.26 * MGON], 3)
BIAS = compose("bias", ("bias",))
CUBIC = compose("cubic", ("bias", "scale", "nonorthogonality", "cubic_scale"))


def brute_force(simulated, truth, estimated, estimates, f_b, g=G):
    """Level every attitude with every calibration, without any linearisation; rms (R, 2)."""
    output = simulated.sense(f_b, truth, g)
    outputs = np.broadcast_to(output, (len(estimates), *f_b.shape))
    error = angles_of(estimated.correct(outputs, estimates, g)) - angles_of(f_b)
    return np.sqrt(np.mean(error**2, axis=1))


def estimates_about(center, sigma):
    return center + sigma * np.random.default_rng(1).standard_normal((200, len(center)))


# --- attitudes -----------------------------------------------------------------------------------


@pytest.mark.parametrize("attitudes", [1, 60, 200, 4000])
@pytest.mark.parametrize("tilt", [10 * GON, 50 * GON, 99 * GON])
def test_attitudes_are_spread_evenly_over_the_cap(tilt, attitudes):
    f_b = cap_forces(tilt, attitudes, 9.81)
    assert attitudes <= len(f_b) <= max(7, 1.2 * attitudes)
    np.testing.assert_allclose(np.linalg.norm(f_b, axis=1), 9.81, rtol=1e-14)
    u = -f_b / 9.81
    assert np.arccos(u[:, 2]).max() < tilt
    # Uniform over a cap: z is uniform in (cos tilt, 1), and the azimuth over the circle.
    depth = (1 - u[:, 2]) / (1 - np.cos(tilt))
    for power in range(1, 8):
        assert np.mean(depth**power) == pytest.approx(1 / (power + 1), rel=1e-12)
    if attitudes >= 60:
        np.testing.assert_allclose(u[:, :2].mean(axis=0), 0, atol=1e-14)
        square = np.mean(1 - u[:, 2] ** 2) / 2
        np.testing.assert_allclose(u[:, :2].T @ u[:, :2] / len(u), square * np.eye(2), atol=1e-14)


@pytest.mark.parametrize(("tilt", "digits"), [(10, 1e-12), (50, 1e-9), (80, 3e-5)])
def test_the_mean_over_attitudes_is_that_over_the_cap(tilt, digits):
    """Biases that are wrong by σ: σ/g in pitch, σ/(g cos θ) in roll, integrated in closed form."""
    sigma, z = 0.002, np.cos(tilt * GON)
    ideal = np.zeros(3)
    error = tilt_error(BIAS, ideal, BIAS, ideal, cap_forces(tilt * GON, ATTITUDES, 9.81), 9.81)
    roll, pitch = error.rms_of_all(sigma**2 * np.eye(3))
    assert pitch == pytest.approx(sigma / 9.81, rel=1e-12)
    assert roll == pytest.approx(sigma / 9.81 * np.sqrt(-np.log(z) / (1 - z)), rel=digits)


def test_all_positions_of_a_calibration_count_alike():
    """Of 5000 positions in which a sensor grew warm, the first 200 counted."""
    for n in (7, 180, 5000):
        order = np.linspace(0, 1, n)
        used = attitudes_in_use(HoldConditions(order=order), G)[1].order
        assert np.mean(used**2) == pytest.approx(np.mean(order**2), rel=0.02)


# --- brute force ---------------------------------------------------------------------------------


@pytest.mark.parametrize("g", [9.78, 9.83])
def test_an_effect_that_the_model_lacks(g):
    """Bias of the model and scatter of the calibration together."""
    f_b = cap_forces(40 * GON, 50, g)
    truth = CUBIC.vector({**PAPER_TRUTH, "k3_x": 100e-6, "k3_y": 60e-6, "k3_z": -900e-6})
    estimates = estimates_about(PAPER, SIGMA)
    error = leveling_error(CUBIC, truth, NINE, estimates, f_b, g)
    expected = brute_force(CUBIC, truth, NINE, estimates, f_b, g)
    np.testing.assert_allclose(error.per_replicate, expected, rtol=5e-3)
    without = leveling_error(NINE, PAPER, NINE, estimates, f_b, g)
    assert (error.rms > 1.2 * without.rms).all()


def test_a_large_error_of_the_mean_is_not_linearised():
    f_b = cap_forces(50 * GON, 40)
    estimates = np.tile(BIAS.vector({}), (3, 1))
    truth = BIAS.vector({"b_x": 1.5, "b_y": -2.0, "b_z": 1.0})  # tilts of 10 gon
    error = leveling_error(BIAS, truth, BIAS, estimates, f_b)
    expected = brute_force(BIAS, truth, BIAS, estimates, f_b)
    np.testing.assert_allclose(error.per_replicate, expected, rtol=1e-12)
    assert error.rms.min() > 5 * GON


# --- closed forms --------------------------------------------------------------------------------


def test_roll_wraps():
    """Upside down, roll lies beside ±π, and an error across it is still small."""
    f_b = np.array([[0.0, -1e-6, G]])
    error = leveling_error(BIAS, np.array([0, 2e-3, 0]), BIAS, np.zeros((1, 3)), f_b)
    np.testing.assert_allclose(error.rms[0], 2e-3 / G, rtol=1e-3)


def test_rms_of_all_follows_from_the_covariance_alone():
    """That is how it is known of calibrations that nobody kept."""
    truth = CUBIC.vector(PAPER_TRUTH) + np.array([0] * 9 + [1e-4, 2e-4, -1e-4])
    estimates = estimates_about(PAPER, SIGMA)
    f_b = cap_forces(0.8, 40)
    error = tilt_error(CUBIC, truth, NINE, estimates.mean(axis=0), f_b)
    found = error.rms_of_all(np.cov(estimates.T, bias=True))
    expected = leveling_error(CUBIC, truth, NINE, estimates, f_b).rms
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    # About another reference, a few standard deviations away, it is the same in the fourth digit.
    elsewhere = tilt_error(CUBIC, truth, NINE, estimates[0], f_b).rms(estimates)
    np.testing.assert_allclose(elsewhere, error.rms(estimates), rtol=1e-3)
