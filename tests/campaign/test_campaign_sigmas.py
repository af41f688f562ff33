"""Sigmas that a calibration quotes where its noise is estimated: intervals, and their check."""

import math

import numpy as np
import pytest
from campaign_helpers import made, simulated_campaign
from log_helpers import table
from usual import GRAVITY, NINE

import accelstudy as acs
from accelstudy.adjustment import Observations, calibrate
from accelstudy.campaign.calibration.fit import fit_campaign
from accelstudy.campaign.calibration.sigma_check import check_sigmas
from accelstudy.campaign.calibration.wording import sentences
from accelstudy.schemes import get_scheme
from accelstudy.simulation.sessions import Noise

G, SIGMA, SESSIONS = 9.81, 0.002, 4000
BIAS, SCALE = np.array([0.05, -0.03, 0.08]), np.array([2e-3, -2e-3, 1e-3])
ERROR = math.sqrt(0.05 * 0.95 / SESSIONS)
"""Monte Carlo error of a coverage of 95 %."""


def sessions():
    """Readings (R, 24, 3) of a sensor with biases and scales."""
    f_b = -G * get_scheme("fibonacci-24").directions
    noise = np.random.default_rng(12).standard_normal((SESSIONS, 24, 3))
    return (1 + SCALE) * f_b + BIAS + SIGMA * noise


def check(errors, sigmas, needed):
    """Errors and sigmas (R, k): so many sigmas hold 95 %, where 1.96 of them hold 93.1 %."""
    inside = np.mean(np.abs(errors) < needed * sigmas, axis=0)
    assert np.abs(inside - 0.95).max() < 4.5 * ERROR
    normal = np.mean(np.abs(errors) < 1.96 * sigmas, axis=0)
    assert np.abs(normal - 0.931).max() < 4.5 * math.sqrt(0.931 * 0.069 / SESSIONS)


def test_the_intervals_of_a_calibration_hold_95_percent():
    """24 positions and 9 parameters: r = 15."""
    forces = sessions()
    campaign = made(forces[0], G)
    one = acs.calibrate(campaign, approach="gravity")
    fit, needed = one.fit, one.content["sigmas_95"]
    assert one.content["redundancy"] == 15
    assert needed == pytest.approx(2.131, abs=5e-4)  # of any table of Student's t
    assert [p["ci95"] for p in one.content["parameters"]] == pytest.approx(needed * fit.sigma)
    assert "2.13 sigmas hold 95 % (Student's t, 15 degrees" in sentences(fit, "sigmas")[0]

    adjusted = calibrate(NINE, GRAVITY, Observations(forces, sigma_force=SIGMA, gravity=G))
    truth = np.concatenate([BIAS, SCALE, np.zeros(3)])
    check(adjusted.parameters - truth, adjusted.sigma_posteriori, needed)

    known = acs.calibrate(campaign.with_sigma(SIGMA), approach="gravity")
    needed = known.content["sigmas_95"]
    assert needed == pytest.approx(1.96, abs=5e-5)
    inside = np.mean(np.abs(adjusted.parameters - truth) < needed * adjusted.sigma_priori, axis=0)
    assert np.abs(inside - 0.95).max() < 4.5 * ERROR

    few = acs.calibrate(made(forces[0, ::-1][:13], G))
    for calibration, said in ((few, "up to 2.78 sigmas"), (one, ""), (known, "")):  # r = 4
        leveled = calibration.apply(table([[0.1, 0.2, -9.8]]))
        warned = [warning for warning in leveled.attrs["warnings"] if "sigmas" in warning]
        assert len(warned) == bool(said)
        assert all(said in warning for warning in warned)


def test_a_wrong_noise_does_not_show_in_simulation_and_is_said():
    """Each reading stands twice: its errors seem to be averaged, and the sigmas come out small."""
    once = simulated_campaign({"b_x": 0.1}, seed=4)
    twice = made(np.repeat(once.forces, 2, axis=0), once.gravity)
    honest, fooled = (fit_campaign(each, NINE, GRAVITY) for each in (once, twice))
    assert (fooled.sigma < 0.8 * honest.sigma).all()
    table = check_sigmas(fooled, replicates=1000, seed=3)
    assert np.abs(table["ratio"] - 1).max() < 4.5 / math.sqrt(2 * 1000)
    assert "no ratio can show" in sentences(fooled, "finds")[0]
    assert "the global test tells" in sentences(honest, "finds")[0]
    refuted = once.with_sigma(1e-4)
    found = sentences(fit_campaign(refuted, NINE, GRAVITY), "finds")[0]
    assert "has the noise in the residuals" in found
    few = simulated_campaign({"b_x": 0.1}, scheme="d-optimal-9", noise=Noise(0.002))
    assert "nothing tells" in sentences(fit_campaign(few, NINE, GRAVITY), "finds")[0]


def test_a_robot_hardly_shows_the_noise_of_a_better_sensor():
    """By all residuals together intervals held 0.75; with a sigma of ν = 6 Student's t had 380."""
    inside = []
    for seed in range(40):
        one = acs.simulate_campaign(seed=seed, scheme="fibonacci-9", robot_sigma="60mgon")
        calibration = acs.calibrate(one.with_sigma(None))
        ends = calibration.intervals()
        true = [p["value"] for effect in one.truth["sensor"] for p in effect["parameters"]]
        inside.append(np.mean((ends["low"] < true) & (true < ends["high"])))
    assert np.mean(inside) > 0.95
    parameters = calibration.content["parameters"]
    assert all(p["sigma"] == pytest.approx(p["sigma_posteriori"]) for p in parameters)
    halves = [p["ci95"] for p in parameters]
    assert np.allclose(ends["high"] - ends["low"], 2 * np.array(halves))
    assert not acs.advise(one.with_sigma(None), tilt_accuracy="1deg").enough
    stated = {"sigma_mps2": SIGMA, "degrees_of_freedom": 6.0}
    assert 6 < acs.calibrate(one.with_header(sensor_noise=stated)).fit.dof < 9


def test_a_refuted_noise_is_that_of_forces_and_of_angles():
    """As if only the forces were noisier, ratios were 1.06 to 1.23."""
    drawn = acs.simulate_campaign(seed=3, scheme="fibonacci-14").with_sigma(5e-4)
    one = acs.calibrate(drawn)
    assert one.state == "rejected"
    ratio = check_sigmas(one.fit, replicates=1000, seed=6)["ratio"]
    assert np.abs(ratio - 1).max() < 4.5 / math.sqrt(2 * 1000)


def test_residuals_tell_nothing_of_the_sigma_of_gravity():
    """The noise is stated thrice too large, or is an estimate; gravity is as uncertain as ever."""
    drawn = simulated_campaign({}, noise=Noise(0.002), sigma=0.006)
    of_gravity = {"value_mps2": drawn.gravity, "sigma_mps2": 0.02}
    refuted = drawn.with_header(gravity=of_gravity)
    pooled = refuted.with_header(sensor_noise={"sigma_mps2": 0.003, "degrees_of_freedom": 9.0})
    sure = refuted.with_header(sensor_noise={"sigma_mps2": 0.002, "degrees_of_freedom": 1e12})
    for campaign, state in ((refuted, "rejected"), (pooled, "accepted"), (sure, "accepted")):
        one = acs.calibrate(campaign, approach="gravity")
        assert one.state == state
        assert "The sigmas contain that of gravity, 20.0 mm/s²." in one.verdict
        table = check_sigmas(one.fit, replicates=1000, seed=5)
        assert np.abs(table["ratio"] - 1).max() < 4.5 / math.sqrt(2 * 1000)
