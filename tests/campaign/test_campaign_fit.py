"""Calibration of measured campaigns: known parameters, public data, exports."""

import re

import numpy as np
import pytest
from campaign_helpers import FIVE_AXES, made, simulated_campaign
from usual import GRAVITY, NINE, ROBOT

from accelstudy.basics.errors import InputError
from accelstudy.campaign.calibration.fit import fit_campaign, initial_values
from accelstudy.campaign.calibration.wording import sentences
from accelstudy.schemes import get_scheme


@pytest.mark.parametrize("scheme", ["mclaren-24", "faces-edges-18"])
@pytest.mark.parametrize("approach", [GRAVITY, ROBOT], ids=lambda a: a.name)
def test_a_poor_sensor_is_calibrated_from_automatic_initial_values(approach, scheme):
    """Biases of 1.5 m/s² and scales 30 % above and 55 % below 1 are far from the ideal sensor.

    At the poles of the second scheme the noise of a reading makes another roll.
    """
    truth = {"b_x": 1.5, "b_y": -0.8, "b_z": 0.4, "s_x": 0.3, "s_y": 0.28, "s_z": -0.55}
    truth |= {"alpha_yz": 0.02, "alpha_zy": -0.03, "alpha_zx": 0.01}
    fit = fit_campaign(simulated_campaign(truth, scheme, sigma=2e-4), NINE, approach)
    errors = (fit.parameters - NINE.vector(truth)) / fit.sigma
    assert np.abs(errors).max() < 4.5


@pytest.mark.parametrize(("positions", "scales"), [(30, [0.05, -0.5, 0.4]), (4, [0.05] * 3)])
def test_initial_values_are_the_ellipsoid_nearest_to_a_sphere(positions, scales):
    directions = get_scheme("fibonacci-30").directions[:positions]
    forces = np.array([0.3, -0.2, 0.1]) + (1 + np.array(scales)) * 9.81 * directions
    start = initial_values(NINE, forces, 9.81)
    assert start == pytest.approx([0.3, -0.2, 0.1, *scales, 0, 0, 0], abs=1e-12)


@pytest.mark.parametrize(("bumped", "said"), [
    ([], None),
    ([15], r"position 16 \(p [=<].*, adjusted"),
    ([3, 20, 11], r"positions 4, 12 and 21 \(the largest p.*bumped there, or the model lacks an"),
])  # fmt: skip
def test_positions_in_conflict_are_not_blamed_alone(bumped, said):
    """A bumped hold stands out, and so do those after a knock of the mounting."""
    measured = simulated_campaign({"b_x": 0.1}, seed=2)
    factors = np.ones((measured.n_positions, 1))
    factors[bumped, 0] = [1.01, 0.994, 1.003][: len(bumped)]
    measured = measured.with_arrays(forces=factors * measured.forces)
    lines = sentences(fit_campaign(measured, NINE, GRAVITY))
    found = [line for line in lines if line.startswith("In conflict")]
    assert len(found) == bool(bumped)
    assert ("“accelstudy diagnose” looks for what is wrong or missing." in lines) == bool(bumped)
    for line in found:
        assert re.match(f"In conflict with the others: {said}", line)


@pytest.mark.parametrize("stated", [True, False])
@pytest.mark.parametrize(("sigma", "repeats"), [(2e-5, 1), (2e-2, 1), (2e-3, 4)])
def test_the_noise_of_readings_gives_no_rank(sigma, repeats, stated):
    """Neither the noise nor the scales and angles of a sensor make eight parameters nine."""
    sensor = np.array([[1.004, 0, 0], [0.005, 0.997, 0], [-0.008, 0.006, 1.006]])
    ideal = -9.80665 * np.repeat(FIVE_AXES, repeats, axis=0) @ sensor.T + [0.12, -0.08, 0.2]
    rng = np.random.default_rng(36)
    for _ in range(15):
        forces = ideal + sigma * rng.standard_normal(ideal.shape)
        read = made(forces, sigma=sigma if stated else None)
        with pytest.raises(InputError, match=r"rank 8 of 9: .*s_x, s_y, s_z"):
            fit_campaign(read, NINE, GRAVITY)


def test_what_shows_weakly_but_above_the_noise_is_determined():
    """A tenth position, two degrees beside the first: hardly, but with sigmas that hold."""
    faces = np.concatenate([FIVE_AXES, FIVE_AXES[:1] + np.array([0.03, 0.03, 0])])
    faces /= np.linalg.norm(faces, axis=1)[:, None]
    forces = -9.80665 * faces * [1.004, 0.997, 1.006] + [0.12, -0.08, 0.2]
    forces += 2e-4 * np.random.default_rng(36).standard_normal(forces.shape)
    read = made(forces, sigma=2e-4)
    fit = fit_campaign(read, NINE, GRAVITY)
    off = fit.parameters[:6] - [0.12, -0.08, 0.2, 0.004, -0.003, 0.006]
    assert np.all(np.abs(off) < 4 * fit.sigma[:6])
