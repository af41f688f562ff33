"""A calibrated sensor as reference, against simulated sessions."""

from dataclasses import replace

import numpy as np
import pytest
from campaign_helpers import made
from usual import GRAVITY, NINE, ROBOT, TWELVE, G

from accelstudy.adjustment import Observations, calibrate
from accelstudy.adjustment.quality import solve
from accelstudy.campaign.calibration.fit import campaign_observations, fit_campaign
from accelstudy.campaign.calibration.sigma_check import check_sigmas
from accelstudy.campaign.format import read_campaign, write_campaign
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.diagnosis.next_positions import candidate_rows
from accelstudy.diagnosis.space.frame import SessionFit
from accelstudy.leveling.angles import angles_of
from accelstudy.positions.points import evenly_spread

SESSIONS = 120
NOISE, NOISE_OF_REFERENCE = 1e-3, 0.5e-3


@pytest.fixture(scope="module")
def known():
    """Covariance matrix of a reference that was calibrated by gravity in 18 positions."""
    ideal = Observations(-G * evenly_spread(18)[None], 1e-3)
    return calibrate(NINE, GRAVITY, ideal).cofactors[0]


def sessions(covariance, count, seed, frame="frd"):
    """Campaigns beside a reference whose calibration is wrong as its covariance says.

    Each with the true parameters of the sensor that is calibrated.
    """
    rng = np.random.default_rng(seed)
    root = np.linalg.cholesky(covariance)
    forces = -G * evenly_spread(20)
    for _ in range(count):
        truth = np.concatenate([0.1 * rng.standard_normal(3), 5e-3 * rng.standard_normal(9)])
        own = np.concatenate([0.05 * rng.standard_normal(3), 2e-3 * rng.standard_normal(6)])
        told = own + root @ rng.standard_normal(9)
        beside = ReferenceSensor(
            calibration="reference",
            frame=frame,
            sigma_mps2=NOISE_OF_REFERENCE,
            effects=[effect.spec for effect in NINE.effects],
            parameters=told.tolist(),
            covariance=covariance.tolist(),
        )
        reading = NINE.sense(beside.axes.from_frd(forces), own)
        reading = reading + NOISE_OF_REFERENCE * rng.standard_normal(forces.shape)
        angles = angles_of(beside.axes.to_frd(NINE.correct(reading, told)))
        measured = TWELVE.sense(forces, truth) + NOISE * rng.standard_normal(forces.shape)
        yield (
            truth,
            made(measured, G, NOISE, angles=angles, header={"reference": beside}),
        )


def test_sigmas_contain_the_calibration_of_the_reference(known):
    inside, omega = [], []
    for truth, campaign in sessions(known, SESSIONS, seed=1):
        result = calibrate(TWELVE, ROBOT, campaign_observations(campaign))
        sigma = result.sigma_priori[0, :12]
        inside.append(np.abs(result.parameters[0, :12] - truth) < 1.96 * sigma)
        omega.append(result.omega[0] / result.redundancy)
    # A share of 0.95 of 120 sessions scatters by 0.02.
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 0.06)
    assert np.mean(omega) == pytest.approx(1, abs=4 * np.sqrt(2 / result.redundancy / SESSIONS))


@pytest.fixture(scope="module")
def campaign(known):
    """A campaign beside a reference whose x axis points to the right."""
    ((_, campaign),) = sessions(known, 1, seed=2, frame="rbd")
    return campaign


def test_common_errors_are_those_of_changed_parameters(campaign):
    """J L by the package, against roll and pitch with a calibration that is changed a little."""
    beside, angles = campaign.header.reference, campaign.angles
    _, common = beside.errors(angles, G)
    own = beside.axes.from_frd(G * np.column_stack(_directions(angles)))
    p = np.array(beside.parameters)
    reading = NINE.sense(own, p)
    step = np.cov(np.random.default_rng(1).standard_normal((9, 40)))[0] * 1e-5

    def roll_and_pitch(parameters):
        return angles_of(beside.axes.to_frd(NINE.correct(reading, parameters)))

    change = (roll_and_pitch(p + step) - roll_and_pitch(p - step)) / 2
    # A step of the parameters is L c; that of the angles is then J L c.
    values, vectors = np.linalg.eigh(np.array(beside.covariance))
    c = (vectors / np.sqrt(values)).T @ step
    np.testing.assert_allclose(common @ c, change, atol=1e-9)


def _directions(angles):
    roll, pitch = angles.T
    return np.sin(pitch), -np.cos(pitch) * np.sin(roll), -np.cos(pitch) * np.cos(roll)


def test_the_part_of_the_reference_is_what_its_errors_add(known):
    """What is left is what an adjustment without common errors finds."""
    ((_, campaign),) = sessions(known, 1, seed=3)
    fit = fit_campaign(campaign, TWELVE, ROBOT)
    alone = replace(campaign_observations(campaign), common=None)
    sigma = calibrate(TWELVE, ROBOT, alone).sigma_priori[0, :12]
    part = fit.sigma**2 - np.diag(fit.by_reference)
    assert np.all(fit.sigma > sigma)
    np.testing.assert_allclose(np.sqrt(part), sigma, rtol=0.05)


def test_the_diagnosis_asks_for_positions_with_the_same_covariance(campaign):
    solution = solve(TWELVE, ROBOT, campaign_observations(campaign))
    frame = SessionFit.of(solution)
    found, expected = candidate_rows(frame, frame.forces, frame.hold), solution.design[: 3 * 20]
    size = np.linalg.norm(expected, axis=0)
    normal = np.einsum("kcu,kcv->uv", found / size, found / size)
    np.testing.assert_allclose(normal, (expected / size).T @ (expected / size), atol=0.05)


def test_a_reference_has_no_errors_of_a_robot(campaign):
    solution = solve(TWELVE, ROBOT, campaign_observations(campaign))
    tested = SessionFit.of(solution).tested
    of_robot = {"encoder_scale", "encoder_offset", "base_tilt", "axis_nonperpendicularity"}
    assert of_robot < {*tested.untestable}
    assert {"quadratic_scale", "bias_drift"} & {*tested.shapes}
    assert not of_robot & {*tested.shapes}


def test_simulated_sessions_confirm_the_sigmas(campaign):
    """The check by simulation draws the errors that all holds share, too."""
    table = check_sigmas(fit_campaign(campaign, TWELVE, ROBOT), 500)
    # Standard deviations of 500 scatter by 3 %.
    np.testing.assert_allclose(table["ratio"], 1, atol=0.13)


def test_a_header_with_a_reference_is_read_again(campaign, tmp_path):
    write_campaign(campaign, tmp_path)
    again = read_campaign(tmp_path)
    assert again.header.reference == campaign.header.reference
    np.testing.assert_allclose(again.angles, campaign.angles, rtol=1e-13)
