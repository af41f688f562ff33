"""Calibrations of one simulated sensor, compared by function and by command."""

import numpy as np
import pandas as pd
from scipy.stats import chi2
from session_helpers import SENSOR, calibrated

import accelstudy as acs
from accelstudy.basics.units import GON, MGON
from accelstudy.basics.units import STANDARD_GRAVITY as G
from accelstudy.campaign.calibration.leveling import level
from accelstudy.epochs.history import History
from accelstudy.leveling.angles import angles_of, wrap_angle
from accelstudy.leveling.error import cap_forces


def sensor(seed, **options):
    return calibrated(seed, **options).sensor


def compare(first, second):
    return History((first, second), (), 50 * GON)


def test_the_change_of_roll_and_pitch_is_that_of_readings():
    first = sensor(1)
    second = sensor(2, effects=("bias: 0.1, 0.07, -0.1", *SENSOR[1:]))
    c = compare(first, second)
    forces = cap_forces(50 * GON, 5000, second.gravity)
    readings = first.model.sense(forces, first.parameters)
    apart = wrap_angle(angles_of(second.correct(readings)) - angles_of(forces))
    rms = np.sqrt(np.mean(apart**2, axis=0)) / MGON
    np.testing.assert_allclose([c.tilt.roll_mgon, c.tilt.pitch_mgon], rms, rtol=0.01)
    assert [c.parameters[i].name for i in c.change.fewest_changes] == ["b_y"]


def test_one_of_many_residuals_is_too_small_by_chance():
    """In 160 histories of 16 sessions whose noise was stated rightly, 14 said changed."""
    campaign = acs.simulate_campaign(approach="gravity", seed=3)
    known = sensor(2)
    squares = acs.calibrate(campaign).content["quality"]["global_test"]["statistic"]
    for p_value, dof in ((4e-3, 15), (8e-3, np.inf)):
        sigma = 0.002 * np.sqrt(squares / chi2.ppf(p_value / 2, 15))
        one = acs.calibrate(campaign.with_sigma(float(sigma)))
        assert one.state == "rejected"
        both = compare(one.sensor, known)
        priori = [p["sigma_priori"] for p in one.content["parameters"]]
        assert both.dof.tolist() == [dof, np.inf]
        assert np.allclose(both.sigmas[0], priori) == np.isinf(dof)


def test_another_gravity_is_said_to_change_the_scales():
    one, other = sensor(1), sensor(1, gravity=G * (1 + 200e-6))
    assert "in one place, this alone changes each scale by 200 ppm" in compare(one, other).verdict
    assert "Gravity" not in compare(one, one).verdict


def test_a_rejected_calibration_is_not_used_without_a_word():
    one, other = sensor(1), sensor(2, effects=(*SENSOR, "quadratic_scale: 1e-3, 0, 0"))
    assert "noise allows: session-2. What changed may be" in compare(one, other).verdict
    log = pd.DataFrame([[0.0, 0, -G]], columns=["fx", "fy", "fz"])
    assert ["rejected" in " ".join(level(x, log).warnings) for x in (one, other)] == [False, True]
