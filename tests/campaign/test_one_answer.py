"""What a campaign determines, and how good it is, is the same in every command."""

import numpy as np
import pandas as pd
from calling import succeed
from campaign_helpers import made
from page_helpers import text_of

import accelstudy as acs
from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.format import write_campaign
from accelstudy.leveling.error import cap_forces
from accelstudy.schemes import get_scheme

CUBE = get_scheme("faces-edges-corners-26").directions


def written(folder, directions, seed, outside=None):
    """Write the campaign of a sensor with known errors and a noise of 2 mm/s²."""
    noise = 0.002 * np.random.default_rng(seed).standard_normal(directions.shape)
    forces = -9.80665 * directions * [1.004, 0.997, 1.006] + [0.12, -0.08, 0.2] + noise
    forces += 0 if outside is None else outside(directions)
    write_campaign(made(forces, sigma=0.002), folder)
    return folder


def test_the_tilt_error_of_a_calibration_is_one_number(tmp_path):
    """`advise` tells that of `calibrate`; two differ by √2 of it, and a reading adds its noise."""
    campaign = written(tmp_path / "made-up", CUBE, 1)
    calibration = acs.calibrate(campaign)
    left = calibration.content["quality"]["tilt_rms_mgon"]
    own = np.array([left["roll"], left["pitch"]])
    for cap in ("45 deg", np.pi / 4):  # 50 gon
        np.testing.assert_allclose(calibration.tilt_error(cap) / MGON, own, rtol=1e-9)
    advice = acs.advise(campaign, tilt_accuracy="10mgon", tilt_range="50gon")
    np.testing.assert_allclose(advice.rms / MGON, own, rtol=1e-9)
    chance = acs.compare(calibration, calibration).content["tilt"]
    of_two = np.array([chance["roll_by_chance_mgon"], chance["pitch_by_chance_mgon"]])
    np.testing.assert_allclose(of_two, np.sqrt(2) * own, rtol=1e-9)
    log = pd.DataFrame(cap_forces(50 * GON, 200), columns=["fx", "fy", "fz"])
    sigmas = ["sigma_roll_mgon", "sigma_pitch_mgon"]
    quiet, noisy = (
        np.sqrt(np.mean(acs.apply(calibration, log, sigma=s)[sigmas].to_numpy() ** 2, axis=0))
        for s in (0.0, 0.002)
    )
    np.testing.assert_allclose(quiet, own, rtol=0.02)  # readings are not the true forces
    np.testing.assert_allclose(noisy[1], np.hypot(own[1], 0.002 / 9.80665 / MGON), rtol=0.02)


def test_the_approach_follows_the_campaign_and_is_said(tmp_path):
    """`calibrate` left the angles of the robot aside without a word."""
    campaign = tmp_path / "aided"
    succeed("simulate-campaign", "--out", campaign, "--approach", "robot", "--seed", 2)
    said = succeed("calibrate", campaign, "--out", tmp_path / "c").output
    assert "the roll and pitch of a robot (approach robot)" in said
    assert acs.read_calibration(tmp_path / "c").content["approach"] == "robot"
    options = ("--approach", "gravity", "--out", tmp_path / "g")
    said = succeed("calibrate", campaign, *options).output
    assert "gravity alone; the measured roll and pitch are not used" in said
    page = (tmp_path / "g/report.html").read_text(encoding="utf-8")
    assert "approach gravity, the measured roll and pitch are not used · " in text_of(page)


def test_one_p_value_of_a_position_in_conflict(tmp_path):
    """Two bumps hide each other: one had p = 0.015 in the box and > 0.999 in the table."""

    def bumped(directions):
        errors = np.zeros_like(directions)
        errors[[4, 11]] = -np.array([[0.05], [0.012]]) * directions[[4, 11]]
        return errors

    calibration = acs.calibrate(written(tmp_path / "bumped", CUBE, 1, bumped))
    suspects = calibration.content["quality"]["suspects"]
    named = {suspect["position"]: suspect["p_value"] for suspect in suspects}
    assert {5, 12} <= set(named)
    table = calibration.residuals.set_index("position")
    for position, p_value in named.items():
        assert table.loc[position, "p_value_adjusted"] == p_value < 0.05
