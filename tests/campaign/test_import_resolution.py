"""Readings in coarse steps: the step, what rounding leaves in a mean, holds without a change."""

import numpy as np
import pytest
from calling import refused, succeed
from log_helpers import find_holds, opened, session, table, write

import accelstudy as acs
from accelstudy.basics.units import STANDARD_GRAVITY as G
from accelstudy.campaign.format import read_campaign
from accelstudy.campaign.importing.noise import noise_before_rounding, rounding_of_mean, step_of
from accelstudy.schemes import get_scheme

BIAS, SCALE = np.array([0.12, -0.08, 0.2]), 1 + 1e-6 * np.array([4000, -3000, 6000])


def log_in_steps(step, noise=0.02):
    """A log in 26 attitudes, read in steps, and its true forces; the cube is turned by hand."""
    rng = np.random.default_rng(7)
    held = get_scheme("faces-edges-corners-26").directions + 0.02 * rng.standard_normal((26, 3))
    held = SCALE * G * held / np.linalg.norm(held, axis=1, keepdims=True) + BIAS
    forces, _ = session(sigma=noise, still=500, forces=held)
    return np.round(forces / step) * step if step else forces, held


@pytest.mark.parametrize("step", [0.1, G / 64])
@pytest.mark.parametrize("noise", [0.001, 0.02, 0.05])
def test_all_holds_of_coarse_readings_are_found_and_their_sigma_is_right(tmp_path, step, noise):
    """The error of the means, known here, is within what their sigma says."""
    read, exact = log_in_steps(step, noise)
    holds = find_holds(opened(tmp_path, read))
    assert len(holds.table) == 26
    assert not holds.warnings or "does not change" not in "".join(holds.warnings)
    np.testing.assert_allclose(holds.windows.steps, step, rtol=1e-5)
    error = holds.means - exact
    # 78 errors: their rms is known to 8 %, the noise before rounding not much better.
    assert np.sqrt(np.mean(error**2)) == pytest.approx(holds.noise.sigma, rel=0.4)


@pytest.mark.parametrize("ratio", [0.05, 0.2, 0.4])
def test_what_rounding_leaves_in_a_mean(ratio):
    """Against a simulation: the mean of many rounded samples of forces anywhere in a step."""
    rng = np.random.default_rng(3)
    force, step = rng.uniform(-0.5, 0.5, (1500, 1)), 1.0
    read = np.round(force + ratio * rng.standard_normal((1500, 4000), np.float32))
    sd = np.sqrt(np.mean(read.var(axis=1, ddof=1)))
    error = np.sqrt(max(np.mean((read.mean(axis=1) - force[:, 0]) ** 2) - sd**2 / 4000, 0.0))
    assert rounding_of_mean(step, sd) == pytest.approx(error, rel=0.05, abs=0.002)
    assert noise_before_rounding(step, sd) == pytest.approx(ratio, rel=0.05, abs=0.005)


@pytest.mark.parametrize(("readings", "step"), [
    (np.arange(-5, 9) * 0.1, 0.1),
    (np.unique(np.round(np.arange(-64, 99) * G / 64, 2)), G / 64),  # the file rounds as well
    # Whole mg of a sensor with steps of 3.9, which was bumped.
    (np.round(3.9 * np.r_[-200:200, 500, 1234]) * G / 1e3, 3.9e-3 * G),
    (np.array([-3, -2, 4, 9, 10, 40]) * 0.25 + 0.07, 0.25),
    (np.sort(np.random.default_rng(1).normal(size=300)), 0.0),
    (np.arange(5) * 3.0, 0.0),  # no sensor is so coarse
    (np.array([1.0, 2.0]), 0.0),
])  # fmt: skip
def test_the_step_of_readings(readings, step):
    assert step_of(readings) == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("step", [0.1, 0.001])
def test_the_step_is_said_kept_and_counts_in_the_verdict(tmp_path, step):
    """Of a fine log nothing is said."""
    path = write(tmp_path, log_in_steps(step)[0])
    result = succeed("import", path, "--rate", 100, "--out", tmp_path / "c", "--no-figure")
    said = "quantisation: readings in steps of 0.1 m/s²" if step == 0.1 else "quantisation"
    assert (said in result.output) == (step == 0.1)
    assert "does not change" not in result.output
    campaign = read_campaign(tmp_path / "c")
    if step < 0.1:
        assert campaign.header.resolution_mps2 is None
        return
    np.testing.assert_allclose(campaign.header.resolution_mps2, 0.1)
    # Noise of 20 mm/s² lets some 10 of the 29 mm/s² of plain rounding through.
    assert 0.007 < campaign.sigma_force < 0.014
    calibrated = succeed("calibrate", tmp_path / "c", "--out", tmp_path / "r").output
    assert "ACCEPTED" in calibrated
    assert "quantisation" in calibrated


# --- Saturation ----------------------------------------------------------------------------------


def saturated(read, full_range=None):
    """Blocks of readings that are left out."""
    how = {"block": 40, "threshold": 10, "range": full_range}
    return [*acs.find_holds(table(read), **how).reasons]


def faces(seed):
    """Short holds of calm turns, so that the extremes of the log are those of its faces."""
    held = G * np.repeat(np.concatenate([np.eye(3), -np.eye(3)]), 40, axis=0)
    return held + 0.02 * np.random.default_rng(seed).standard_normal(held.shape)


@pytest.mark.parametrize("step", [0.006, 0.02, 0.1, G / 64])
def test_a_pile_at_the_extreme_that_the_steps_explain_is_no_saturation(step):
    for seed in range(6):
        assert saturated(np.round(faces(seed) / step) * step) == []


def test_with_a_range_only_the_range_counts():
    read = np.minimum(faces(1), G)
    assert len(saturated(read)) == 3
    assert saturated(read, 8 * G) == []
    with refused("saturated in all blocks"):
        saturated(read, G)


# --- Short rests ---------------------------------------------------------------------------------


def test_short_rests_are_counted_with_the_option_that_takes_them(tmp_path):
    forces, _ = session(2, holds=12, still=[400, 200, 200, 200], moving=150)
    path = write(tmp_path, forces)
    words = ("import", path, "--rate", 100, "--out", tmp_path / "c", "--no-figure", "--force")
    result = succeed(*words)
    assert "(3 positions)" in result.stdout
    assert "9 rests of 2.0 s are no hold: it takes 2.4 s" in " ".join(result.stderr.split())
    option = result.stderr.split("--shortest ")[1].split()[0]
    assert "(12 positions)" in succeed(*words, "--shortest", option).stdout
    assert "(12 positions)" in succeed(*words, "--window", 0.5).stdout


def test_positions_in_whole_g_that_fit_to_the_last_digit_end_in_one_line():
    held = np.eye(3)[[0, 1, 2, 0, 1, 2, 1]] * np.array([1, 1, 1, -1, -1, -1, 1])[:, None]
    campaign = acs.find_holds(table(np.repeat(held, 40, axis=0)), block=40, unit="g", threshold=50)
    assert campaign.sigma_force is None
    with refused("fit the model 'bias' to the last digit", "too coarse", "sensor_noise.sigma_mps2"):
        acs.calibrate(campaign, model="bias")
