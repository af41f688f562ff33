"""A calibrated sensor as reference, against simulated sessions."""

from dataclasses import replace

import numpy as np
import pytest

from accelstudy.adjustment import Observations, calibrate
from accelstudy.approaches import get_approach
from accelstudy.basics.units import STANDARD_GRAVITY as G
from accelstudy.campaign.calibration.fit import campaign_observations
from accelstudy.campaign.reference import ReferenceSensor
from accelstudy.campaign.session import Campaign
from accelstudy.leveling.angles import angles_of
from accelstudy.positions.points import evenly_spread
from accelstudy.sensors.models import get_model

NINE = get_model("bias-scale-nonorthogonality")
TWELVE = get_model("bias-scale-nonorthogonality-crossaxis")
SESSIONS = 250
ROBOT, GRAVITY = get_approach("robot"), get_approach("gravity")
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
        yield truth, Campaign(
            name="beside",
            positions=np.arange(1, 21),
            forces=measured,
            gravity=G,
            sigma_force=NOISE,
            angles=angles,
            sigma_angle=NOISE_OF_REFERENCE / G,
            reference=beside,
        )


def test_sigmas_contain_the_calibration_of_the_reference(known):
    inside, alone, omega = [], [], []
    for truth, campaign in sessions(known, SESSIONS, seed=1):
        observed = campaign_observations(campaign)
        for common, hits in ((observed.common, inside), (None, alone)):
            result = calibrate(TWELVE, ROBOT, replace(observed, common=common))
            sigma = result.sigma_priori[0, :12]
            hits.append(np.abs(result.parameters[0, :12] - truth) < 1.96 * sigma)
            if common is not None:
                omega.append(result.omega[0] / result.redundancy)
    # A share of 0.95 of 250 sessions scatters by 0.014.
    assert np.all(np.abs(np.mean(inside, axis=0) - 0.95) < 0.045)
    assert np.min(np.mean(alone, axis=0)) < 0.85
    assert np.mean(omega) == pytest.approx(1, abs=4 * np.sqrt(2 / result.redundancy / SESSIONS))
