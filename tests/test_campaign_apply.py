"""A calibration applied to readings, and leveling with its sigmas."""

import json

import numpy as np
import pytest
from test_campaign_fit import GRAVITY, NINE, ROBOT, simulated_campaign

from accelstudy.campaign.applying import read_calibration
from accelstudy.campaign.document import calibration_document
from accelstudy.campaign.fit import fit_campaign
from accelstudy.errors import InputError
from accelstudy.leveling import specific_force
from accelstudy.units import GON

TRUTH = {"b_x": 0.05, "b_y": 0.01, "s_z": 2e-4, "alpha_zx": 7e-4}


def calibration_file(folder, approach=ROBOT, seed=1):
    fit = fit_campaign(simulated_campaign(TRUTH, seed=seed), NINE, approach)
    path = folder / "calibration.json"
    path.write_text(json.dumps(calibration_document(fit), allow_nan=False), encoding="utf-8")
    return path


def test_the_file_gives_back_the_fit(tmp_path):
    fit = fit_campaign(simulated_campaign(TRUTH), NINE, GRAVITY)
    read = read_calibration(calibration_file(tmp_path, GRAVITY))
    np.testing.assert_array_equal(read.parameters, fit.parameters)
    np.testing.assert_allclose(np.sqrt(np.diag(read.covariance)), fit.sigma, rtol=1e-12)
    np.testing.assert_allclose(read.correct(fit.campaign.forces), fit.corrected, atol=1e-12)


def test_sigmas_of_leveling_hold_over_calibrations_and_readings(tmp_path):
    """Errors of roll and pitch over 300 calibrations, each with a reading, against the sigma."""
    attitude = np.array([30 * GON, -20 * GON])
    f_b = np.array(specific_force(*attitude, 9.80665))
    f_s = NINE.sense(f_b[None], NINE.vector(TRUTH))[0]
    rng = np.random.default_rng(5)
    errors, sigmas = [], []
    for seed in range(300):
        calibration = read_calibration(calibration_file(tmp_path, seed=seed))
        reading = f_s + 0.001 * rng.standard_normal(3)
        angles, sigma = calibration.level(reading[None], 0.001)
        errors.append(angles[0] - attitude)
        sigmas.append(sigma[0])
    normalised = np.array(errors) / np.array(sigmas)
    assert np.abs(normalised.mean(axis=0)).max() < 4 / np.sqrt(300)
    assert np.abs(normalised.std(axis=0) - 1).max() < 4 / np.sqrt(2 * 300)


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"parameters": 3}', "\x00"])
def test_what_is_no_calibration_is_one_line(tmp_path, content):
    path = tmp_path / "calibration.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_calibration(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="No such file"):
        read_calibration(tmp_path / "none.json")
