"""The promised tilt error beside readings of simulated sensors, leveled by plain trigonometry."""

from dataclasses import replace
from datetime import datetime, timedelta

import numpy as np
import pytest
from closed_forms import roll_and_pitch
from session_helpers import calibrated
from usual import share_tolerance

from accelstudy.basics.units import GON, MGON
from accelstudy.epochs.course import YEAR
from accelstudy.epochs.history import History
from accelstudy.epochs.interval import MAX_YEARS, Interval

G = 9.80665
N = 40
CONFIDENCE = 0.9
AT = np.array([-2.5, -2.0, -1.4, -0.9, -0.5, 0.0])
"""Years of the sessions."""


@pytest.fixture(scope="module")
def session():
    effects = ("bias: 0.1, 0.05, -0.1", "scale: 0.002, -0.001, 0.003")
    return calibrated(1, model="bias-scale", effects=effects).sensor


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
    return np.sqrt(np.mean(apart**2, axis=0)).max()


@pytest.mark.parametrize(("sessions", "scatter", "drift"), [
    (6, np.full(6, 3.0), 0.0), (6, np.full(6, 10.0), 20.0),
    (4, np.array([10.0, 0, 0, 0, 0, 0]), 0.0), (3, np.full(6, 3.0), 9.0),
])  # fmt: skip
def test_the_promise_is_kept(session, sessions, scatter, drift):
    """Parameters scatter, and drift in a year, by some of their sigmas, each on its own."""
    rng = np.random.default_rng(7)
    sigma, at = np.sqrt(np.diag(session.covariance)), AT[-sessions:]
    root = np.linalg.cholesky(session.covariance)
    dates = [datetime(2025, 1, 1) + timedelta(seconds=YEAR * years) for years in at]
    directions = tilts(rng, 50 * GON)
    kept = []
    for _ in range(N):
        rate = drift * sigma * rng.uniform(-1, 1, 6)
        switched = session.parameters + scatter * sigma * rng.standard_normal((sessions + 1, 6))
        truth = switched[:-1] + at[:, None] * rate
        estimates = truth + rng.standard_normal(truth.shape) @ root.T
        each = [replace(session, parameters=estimate) for estimate in estimates]
        interval = Interval(History(each, dates, 50 * GON), MGON, CONFIDENCE)
        kept.append([
            error_in_use(switched[-1] + rate * years, estimates[-1], directions)
            <= interval.error(years) for years in (0.0, 1.0)
        ])  # fmt: skip
    assert np.all(np.mean(kept, axis=0) >= CONFIDENCE - share_tolerance(CONFIDENCE, N))


def test_a_sensor_that_drifts_is_good_until_the_drift_is_as_large(session):
    """Without noise or scatter, the bias of x becomes a pitch by itself."""
    quiet = replace(session, covariance=1e-10 * session.covariance)
    dates = [datetime(2025, 1, 1) + timedelta(seconds=YEAR * years) for years in AT]

    def history_of(changes):
        values = session.parameters + 0.01 * np.outer(changes, np.eye(6)[0])
        return History([replace(quiet, parameters=each) for each in values], dates, 1e-3)

    history = history_of(AT)
    interval = Interval(history, 0.01 / G * 2.5, CONFIDENCE)
    assert interval.years == pytest.approx(2.5, rel=5e-3)  # the scale of x is not 1
    after = datetime.fromisoformat(interval.until) - dates[-1]
    assert after.days == int(interval.years * YEAR / 86400)
    assert Interval(history, 0.01 / G * 20, CONFIDENCE).years == MAX_YEARS
    assert Interval(history_of(AT > -1), 1e-6, CONFIDENCE).years == MAX_YEARS  # a step is no drift
    assert Interval(History([session] * 3, dates[:3], 1e-3), 1e-6, CONFIDENCE).years == 0
