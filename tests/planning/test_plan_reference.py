"""A plan with a calibrated sensor beside the one that is calibrated."""

import json

import numpy as np
import pytest
from calling import refusal, succeed
from usual import NINE, TWELVE, G

from accelstudy.adjustment import Observations, calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.units import GON, MGON
from accelstudy.data_sheets import sheet_of_sigma
from accelstudy.leveling.angles import angles_of
from accelstudy.leveling.error import cap_forces
from accelstudy.planning.answer import _with_calibrated_sensor
from accelstudy.planning.candidates import information_of, tilt_of
from accelstudy.planning.question import ROBOT, Equipment, Question, planned_reference
from accelstudy.schemes import get_scheme

SIGMA, RANGE, SESSIONS = 2e-3, 30 * GON, 2000


@pytest.fixture(scope="module")
def beside():
    return Equipment("reference", 20.0, 300.0, planned_reference("alike", sheet_of_sigma(SIGMA)))


def test_what_is_left_is_what_simulated_sessions_leave(beside):
    """Both sensors are simulated: the reference by its own, wrong calibration."""
    rng = np.random.default_rng(3)
    scheme, reference = get_scheme("fibonacci-15"), beside.reference
    question = Question(10 * MGON, RANGE, sheet_of_sigma(SIGMA), (beside,))
    information = information_of(question, beside, scheme.directions, SIGMA)
    expected = tilt_of(question, information, TWELVE, {}).rms
    forces, used = -G * scheme.directions, cap_forces(RANGE, 64)
    told = rng.standard_normal((SESSIONS, 9)) @ np.linalg.cholesky(reference.covariance).T
    # The reference itself is ideal, and its calibration is wrong.
    own, measured = forces + SIGMA * rng.standard_normal((2, SESSIONS, *forces.shape))
    angles = angles_of(NINE.correct(own, told))
    sigma, common = reference.errors(angles_of(forces), G)
    observed = Observations(measured, SIGMA, angles, sigma, common=common)
    estimates = calibrate(TWELVE, get_approach("robot"), observed).parameters[:, :12]
    every = np.broadcast_to(used, (SESSIONS, *used.shape))
    error = angles_of(TWELVE.correct(every, estimates)) - angles_of(used)
    # The rms of a few independent errors scatters by about half of its own size.
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=(0, 1))), expected, rtol=0.03)
    # With a robot of the same noise it would be clearly less.
    robot = Question(10 * MGON, RANGE, sheet_of_sigma(SIGMA), sigma_angle=reference.sigma_mps2 / G)
    information = information_of(robot, ROBOT, scheme.directions, SIGMA)
    robot = tilt_of(robot, information, TWELVE, {}).rms
    assert np.all(robot < 0.85 * expected)


def test_only_models_with_the_rotation_are_tried(beside):
    question = Question(30 * MGON, RANGE, sheet_of_sigma(SIGMA), beside=beside, most_positions=20)
    found = _with_calibrated_sensor(question)
    names = {effect.name for effect in found.model.effects}
    assert names & {"cross_axis_misalignment", "mounting_rotation"}
    assert found.seconds == 300 + found.scheme.n_positions * 30


def test_the_command_says_what_it_takes_for_granted():
    words = ("--sigma", "2mm/s2", "--reference", "alike", "--max-positions", "20")
    said = succeed("plan", "--tilt-accuracy", "30mgon", "--replicates", "20", *words).output
    assert "positions by hand beside a calibrated sensor" in said
    assert "By linear theory it leaves" in said
    assert "of the same type, calibrated by gravity alone in 24 evenly spread positions" in said


def test_a_calibration_that_cannot_be_a_reference(tmp_path):
    words = ("plan", "--tilt-accuracy", "30mgon", "--sigma", "2mm/s2", "--reference")
    assert "no-such.json" in refusal(*words, tmp_path / "no-such.json")
    other = tmp_path / "calibration.json"
    other.write_text(json.dumps({"schema_version": 1}))
    assert "not a calibration.json" in refusal(*words, other)
