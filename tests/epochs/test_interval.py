"""The promised tilt error beside readings of simulated sensors, leveled by plain trigonometry."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from session_helpers import document

from accelstudy.basics.units import GON, MGON
from accelstudy.campaign.calibration.applying import calibration_of
from accelstudy.epochs.history import YEAR, history_of
from accelstudy.epochs.interval import Interval

G = 9.80665
N = 200
CONFIDENCE = 0.9
AT = np.array([-2.5, -2.0, -1.4, -0.9, -0.5, 0.0])
"""Years of the sessions."""


@pytest.fixture(scope="module")
def session():
    effects = ("bias: 0.1, 0.05, -0.1", "scale: 0.002, -0.001, 0.003")
    return calibration_of(document(1, model="bias-scale", effects=effects))


def roll_and_pitch(f):
    """In rad, of forces whose z axis points down."""
    x, y, z = -f.T
    return np.array([np.arctan2(y, z), np.arctan2(-x, np.hypot(y, z))])


def tilts(rng, largest, n=300):
    """Directions of gravity, even over a cap."""
    z = rng.uniform(np.cos(largest), 1, n)
    azimuth = rng.uniform(0, 2 * np.pi, n)
    return np.stack([np.sqrt(1 - z**2) * w for w in (np.cos(azimuth), np.sin(azimuth))] + [z], 1)


def error_in_use(truth, calibrated, directions):
    """Larger rms of roll and pitch where (1 + s) f + b is read and b and s are corrected."""
    forces = -G * directions
    readings = (1 + truth[3:]) * forces + truth[:3]
    corrected = (readings - calibrated[:3]) / (1 + calibrated[3:])
    apart = roll_and_pitch(corrected) - roll_and_pitch(forces)
    return np.sqrt(np.mean(apart**2, axis=1)).max()


@pytest.mark.parametrize(("scatter", "drift"), [(0.0, 0.0), (3.0, 0.0), (10.0, 20.0), (0.0, 9.0)])
def test_the_promise_is_kept(session, scatter, drift):
    """Parameters scatter, and drift in a year, by some of their sigmas, each on its own."""
    rng = np.random.default_rng(round(scatter + drift))
    sigma = np.sqrt(np.diag(session.covariance))
    root = np.linalg.cholesky(session.covariance)
    dates = [datetime(2025, 1, 1) + timedelta(seconds=YEAR * at) for at in AT]
    directions = tilts(rng, 50 * GON)
    kept = []
    for _ in range(N):
        rate = drift * sigma * rng.uniform(-1, 1, 6)
        start = session.parameters + scatter * sigma * rng.standard_normal((7, 6))
        truth = start[:6] + AT[:, None] * rate
        estimates = truth + rng.standard_normal((6, 6)) @ root.T
        each = [replace(session, parameters=estimate) for estimate in estimates]
        interval = Interval(history_of(each, dates), MGON, 50 * GON, CONFIDENCE)
        now = [error_in_use(start[6] + rate * t, estimates[-1], directions) for t in (0.0, 1.0)]
        kept.append([error <= interval.error(t) for error, t in zip(now, (0.0, 1.0), strict=True)])
    print(np.mean(kept, axis=0))
    tolerance = 3.3 * np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / N)
    assert np.all(np.mean(kept, axis=0) >= CONFIDENCE - tolerance)
